"""Serve pages on this computer alone and refocus for them.

The server listens on 127.0.0.1, answers only requests that name it as their host (so that no other web page can reach
it by a name of its own) and whose path begins with a random token, and gives out only files of a result folder whose
names it knows.
"""

from __future__ import annotations

import math
import secrets
import sys
import threading
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, quote, unquote, urlsplit

import cv2
import numpy as np

from lfstereo.errors import InputError, LfstereoError
from lfstereo.lightfield.encoding import srgb16
from lfstereo.viewer.content import KNOWN_FILES
from lfstereo.viewer.embedding import jpeg_bytes
from lfstereo.viewer.live import LiveField, LiveFocus, picture_of, render
from lfstereo.viewer.opened import OpenItem, open_item
from lfstereo.viewer.shelf import Item
from lfstereo.viewer.template import fill_page

ADDRESS = "127.0.0.1"
_LIVE_QUALITY = 90
_LARGEST_TILT = 0.4
_TYPES = {".png": "image/png", ".toml": "text/plain; charset=utf-8"}


@dataclass(frozen=True, slots=True)
class Answer:
    """A body and what it is."""

    body: bytes
    kind: str
    file_name: str = ""
    """Name to save it under; empty: to be shown."""


class NotHereError(Exception):
    """What was asked for is not served."""


class PageServer(ThreadingHTTPServer):
    """Serves the pages of some items until it is shut down."""

    daemon_threads = True

    def __init__(self, items: tuple[Item, ...], whites: Path | None = None, port: int = 0) -> None:
        super().__init__((ADDRESS, port), _Handler)
        self.items = items
        self.whites = whites
        self.token = secrets.token_urlsafe(24)
        self._busy = threading.Lock()
        self._open: tuple[int, OpenItem] | None = None

    @property
    def url(self) -> str:
        """Address to open in a browser."""
        return f"http://{ADDRESS}:{self.server_port}/{self.token}/"

    def hosts(self) -> tuple[str, str]:
        """Return the names by which a browser may call this server."""
        return f"{ADDRESS}:{self.server_port}", f"localhost:{self.server_port}"

    def answer(self, route: list[str], query: dict[str, str]) -> Answer:
        """Return what belongs to a path below the token.

        Raises
        ------
        NotHereError
            If nothing does.
        LfstereoError
            If an item cannot be opened, or the query asks for what cannot be.
        """
        if route == [""]:
            return self._page(self._index(query.get("item", "0")))
        if len(route) < 3 or route[0] != "item":
            raise NotHereError
        index, what = self._index(route[1]), route[2:]
        with self._busy:
            opened = self.opened(index)
            if what[0] == "file" and len(what) == 2:
                return _file(opened, what[1])
            if opened.live is None or len(what) != 1:
                raise NotHereError
            if what[0] in ("refocus", "export"):
                return _refocused(opened.live, _focus(query), what[0] == "export")
        raise NotHereError

    def opened(self, index: int) -> OpenItem:
        """Return an item, opened if it was not the last one; only one is kept in memory."""
        if self._open is None or self._open[0] != index:
            self._open = None
            self._open = index, open_item(self.items[index], self.whites)
        return self._open[1]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that hung up, as it does when a page is left."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)

    def _index(self, text: str) -> int:
        if not (text.isascii() and text.isdigit() and int(text) < len(self.items)):
            raise NotHereError
        return int(text)

    def _page(self, index: int) -> Answer:
        with self._busy:
            opened = self.opened(index)
        root = f"/{self.token}/"
        base = f"{root}item/{index}/"
        files = [
            file | {"href": f"{base}file/{quote(file['name'])}" if file["name"] in KNOWN_FILES else None}
            for file in opened.content["files"]
        ]
        live = None
        if opened.live is not None or len(self.items) > 1:
            live = self._offer(opened, index) | {"root": root, "base": base}
        content = opened.content | {"files": files, "live": live}
        return Answer(fill_page(content).encode(), "text/html; charset=utf-8")

    def _offer(self, opened: OpenItem, index: int) -> dict[str, Any]:
        return {
            "items": [item.name for item in self.items],
            "item": index,
            "refocus": opened.live is not None,
            "views": len(opened.live.places) if opened.live else 0,
            "radius_views": opened.live.radius_views if opened.live else 0.0,
            "largest_tilt": _LARGEST_TILT,
            "slope_from_axis": list(opened.slope_from_axis),
        }


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version = "lfstereo", ""
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        if self.headers.get("Host", "") not in self.server.hosts():
            self._refuse(HTTPStatus.FORBIDDEN, "this server answers to its own address alone")
            return
        parts = urlsplit(self.path)
        token, *route = parts.path.removeprefix("/").split("/")
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.NOT_FOUND, "not here")
            return
        query = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        try:
            answer = self.server.answer([unquote(part) for part in route], query)
        except NotHereError:
            self._refuse(HTTPStatus.NOT_FOUND, "not here")
        except LfstereoError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        else:
            self._send(HTTPStatus.OK, answer)

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self._send(status, Answer(f"{text}\n".encode(), "text/plain; charset=utf-8"))

    def _send(self, status: HTTPStatus, answer: Answer) -> None:
        self.send_response(status)
        self.send_header("Content-Type", answer.kind)
        self.send_header("Content-Length", str(len(answer.body)))
        if answer.file_name:
            self.send_header("Content-Disposition", f'attachment; filename="{answer.file_name}"')
        for name, value in (
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "DENY"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(answer.body)

    def log_message(self, format: str, *args: Any) -> None:
        """Keep the terminal quiet."""


def _file(opened: OpenItem, name: str) -> Answer:
    if opened.folder is None or name not in KNOWN_FILES:
        raise NotHereError
    path = (opened.folder / name).resolve()
    if not (path.is_file() and path.parent == opened.folder.resolve()):
        raise NotHereError
    kind = _TYPES.get(path.suffix, "application/octet-stream")
    return Answer(path.read_bytes(), kind, "" if path.suffix in _TYPES else name)


def _refocused(live: LiveField, focus: LiveFocus, to_keep: bool) -> Answer:
    linear = render(live, focus)
    if not to_keep:
        return Answer(jpeg_bytes(picture_of(live, linear), _LIVE_QUALITY), "image/jpeg")
    codes = srgb16(linear * np.float32(live.gain))
    _, coded = cv2.imencode(".png", np.ascontiguousarray(codes[..., ::-1]))
    return Answer(coded.tobytes(), "image/png", f"refocused_slope_{focus.slope:+.4f}.png")


def _focus(query: dict[str, str]) -> LiveFocus:
    slope, radius, tilt_x, tilt_y = (_number(query, name) for name in ("slope", "radius", "tilt_x", "tilt_y"))
    return LiveFocus(slope, radius, (tilt_x, tilt_y))


def _number(query: dict[str, str], name: str) -> float:
    try:
        value = float(query.get(name, ""))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{name}: found '{query.get(name, '')}', expected a number")
    return value
