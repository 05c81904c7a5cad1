"""``lfstereo train``: one or several stages of training from recipes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lfstereo.network.families import AnyArchitecture
    from lfstereo.training.recipe import Recipe
    from lfstereo.training.sources import Rings
    from lfstereo.training.workers import Worker


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "recipes",
        type=Path,
        nargs="+",
        metavar="RECIPE",
        help="recipe file (TOML), such as those in models/recipes; each starts from what those before it made",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="the run's folder; with several recipes, the folder of theirs",
    )
    parser.add_argument("--minutes", type=float, nargs="+", help="end each run after this much training time [min]")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoints in the folder")
    parser.add_argument("--pool", help="folder of rendered stacks, in place of the recipe's")
    parser.add_argument("--fronts", help="folder that the stage 'fronts' filled, in place of the recipe's")
    parser.add_argument("--start-from", nargs="*", metavar="PART=FOLDER", help="in place of the recipe's start_from")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto", help="where to train")


def run(arguments: argparse.Namespace) -> int:
    """Train."""
    from lfstereo.errors import ConfigError, OutputError
    from lfstereo.training.checkpoint import FOLDER
    from lfstereo.training.recipe import read_recipe
    from lfstereo.training.stages import TRAINED
    from lfstereo.training.workers import join_workers

    minutes = arguments.minutes or [None]
    if len(minutes) == 1:
        minutes = minutes * len(arguments.recipes)
    if len(minutes) != len(arguments.recipes):
        raise ConfigError(f"--minutes: {len(minutes)} values, expected 1 or {len(arguments.recipes)}, one per recipe")
    plans = [read_recipe(path) for path in arguments.recipes]
    alone = len(plans) == 1
    outputs = [arguments.output if alone else arguments.output / path.stem for path in arguments.recipes]
    for output in outputs:
        if (output / FOLDER).exists() and not arguments.resume:
            raise OutputError(f"{output}: holds a checkpoint already; add --resume, or give another folder")
    rings: Rings = {}
    made: list[str] = []
    with join_workers(arguments.device) as worker:
        for (recipe, architecture), output, limit in zip(plans, outputs, minutes, strict=True):
            recipe = _replaced(recipe, arguments, made)
            output.mkdir(parents=True, exist_ok=True)
            _train(recipe, architecture, output, limit, arguments.resume and (output / FOLDER).exists(), worker, rings)
            made.extend(f"{part}={output}" for part in TRAINED.get(recipe.stage, ()))
    return 0


def _replaced(recipe: Recipe, arguments: argparse.Namespace, made: list[str]) -> Recipe:
    """The recipe with what the command line says, and with the parts that earlier recipes made."""
    import dataclasses

    given = recipe.start_from if arguments.start_from is None else tuple(arguments.start_from)
    pool, fronts = arguments.pool or recipe.pool, arguments.fronts or recipe.fronts
    return dataclasses.replace(recipe, pool=pool, fronts=fronts, start_from=(*given, *made))


def _train(
    recipe: Recipe,
    architecture: AnyArchitecture,
    output: Path,
    minutes: float | None,
    resume: bool,
    worker: Worker,
    rings: Rings,
) -> None:
    import sys

    from lfstereo.progress import progress_bar
    from lfstereo.training.curve import read_curve
    from lfstereo.training.loop import CURVE, train

    with progress_bar(f"train {recipe.stage}") as progress:
        done = train(recipe, architecture, output, minutes, resume, progress, worker=worker, rings=rings)
    if worker.leads and (output / CURVE).exists() and (rows := read_curve(output / CURVE)):
        print(
            f"{recipe.stage}: {done.step} steps, {done.elapsed_s / 60:.1f} min, loss {rows[0][4]:.4f} at first, "
            f"{rows[-1][4]:.4f} at last",
            file=sys.stderr,
        )
