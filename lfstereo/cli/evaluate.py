"""``lfstereo evaluate``: errors of every network and of classical methods on scenes of known disparity."""

from __future__ import annotations

import argparse
import csv
import json
import re
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
    from lfstereo.training.comparison import Row

_TITLES = ("MAE/100", "MAE px", "bad 0.5", "bad 1", "bad 2", "bad 4", "density", "PSNR dB", "s")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "folders", nargs="*", type=Path, help="Middlebury scenes, folders of them, or FlyingThings3D; photographed anew"
    )
    parser.add_argument("--synthetic", type=int, default=0, metavar="N", help="also N rendered, held-out scenes")
    parser.add_argument("--size", default="540x960", metavar="HxW", help="of rendered scenes [px] (default: 540x960)")
    parser.add_argument("--model", help="a shipped model's name, or a model folder (default: that of lfstereo run)")
    parser.add_argument("--no-network", action="store_true", help="classical methods only")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto", help="where networks run")
    parser.add_argument("--disparity-scale", type=float, help="what grey-coded disparities are divided by")
    parser.add_argument("-o", "--output", type=Path, help="CSV file with one row per scene and method")
    parser.add_argument("--force", action="store_true", help="replace a CSV file that exists")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON on stdout")
    add_arguments(parser.add_argument_group("virtual camera"), PhotographOptions)  # type: ignore[arg-type]
    add_arguments(parser.add_argument_group("its lens and sensor"), VirtualDslrOptions)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    height, width = _size(arguments.size)
    if arguments.synthetic < 0 or not (arguments.folders or arguments.synthetic):
        raise ConfigError(
            f"nothing to evaluate on: found no folder and --synthetic {arguments.synthetic}; give a folder of scenes, "
            "or the number of scenes to render"
        )
    if arguments.output:
        check_absent(arguments.output, arguments.force)
    from itertools import chain

    from lfstereo.network.estimate import load_network
    from lfstereo.network.weights import DEFAULT_MODEL
    from lfstereo.simulate.stereo_scenes import find_scenes
    from lfstereo.training.comparison import compare, photographed_cases, summarise, synthetic_cases
    from lfstereo.training.evaluate import HELD_OUT_SEED

    options = from_arguments(PhotographOptions, arguments)
    dslr = from_arguments(VirtualDslrOptions, arguments)
    scenes = [scene for folder in arguments.folders for scene in find_scenes(folder, arguments.disparity_scale)]
    network = None if arguments.no_network else load_network(arguments.model or DEFAULT_MODEL, arguments.device)
    ratio = getattr(arguments, "aperture_ratio", None)
    cases = chain(
        synthetic_cases(arguments.synthetic, height, width, ratio, HELD_OUT_SEED + dslr.seed),
        photographed_cases(scenes, options, dslr),
    )
    total = arguments.synthetic + len(scenes)
    rows: list[Row] = []
    with nullcontext(silent) if arguments.json else progress_bar("evaluate") as progress:
        for done, case in enumerate(cases):
            rows += compare(case, network)
            progress(done + 1, total)
    means = summarise(rows)
    if arguments.output:
        _write_csv(arguments.output, [*rows, *means], arguments.force)
    if arguments.json:
        print(json.dumps({"scenes": [asdict(row) for row in rows], "all": [asdict(row) for row in means]}, indent=2))
    else:
        print(_table([*rows, *means], total))
    return 0


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match or min(size := (int(match[1]), int(match[2]))) < 64:
        raise ConfigError(f"--size {text}: expected HEIGHTxWIDTH in px, 64x64 or more, such as 540x960")
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
