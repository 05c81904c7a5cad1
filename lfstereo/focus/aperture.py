"""Which views of a light field make up the aperture of a refocused picture, and how they are put together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.container.picture_size import picture_in
from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.options import option

Interpolation = Literal["linear", "cubic", "fourier"]
Reduction = Literal["mean", "median", "max", "min", "deviation"]


@dataclass(frozen=True, slots=True)
class RefocusOptions:
    """Which views take part in a refocused picture, and how they are shifted and put together."""

    aperture: Literal["disc", "all", "polygon", "picture"] = option(
        "disc", "a round aperture about the centre view, every view, a polygon, or the shape in a picture"
    )
    radius_views: float | None = option(
        None, "radius of the aperture; unset: half the shorter side of the view grid", "views"
    )
    centre_views: tuple[float, float] = option((0.0, 0.0), "aperture's middle (x, y) from the centre view", "views")
    blades: int = option(6, "corners of a polygon")
    turn_rad: float = option(0.0, "turn of a polygon, x towards y; 0: a corner to the right", "rad")
    aperture_picture: Path | None = option(
        None, "picture laid over the view grid: white lets all light through, black none"
    )
    interpolation: Interpolation = option(
        "linear", "how views are shifted by parts of a px: 2 or 4 neighbours, or exactly by their spectrum"
    )
    reduction: Reduction = option(
        "mean", "what is shown of the views' values at a px; deviation: how far they differ, least where in focus"
    )
    least_weight: float = option(0.0, "samples of less weight (0 to 1) do not count")
    tilt: tuple[float, float] = option(
        (0.0, 0.0),
        "slope gained from the left to the right border, and from the top to the bottom: a tilted plane of focus",
        "px per view",
    )


def aperture_weights(light_field: LightField, options: RefocusOptions = RefocusOptions()) -> Float32:
    """Return how much each view counts, ``(T, S)`` from 0 to 1; the rim of a disc or polygon is one view wide.

    Raises
    ------
    ConfigError
        If the aperture has no area, lies beside all views, or its picture cannot be read.

    Examples
    --------
    >>> field = LightField(np.zeros((5, 5, 1, 1, 3), np.float32), None, None, "", "example")
    >>> [round(float(weight), 2) for weight in aperture_weights(field)[0]]
    [0.17, 0.76, 1.0, 0.76, 0.17]
    """
    count_t, count_s = light_field.views.shape[:2]
    if options.aperture == "all":
        return np.ones((count_t, count_s), np.float32)
    if options.aperture == "picture":
        weights = _from_picture(options.aperture_picture, (count_t, count_s))
    else:
        t0, s0 = light_field.centre
        x: Float64 = np.arange(count_s, dtype=np.float64)[None, :] - s0 - options.centre_views[0]
        y: Float64 = np.arange(count_t, dtype=np.float64)[:, None] - t0 - options.centre_views[1]
        radius = _radius_views(light_field, options)
        beyond = np.hypot(x, y) - radius if options.aperture == "disc" else _beyond_polygon(x, y, radius, options)
        weights = np.clip(0.5 - beyond, 0.0, 1.0).astype(np.float32)
    if not weights.any():
        raise ConfigError(
            f"aperture '{options.aperture}' holds none of the {count_t} x {count_s} views; make it larger or move it "
            "to the middle"
        )
    return weights


def blur_ratio(
    light_field: LightField, slope_per_disparity: float, options: RefocusOptions = RefocusOptions()
) -> float:
    """Return the blur diameter in px per px of disparity from the focus, the ratio D/B of aperture to baseline.

    Each view stands for a strip of the pupil one view step wide, so N views in a row are N steps of aperture. The
    aperture of a picture counts as the disc of its area.

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
        If the aperture has no area.

    Examples
    --------
    Fifteen views that share 1/100 of the baseline each make an aperture of 0.15 baselines.

    >>> field = LightField(np.zeros((15, 15, 1, 1, 3), np.float32), None, None, "", "example")
    >>> round(blur_ratio(field, 0.01), 6)
    0.15
    """
    if options.aperture == "picture":
        radius = float(np.sqrt(aperture_weights(light_field, options).sum() / np.pi))
    else:
        radius = _radius_views(light_field, options)
    return 2.0 * radius * abs(slope_per_disparity)


def _radius_views(light_field: LightField, options: RefocusOptions) -> float:
    radius = options.radius_views
    if radius is not None and options.aperture != "all":
        if not (np.isfinite(radius) and radius > 0):
            raise ConfigError(f"radius_views = {radius}: expected a radius above 0 views, or none for the largest")
        return float(radius)
    sides = [n for n in light_field.views.shape[:2] if n > 1]
    return min(sides, default=1) / 2.0


def _beyond_polygon(x: Float64, y: Float64, radius: float, options: RefocusOptions) -> Float64:
    """Return how far ``(T, S)`` views lie outside a regular polygon whose corners are ``radius`` from its middle."""
    if options.blades < 3:
        raise ConfigError(f"blades = {options.blades}: expected 3 or more corners of a polygon")
    normals = options.turn_rad + (np.arange(options.blades) + 0.5) * 2 * np.pi / options.blades
    reach = (np.cos(a) * x + np.sin(a) * y for a in normals)
    farthest: Float64 = np.maximum.reduce([np.broadcast_to(r, np.broadcast_shapes(x.shape, y.shape)) for r in reach])
    beyond: Float64 = farthest - radius * np.cos(np.pi / options.blades)
    return beyond


def _from_picture(path: Path | None, count: tuple[int, int]) -> Float32:
    if path is None:
        raise ConfigError("aperture 'picture': found no picture, expected its file; give --aperture-picture")
    picture = picture_in(path, cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise ConfigError(f"{path}: cannot be read as a picture of the aperture; give a PNG or JPEG file")
    small: Float32 = cv2.resize(picture.astype(np.float32) / 255, count[::-1], interpolation=cv2.INTER_AREA)
    return small
