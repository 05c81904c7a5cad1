"""A raw frame with its metadata: what every decode starts from."""

from __future__ import annotations

from dataclasses import dataclass

from lfstereo.arrays import Mosaic
from lfstereo.container.metadata import FrameMetadata


@dataclass(frozen=True, slots=True)
class Capture:
    """One exposure of a light-field camera."""

    mosaic: Mosaic
    """``(height, width)`` uint16 Bayer mosaic in digital numbers."""
    metadata: FrameMetadata
    source: str
    """File it came from, for messages."""
