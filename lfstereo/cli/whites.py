"""``lfstereo whites``: import the cameras' white images, list them, check their grids."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfstereo.lenslet.options import GridOptions
from lfstereo.options import add_arguments, from_arguments
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.lenslet.grid import LensletGrid
    from lfstereo.lenslet.library import WhiteImage


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.lenslet.home import library_folder

    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    add = actions.add_parser("import", help="copy white images to the library that is used without --whites")
    add.add_argument("sources", type=Path, nargs="+", help="folder, .tar archive, or backup volumes (data.C.0, ...)")
    add.add_argument("--library", type=Path, default=library_folder(), help="folder to copy to (default: %(default)s)")
    for name, text in (
        ("list", "print camera, zoom and focus step of every white image"),
        ("check", "fit the grid of every white image, keep it for later decodes, and print how good it is"),
    ):
        action = actions.add_parser(name, help=text)
        action.add_argument(
            "place", type=Path, nargs="?", default=library_folder(), help="folder or archive (default: %(default)s)"
        )
        action.add_argument("--json", action="store_true", help="print JSON on stdout")
        if name == "check":
            add_arguments(action, GridOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    actions: dict[str, Callable[[argparse.Namespace], int]] = {"import": _import, "list": _list, "check": _check}
    return actions[arguments.action](arguments)


def _import(arguments: argparse.Namespace) -> int:
    from lfstereo.lenslet.imported import import_whites

    clock = StageClock(bars=sys.stderr.isatty())
    for source in arguments.sources:
        with clock.stage(f"import {source.name}") as progress:
            done = import_whites(source, arguments.library, progress)
        serials = sorted({white.serial for white in done.whites})
        print(
            f"{source}: {len(done.whites)} white images of {', '.join(serials)}, {done.copied} files copied to "
            f"{arguments.library}, {done.kept} were there already"
        )
    return 0


def _list(arguments: argparse.Namespace) -> int:
    from lfstereo.lenslet.library import open_library

    library = open_library(arguments.place)
    rows = [_row(white) for white in sorted(library.whites, key=_order)]
    if arguments.json:
        print(json.dumps({"whites": rows, "problems": library.problems}, indent=2))
        return 0
    print(f"{'serial':<14}{'zoom':>7}{'focus':>7}  {'size':<12}file")
    for row in rows:
        print(f"{row['serial']:<14}{row['zoom_step']:>7}{row['focus_step']:>7}  {row['size']:<12}{row['file']}")
    for problem in library.problems:
        print(problem, file=sys.stderr)
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from lfstereo.errors import GridFitError
    from lfstereo.lenslet.library import open_library
    from lfstereo.lenslet.remembered_grid import remembered_grid

    options = from_arguments(GridOptions, arguments)
    library = open_library(arguments.place)
    clock = StageClock(bars=sys.stderr.isatty())
    rows, failures = [], list(library.problems)
    if not arguments.json:
        print(
            f"{'serial':<14}{'zoom':>7}{'focus':>7}{'pitch px':>11}{'turned mrad':>13}{'residual px':>13}"
            f"{'error px':>10}{'agree':>8}{'factory px':>12}  file"
        )
    for white in sorted(library.whites, key=_order):
        try:
            with clock.stage(Path(white.raw.name).name) as progress:
                grid = remembered_grid(white.read(), options, progress)
        except GridFitError as error:
            failures.append(str(error))
            continue
        rows.append(_row(white) | _figures(white, grid))
        if not arguments.json:
            print(_line(rows[-1]))
    if arguments.json:
        print(json.dumps({"whites": rows, "problems": failures}, indent=2))
    for failure in failures:
        print(failure, file=sys.stderr)
    return GridFitError.exit_code if failures else 0


def _order(white: WhiteImage) -> tuple[str, int, int, str]:
    return white.serial, white.zoom_step, white.focus_step, white.raw.where


def _row(white: WhiteImage) -> dict[str, Any]:
    return {
        "serial": white.serial or "none",
        "zoom_step": white.zoom_step,
        "focus_step": white.focus_step,
        "size": f"{white.width} x {white.height}",
        "file": white.raw.where,
    }


def _figures(white: WhiteImage, grid: LensletGrid) -> dict[str, Any]:
    from lfstereo.lenslet.factory import factory_offset

    (x, y) = grid.step_u_px
    return {
        "pitch_px": (x * x + y * y) ** 0.5,
        "rotation_rad": y / x,
        "residual_px": grid.residual_px,
        "uncertainty_px": grid.uncertainty_px,
        "quality": grid.quality,
        "factory_offset_px": factory_offset(grid, white),
    }


def _line(row: dict[str, Any]) -> str:
    factory = row["factory_offset_px"]
    return (
        f"{row['serial']:<14}{row['zoom_step']:>7}{row['focus_step']:>7}{row['pitch_px']:>11.5f}"
        f"{1e3 * row['rotation_rad']:>13.4f}{row['residual_px']:>13.4f}{row['uncertainty_px']:>10.4f}"
        f"{row['quality']:>8.1%}{'' if factory is None else format(factory, '.3f'):>12}  {row['file']}"
    )
