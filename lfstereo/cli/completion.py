"""``lfstereo completion``: what a shell needs to complete lfstereo's commands, options and files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SHELLS = ("bash", "zsh", "fish", "tcsh")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("shell", choices=SHELLS, help="the shell to write for; its script goes to stdout")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    import shtab

    from lfstereo.cli.main import build_parser

    parser = build_parser([], every=True)
    for action in _actions(parser):
        if action.type is Path:
            files: Any = action
            files.complete = shtab.FILE
    print(shtab.complete(parser, arguments.shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for sub in dict.fromkeys(action.choices.values()):
                yield from _actions(sub)
