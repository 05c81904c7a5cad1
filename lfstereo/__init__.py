"""Depth from the captures of two side-by-side Lytro light-field cameras."""

from __future__ import annotations

__version__ = "0.1.0"
