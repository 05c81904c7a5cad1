"""Slope, disparity and depth of one rectified camera: three names of the same plane of focus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.errors import ConfigError
from lfstereo.rig.geometry import RectifiedGeometry

FocusUnit = Literal["slope", "disparity", "metres"]


@dataclass(frozen=True, slots=True)
class FocusScale:
    """How slopes of a rectified light field go with disparities of the pair and with depth."""

    slope_per_disparity: float
    """px per view, per px of disparity."""
    slope_at_zero: float
    """px per view, at disparity 0."""
    focal_px: float
    baseline_m: float
    doffs_px: float

    def slopes(self, values: Sequence[float] | Float64, unit: FocusUnit) -> Float64:
        """Return slopes of values in a unit.

        Raises
        ------
        ConfigError
            If a depth is not in front of the cameras.

        Examples
        --------
        >>> scale = FocusScale(0.01, -0.3, 1000.0, 0.1, 90.0)
        >>> [scale.slopes([value], unit)[0].round(6).item() for value, unit in ((1.0, "metres"), (10.0, "disparity"))]
        [-0.2, -0.2]
        """
        given = np.asarray(values, np.float64)
        if unit == "slope":
            return given
        if unit == "metres":
            if not np.all(given > 0):
                raise ConfigError(f"depth {given.min()} m: expected metres in front of the cameras, above 0")
            given = self.focal_px * self.baseline_m / given - self.doffs_px
        return self.slope_per_disparity * given + self.slope_at_zero

    def disparities(self, slopes: Float64) -> Float64:
        """Return disparities, px of the rectified left centre view."""
        found: Float64 = (slopes - self.slope_at_zero) / self.slope_per_disparity
        return found

    def depths(self, slopes: Float64) -> Float64:
        """Return depths z in metres; beyond infinity, infinite."""
        sum_px = self.disparities(slopes) + self.doffs_px
        return np.where(sum_px > 0, self.focal_px * self.baseline_m / np.where(sum_px > 0, sum_px, 1.0), np.inf)


def focus_scale(geometry: RectifiedGeometry, view_baseline_m: float) -> FocusScale:
    """Return the scale of light fields rectified to a geometry, whose views are ``view_baseline_m`` apart."""
    per_px, at_zero = geometry.slope_from_disparity(view_baseline_m)
    return FocusScale(per_px, at_zero, geometry.focal_px, geometry.baseline_m, geometry.doffs_px)
