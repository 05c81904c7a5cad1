"""Stage 4: raw capture to light field, and light fields on disk."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lfstereo.lightfield.decoding import decode
    from lfstereo.lightfield.field import LightField, ViewSampling
    from lfstereo.lightfield.options import DecodeOptions
    from lfstereo.lightfield.store import read_light_field, write_light_field

__all__ = ["DecodeOptions", "LightField", "ViewSampling", "decode", "read_light_field", "write_light_field"]

_HOME = {
    "DecodeOptions": "options",
    "decode": "decoding",
    "LightField": "field",
    "ViewSampling": "field",
    "read_light_field": "store",
    "write_light_field": "store",
}


def __getattr__(name: str) -> Any:
    """Import a published name when it is first asked for, so that the package itself imports nothing heavy."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
