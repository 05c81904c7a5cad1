"""``lfstereo view``: look at a result, a light field or a capture in the browser, and refocus it live."""

from __future__ import annotations

import argparse
import contextlib
import sys
import webbrowser
from pathlib import Path

from lfstereo.progress import StageClock


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "input", type=Path, help="result folder, light field (.h5, folder of views), raw capture, or a folder of these"
    )
    parser.add_argument("--whites", type=Path, help="folder with the cameras' white images; needed for raw captures")
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1 (default: any that is free)")
    parser.add_argument(
        "--browser", action=argparse.BooleanOptionalAction, default=True, help="open the page in the browser"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.errors import ConfigError
    from lfstereo.viewer.server import PageServer
    from lfstereo.viewer.shelf import find_items

    items = find_items(arguments.input)
    if not 0 <= arguments.port <= 65535:
        raise ConfigError(f"--port {arguments.port}: expected 0 to 65535")
    try:
        server = PageServer(items, arguments.whites, arguments.port)
    except OSError as error:
        raise ConfigError(f"--port {arguments.port}: cannot be used ({error.strerror}); give another one") from error
    with server:
        with StageClock(bars=sys.stderr.isatty()).stage("open"):
            server.opened(0)
        print(f"{server.url}\nCtrl-C ends it.", flush=True)
        if arguments.browser:
            webbrowser.open(server.url)
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    return 0
