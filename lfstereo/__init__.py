"""Depth from the captures of two side-by-side Lytro light-field cameras.

The names below are loaded when first used, so ``import lfstereo`` costs nothing.

Examples
--------
>>> import lfstereo
>>> "decode" in dir(lfstereo)
True
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from lfstereo.container import read_capture, write_capture
    from lfstereo.depth.triangulate import triangulate
    from lfstereo.errors import LfstereoError
    from lfstereo.focus.refocus import refocus, render_stack
    from lfstereo.lenslet.white import find_white_image
    from lfstereo.lightfield.decoding import decode
    from lfstereo.lightfield.store import read_light_field, write_light_field
    from lfstereo.network.estimate import estimate_disparity, load_network
    from lfstereo.pipeline import run_pair
    from lfstereo.rig.geometry import rectified_geometry
    from lfstereo.rig.rectify import rectify
    from lfstereo.rig.rig import read_rig

_PUBLIC = {
    "LfstereoError": "errors",
    "decode": "lightfield.decoding",
    "estimate_disparity": "network.estimate",
    "find_white_image": "lenslet.white",
    "load_network": "network.estimate",
    "read_capture": "container",
    "read_light_field": "lightfield.store",
    "read_rig": "rig.rig",
    "rectified_geometry": "rig.geometry",
    "rectify": "rig.rectify",
    "refocus": "focus.refocus",
    "render_stack": "focus.refocus",
    "run_pair": "pipeline",
    "triangulate": "depth.triangulate",
    "write_capture": "container",
    "write_light_field": "lightfield.store",
}

__all__ = [
    "LfstereoError",
    "decode",
    "estimate_disparity",
    "find_white_image",
    "load_network",
    "read_capture",
    "read_light_field",
    "read_rig",
    "rectified_geometry",
    "rectify",
    "refocus",
    "render_stack",
    "run_pair",
    "triangulate",
    "write_capture",
    "write_light_field",
]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(f"lfstereo.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'lfstereo' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_PUBLIC))
