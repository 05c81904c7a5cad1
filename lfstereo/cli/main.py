"""The one program ``lfstereo``: finds the command, runs it, turns errors into exit codes."""

from __future__ import annotations

import argparse
import importlib
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

from lfstereo import __version__
from lfstereo.errors import LfstereoError, QualityWarning

COMMANDS: dict[str, tuple[str, str]] = {
    "info": (
        "lfstereo.cli.info",
        "print what a capture holds: camera, lens, lenslet array, levels, sections",
    ),
    "simulate": ("lfstereo.cli.simulate", "make a dual-Illum capture of a scene with known depth"),
    "target": ("lfstereo.cli.target", "draw a calibration board to print, and its TOML file"),
    "calibrate": ("lfstereo.cli.calibrate", "photographs of a calibration board by both cameras to a rig"),
    "rig": ("lfstereo.cli.rig", "a rig to and from the files of OpenCV, Kalibr and others"),
    "rectify": ("lfstereo.cli.rectify", "one light field rectified by the calibration of the Light Field Toolbox"),
    "decode": ("lfstereo.cli.decode", "raw capture to 4-D light field"),
    "whites": ("lfstereo.cli.whites", "the white images: import them, list them, check their grids"),
    "view-grid": ("lfstereo.cli.view_grid", "picture of a lenslet grid over its frame, and of what it leaves"),
    "export": ("lfstereo.cli.export", "light field or raw capture to the format of another program"),
    "refocus": ("lfstereo.cli.refocus", "focal stack, or a picture focused at will, of one light field or of a pair"),
    "filter": ("lfstereo.cli.filter", "light field with only what lies at one depth, or in a range of depths"),
    "picture": ("lfstereo.cli.picture", "a perspective, an epipolar-plane image or a quilt of a light field"),
    "animate": ("lfstereo.cli.animate", "focal sweep or parallax orbit of a light field as GIF or MP4"),
    "run": ("lfstereo.cli.run", "two captures to disparity, depth, all-in-focus image and point cloud"),
    "depth": ("lfstereo.cli.depth", "focus sweeps of ordinary cameras, one or two, to depth"),
    "batch": ("lfstereo.cli.batch", "every stereo pair under a folder to depth, on many cores or a cluster"),
    "view": ("lfstereo.cli.view", "look at results and light fields in the browser, refocus them live"),
    "synthesize": (
        "lfstereo.cli.synthesize",
        "a dual focal stack data set from stereo pictures of known disparity",
    ),
    "train": ("lfstereo.cli.train", "train a network from a recipe"),
    "evaluate": (
        "lfstereo.cli.evaluate",
        "errors of every network and of classical methods on scenes of known disparity",
    ),
    "demo": ("lfstereo.cli.demo", "simulate a pair of captures and turn it into depth"),
    "doctor": ("lfstereo.cli.doctor", "check this installation and say what to do"),
    "completion": ("lfstereo.cli.completion", "script that completes lfstereo's words in bash, zsh, fish or tcsh"),
}
"""Command name -> module with ``configure(parser)`` and ``run(arguments) -> int``, and its help line."""


def build_parser(argv: Sequence[str], every: bool = False) -> argparse.ArgumentParser:
    """Build the parser; only the module of the command named in ``argv`` is imported, or with ``every`` all are."""
    parser = argparse.ArgumentParser(prog="lfstereo", description="Depth from pairs of Lytro light-field captures.")
    parser.add_argument("--version", action="version", version=f"lfstereo {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    wanted = next((word for word in argv if not word.startswith("-")), None)
    for name, (module, text) in COMMANDS.items():
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        if every or name == wanted:
            importlib.import_module(module).configure(sub)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code.

    0 done, 1 bug, 2 usage, 3 bad input, 4 result not trustworthy, 5 part of a batch failed, 130 interrupted.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    arguments = build_parser(words).parse_args(words)
    try:
        with _told_warnings(arguments.command):
            return int(importlib.import_module(COMMANDS[arguments.command][0]).run(arguments))
    except LfstereoError as error:
        print(f"lfstereo {arguments.command}: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"lfstereo {arguments.command}: interrupted; nothing partial was left", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except Exception:
        traceback.print_exc()
        print(
            f"lfstereo {arguments.command}: this is a bug; please report it with the lines above",
            file=sys.stderr,
        )
        return 1


@contextmanager
def _told_warnings(command: str) -> Iterator[None]:
    """Print the project's own warnings as one line each on stderr; all others go where they always go."""

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, QualityWarning):
            print(f"lfstereo {command}: warning: {message}", file=sys.stderr)
        else:
            others(message, category, filename, lineno, file, line)

    with warnings.catch_warnings():
        others = warnings.showwarning
        warnings.simplefilter("always", QualityWarning)
        warnings.showwarning = show
        yield


if __name__ == "__main__":
    raise SystemExit(main())
