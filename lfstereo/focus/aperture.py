"""Which views of a light field make up the aperture of a refocused picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lfstereo.arrays import Float32
from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.options import option


@dataclass(frozen=True, slots=True)
class RefocusOptions:
    """Which views take part in a refocused picture."""

    aperture: Literal["disc", "all"] = option("disc", "a round aperture about the centre view, or every view")
    radius_views: float | None = option(
        None, "radius of the round aperture; unset: half the shorter side of the view grid", "views"
    )


def aperture_weights(light_field: LightField, options: RefocusOptions = RefocusOptions()) -> Float32:
    """Return how much each view counts, ``(T, S)`` from 0 to 1; the rim of the disc is one view wide.

    Raises
    ------
    ConfigError
        If the radius of the aperture is not positive.

    Examples
    --------
    >>> field = LightField(np.zeros((5, 5, 1, 1, 3), np.float32), None, None, "", "example")
    >>> print(aperture_weights(field)[0].round(2))
    [0.17 0.76 1.   0.76 0.17]
    """
    count_t, count_s = light_field.views.shape[:2]
    if options.aperture == "all":
        return np.ones((count_t, count_s), np.float32)
    t0, s0 = light_field.centre
    away = np.hypot(np.arange(count_t)[:, None] - t0, np.arange(count_s)[None, :] - s0)
    return np.clip(_radius_views(light_field, options) + 0.5 - away, 0.0, 1.0).astype(np.float32)


def blur_ratio(
    light_field: LightField, slope_per_disparity: float, options: RefocusOptions = RefocusOptions()
) -> float:
    """Return the blur diameter in px per px of disparity from the focus, the ratio D/B of aperture to baseline.

    Each view stands for a strip of the pupil one view step wide, so N views in a row are N steps of aperture.

    Parameters
    ----------
    light_field
        Tells how many views there are.
    slope_per_disparity
        Slope (px per view) per px of disparity of the rectified pair.
    options
        Which views take part.

    Raises
    ------
    ConfigError
        If the radius of the aperture is not positive.

    Examples
    --------
    Fifteen views that share 1/100 of the baseline each make an aperture of 0.15 baselines.

    >>> field = LightField(np.zeros((15, 15, 1, 1, 3), np.float32), None, None, "", "example")
    >>> round(blur_ratio(field, 0.01), 6)
    0.15
    """
    return 2.0 * _radius_views(light_field, options) * abs(slope_per_disparity)


def _radius_views(light_field: LightField, options: RefocusOptions) -> float:
    radius = options.radius_views
    if radius is not None and options.aperture == "disc":
        if not (np.isfinite(radius) and radius > 0):
            raise ConfigError(f"radius_views = {radius}: expected a radius above 0 views, or none for the largest")
        return float(radius)
    sides = [n for n in light_field.views.shape[:2] if n > 1]
    return min(sides, default=1) / 2.0
