"""``lfstereo evaluate``: errors of every network and of classical methods on scenes of known disparity."""

from __future__ import annotations

import argparse
import csv
import json
import re
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import atomic_file, check_absent
from lfstereo.progress import progress_bar, silent
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions

if TYPE_CHECKING:
    from lfstereo.simulate.stack_dataset import DualStack
    from lfstereo.training.rows import Row

_TITLES = ("MAE/100", "MAE px", "bad 0.5", "bad 1", "bad 2", "bad 4", "density", "PSNR dB", "s")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "folders",
        nargs="*",
        type=Path,
        help="Middlebury scenes, folders of them, or FlyingThings3D, photographed anew; or dual focal stack data sets",
    )
    parser.add_argument("--synthetic", type=int, default=0, metavar="N", help="also N rendered, held-out scenes")
    parser.add_argument("--size", default="540x960", metavar="HxW", help="of rendered scenes [px] (default: 540x960)")
    parser.add_argument("--model", help="a shipped model's name, or a model folder (default: that of lfstereo run)")
    parser.add_argument("--no-network", action="store_true", help="classical methods only")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto", help="where networks run")
    parser.add_argument("--disparity-scale", type=float, help="what grey-coded disparities are divided by")
    parser.add_argument("--far-first", action="store_true", help="slice 0 is the farthest in data sets of other makers")
    parser.add_argument("-o", "--output", type=Path, help="CSV file with one row per scene and method")
    parser.add_argument("--force", action="store_true", help="replace a CSV file that exists")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON on stdout")
    add_arguments(parser.add_argument_group("virtual camera"), PhotographOptions)  # type: ignore[arg-type]
    add_arguments(parser.add_argument_group("its lens and sensor"), VirtualDslrOptions)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    height, width = picture_size("--size", arguments.size)
    if arguments.synthetic < 0 or not (arguments.folders or arguments.synthetic):
        raise ConfigError(
            f"nothing to evaluate on: found no folder and --synthetic {arguments.synthetic}; give a folder of scenes, "
            "or the number of scenes to render"
        )
    if arguments.output:
        check_absent(arguments.output, arguments.force)
    from lfstereo.network.estimate import load_network
    from lfstereo.network.shipped import DEFAULT_MODEL
    from lfstereo.training.comparison import compare
    from lfstereo.training.rows import summarise

    total, cases = _cases(arguments, height, width)
    network = None if arguments.no_network else load_network(arguments.model or DEFAULT_MODEL, arguments.device)
    rows: list[Row] = []
    with nullcontext(silent) if arguments.json else progress_bar("evaluate") as progress:
        for done, case in enumerate(cases):
            rows += compare(case, network)
            progress(done + 1, total)
    means = summarise(rows)
    if arguments.output:
        _write_csv(arguments.output, [*rows, *means], arguments.force)
    judged = "none" if network is None else f"{network.card.name}-v{network.card.version} {network.card.sha256[:12]}"
    if arguments.json:
        table = {"scenes": [asdict(row) for row in rows], "all": [asdict(row) for row in means]}
        print(json.dumps({"model": judged.strip(), **table}, indent=2))
    else:
        print(f"model: {judged}\n{_table([*rows, *means], total)}")
    return 0


def _cases(arguments: argparse.Namespace, height: int, width: int) -> tuple[int, Iterator[DualStack]]:
    """Count the scenes to judge on, and make them one at a time."""
    from itertools import chain

    from lfstereo.simulate.stack_dataset import list_dual_stacks, stack_folder
    from lfstereo.simulate.stereo_scenes import find_scenes
    from lfstereo.simulate.synthesis import SplitOptions, frames_for_tests
    from lfstereo.training.comparison import dataset_cases, photographed_cases, synthetic_cases
    from lfstereo.training.evaluate import HELD_OUT_SEED

    options, dslr = from_arguments(PhotographOptions, arguments), from_arguments(VirtualDslrOptions, arguments)
    ratio = getattr(arguments, "aperture_ratio", None)
    sources = [synthetic_cases(arguments.synthetic, height, width, ratio, HELD_OUT_SEED + dslr.seed)]
    total = arguments.synthetic
    for folder in arguments.folders:
        if stack_folder(folder, dslr.noise).is_dir():
            names = list_dual_stacks(folder, "test", dslr.noise)
            sources.append(dataset_cases(folder, names, dslr.noise, options if ratio else None, arguments.far_first))
            total += len(names)
        else:
            found = find_scenes(folder, arguments.disparity_scale)
            scenes = frames_for_tests(found, options.near_px, SplitOptions(), dslr.seed)
            sources.append(photographed_cases(scenes, options, dslr))
            total += len(scenes)
    return total, chain.from_iterable(sources)


def picture_size(flag: str, text: str) -> tuple[int, int]:
    """Read ``HEIGHTxWIDTH``.

    Raises
    ------
    ConfigError
        If it is not of that form, or smaller than 64x64 px.
    """
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match or min(size := (int(match[1]), int(match[2]))) < 64:
        raise ConfigError(f"{flag} {text}: expected HEIGHTxWIDTH in px, 64x64 or more, such as 540x960")
    return size


def _table(rows: list[Row], scenes: int) -> str:
    lines = [f"{'':<18}" + "".join(f"{title:>9}" for title in _TITLES)]
    for index, row in enumerate(rows):
        if index == 0 or rows[index - 1].scene != row.scene:
            lines.append(f"mean of {scenes} scenes" if row.scene == "all" else row.scene)
        errors = (row.bad_05, row.bad_1, row.bad_2, row.bad_4, row.density)
        cells = [_cell(row.mae_norm, ".4f"), _cell(row.mae_px, ".3f"), *(_cell(e, ".1f", "%") for e in errors)]
        cells += [_cell(row.psnr_db, ".2f"), _cell(row.seconds, ".2f")]
        lines.append(f"  {row.method:<16}" + "".join(f"{cell:>9}" for cell in cells))
    return "\n".join(lines)


def _cell(value: float | None, form: str, unit: str = "") -> str:
    return "-" if value is None else f"{value:{form}}{unit}"


def _write_csv(path: Path, rows: list[Row], force: bool) -> None:
    names = [f.name for f in fields(rows[0])]
    with atomic_file(path, force) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer: Any = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: round(v, 6) if isinstance(v, float) else v for k, v in asdict(row).items()} for row in rows
        )
