"""A focal stack: the same picture focused at a row of disparities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float32, check_shape
from lfstereo.errors import ShapeError


@dataclass(frozen=True, slots=True)
class FocalStack:
    """Slices of one camera of a rectified pair, near to far."""

    slices: Float32
    """``(K, V, U, 3)`` float32 linear RGB."""
    disparities_px: Float32
    """``(K,)`` disparity at which each slice is in focus, evenly spaced, largest (nearest) first."""
    aperture_ratio: float
    """Blur diameter in px per px of disparity from the focus: aperture over baseline, D/B."""
    source: str

    def __post_init__(self) -> None:
        check_shape(f"{self.source}: slices", self.slices, (None, None, None, 3))
        check_shape(f"{self.source}: disparities", self.disparities_px, (self.slices.shape[0],))
        if len(self.disparities_px) > 1 and not np.all(np.diff(self.disparities_px) < 0):
            raise ShapeError(f"{self.source}: focus disparities must fall from near to far")
