"""The page: fills the HTML template with style, script and content, so that it is one file that needs no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from pathlib import Path
from typing import Any

from lfstereo.errors import ContainerError

_TEMPLATE = Path(__file__).resolve().parent / "page"
_SCRIPTS = (
    "base",
    "content",
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
"""JavaScript files in the order in which they are joined."""
_CONTENT = re.compile(r'<script type="application/json" id="content">(.*?)</script>', re.DOTALL)


def fill_page(content: dict[str, Any]) -> str:
    """Return the HTML of a page.

    Nothing in it reaches out: its content security policy allows its own script and style by their hash, pictures
    from within, and, where a server gave it, requests to that server.

    Parameters
    ----------
    content
        What :mod:`lfstereo.viewer.content` puts together; plain values that JSON can hold.
    """
    style = (_TEMPLATE / "style.css").read_text("utf-8")
    parts = "\n".join((_TEMPLATE / f"{name}.js").read_text("utf-8") for name in _SCRIPTS)
    script = f'(() => {{\n"use strict";\n{parts}\n}})();\n'
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'"
    )
    filled = {
        "POLICY": policy,
        "TITLE": html.escape(f"{' / '.join(content['title'])} · lfstereo"),
        "STYLE": style,
        "CONTENT": json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "SCRIPT": script,
    }
    template = (_TEMPLATE / "page.html").read_text("utf-8")
    return re.sub(r"@([A-Z]+)@", lambda found: filled[found[1]], template)


def read_content(path: Path) -> dict[str, Any]:
    """Return the content of a page that :func:`fill_page` made.

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


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
