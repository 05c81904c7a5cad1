"""``lfstereo demo``: simulate a pair of captures and turn it into depth."""

from __future__ import annotations

import argparse
import importlib
import shlex
import sys
from pathlib import Path

from lfstereo.outputs import check_absent


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("-o", "--output", type=Path, default=Path("demo"), help="folder (default: %(default)s)")
    parser.add_argument(
        "--sensor", choices=("illum", "small"), default="illum", help="illum: 7728 x 5368 px; small: a fifth of that"
    )
    parser.add_argument("--force", action="store_true", help="replace the demo of an output folder that exists")


def run(arguments: argparse.Namespace) -> int:
    """Run the command: ``simulate``, then ``run``, with the words that are printed."""
    from lfstereo.cli.main import COMMANDS, build_parser

    check_absent(arguments.output, arguments.force)
    for words in demo_commands(arguments.output, arguments.sensor, arguments.force):
        print(f"$ {shlex.join(['lfstereo', *words])}", file=sys.stderr, flush=True)
        code = int(importlib.import_module(COMMANDS[words[0]][0]).run(build_parser(words).parse_args(words)))
        if code:
            return code
    return 0


def demo_commands(output: Path, sensor: str, force: bool) -> list[list[str]]:
    """Return the words of the two commands that the demo runs."""
    capture, again = output / "capture", ["--force"] if force else []
    simulate = ["simulate", "-o", str(capture), "--sensor", sensor, *again]
    captures = [str(capture / "left.LFR"), str(capture / "right.LFR"), "--rig", str(capture / "rig.toml")]
    known = ["--whites", str(capture / "whites"), "--truth", str(capture / "truth")]
    return [simulate, ["run", *captures, *known, "-o", str(output / "result"), *again]]
