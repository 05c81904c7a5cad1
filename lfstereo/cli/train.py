"""``lfstereo train``: one stage of training from a recipe."""

from __future__ import annotations

import argparse
from pathlib import Path


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("recipe", type=Path, help="recipe file (TOML), such as those in models/recipes")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the run's folder, for its checkpoints")
    parser.add_argument("--minutes", type=float, help="end after this much training time [min]")
    parser.add_argument("--resume", action="store_true", help="go on from the folder's checkpoint")
    parser.add_argument("--pool", help="folder of rendered stacks, in place of the recipe's")
    parser.add_argument("--start-from", nargs="*", metavar="PART=FOLDER", help="in place of the recipe's start_from")


def run(arguments: argparse.Namespace) -> int:
    """Train."""
    import dataclasses

    from lfstereo.errors import OutputError
    from lfstereo.progress import progress_bar
    from lfstereo.training.checkpoint import FOLDER
    from lfstereo.training.loop import train
    from lfstereo.training.recipe import read_recipe

    recipe, architecture = read_recipe(arguments.recipe)
    if arguments.pool:
        recipe = dataclasses.replace(recipe, pool=arguments.pool)
    if arguments.start_from is not None:
        recipe = dataclasses.replace(recipe, start_from=tuple(arguments.start_from))
    if (arguments.output / FOLDER).exists() and not arguments.resume:
        raise OutputError(f"{arguments.output}: holds a checkpoint already; add --resume, or give another folder")
    arguments.output.mkdir(parents=True, exist_ok=True)
    with progress_bar(f"train {recipe.stage}") as progress:
        train(recipe, architecture, arguments.output, arguments.minutes, arguments.resume, progress)
    return 0
