"""The pages: an HTML template filled with style, script and content, so that each is one file that needs no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from lfstereo.errors import ContainerError

PageKind = Literal["result", "calibration", "batch"]
_TEMPLATE = Path(__file__).resolve().parent / "page"
_CONTENT = re.compile(r'<script type="application/json" id="content">(.*?)</script>', re.DOTALL)


@dataclass(frozen=True, slots=True)
class _Parts:
    """What a kind of page is joined from, names of files without their endings, in this order."""

    body: str
    styles: tuple[str, ...]
    scripts: tuple[str, ...]
    keys: str
    """What keys do, as HTML."""


_RESULT_SCRIPTS = (
    "base",
    "paper",
    "content",
    "controls",
    "stage",
    "scale",
    "modes_picture",
    "modes_depth",
    "space_points",
    "space_canvas",
    "space_webgl",
    "space",
    "sheets",
    "live",
    "main",
)
_MOVE = "<kbd>←</kbd><kbd>→</kbd><kbd>↑</kbd><kbd>↓</kbd>"
_PAGES: Final[dict[PageKind, _Parts]] = {
    "result": _Parts(
        "result",
        ("paper", "instrument"),
        _RESULT_SCRIPTS,
        f"<kbd>1</kbd>–<kbd>6</kbd> views {_MOVE} move <kbd>+</kbd><kbd>−</kbd> zoom <kbd>S</kbd> save",
    ),
    "calibration": _Parts(
        "calibration",
        ("paper", "instrument", "calibration"),
        ("base", "paper", "controls", "calibration_space", "calibration_frame", "calibration"),
        f"{_MOVE} turn <kbd>+</kbd><kbd>−</kbd> nearer <kbd>,</kbd><kbd>.</kbd> shot",
    ),
    "batch": _Parts("batch", ("paper", "batch"), ("base", "paper", "batch"), "<kbd>/</kbd> search"),
}


def fill_page(content: dict[str, Any], kind: PageKind = "result") -> str:
    """Return the HTML of a page.

    Nothing in it reaches out: its content security policy allows its own script and style by their hash, pictures
    from within or beside it, and, where a server gave it, requests to that server.

    Parameters
    ----------
    content
        What :mod:`lfstereo.viewer.content`, :mod:`lfstereo.viewer.calibration` or :mod:`lfstereo.batch.summary_page`
        puts together; plain values that JSON can hold.
    kind
        Which page it is for.
    """
    parts = _PAGES[kind]
    style = _joined(parts.styles, "css")
    script = f'(() => {{\n"use strict";\n{_joined(parts.scripts, "js")}\n}})();\n'
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; img-src 'self' data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'"
    )
    filled = {
        "POLICY": policy,
        "TITLE": html.escape(f"{' / '.join(content['title'])} · lfstereo"),
        "STYLE": style,
        "BODY": _joined((parts.body,), "html"),
        "KEYS": parts.keys,
        "CONTENT": json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "SCRIPT": script,
    }
    return re.sub(r"@([A-Z]+)@", lambda found: filled[found[1]], _joined(("page",), "html"))


def read_content(path: Path) -> dict[str, Any]:
    """Return the content of a result's page that :func:`fill_page` made.

    Raises
    ------
    ContainerError
        If the file cannot be read or is no such page.
    """
    try:
        found = _CONTENT.search(path.read_text("utf-8"))
        content = json.loads(found[1]) if found else None
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); run the pair again to get it") from error
    except ValueError as error:
        raise ContainerError(f"{path}: damaged ({error}); run the pair again to get a new page") from error
    if not isinstance(content, dict) or "title" not in content:
        raise ContainerError(f"{path}: found no result in this page, expected a report.html of 'lfstereo run'")
    return content


def _joined(names: tuple[str, ...], suffix: str) -> str:
    return "\n".join((_TEMPLATE / f"{name}.{suffix}").read_text("utf-8") for name in names)


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
