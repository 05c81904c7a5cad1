"""A focus sweep as a focal stack of evenly spaced disparities, as the networks expect it."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.conventions import SLICES_DEFAULT
from lfstereo.errors import ConfigError
from lfstereo.focus.stack import FocalStack

_SLACK = 1.05


def even_stack(
    slices: Float32, disparities_px: Float64, aperture_ratio: float, source: str, count: int = SLICES_DEFAULT
) -> FocalStack:
    """Interpolate slices at even steps of disparity between the first and the last one.

    A picture between two slices is their weighted mean. That is not what a lens would show, but close to it where the
    slices lie no farther apart than the new ones; sweeps with wider gaps are refused.

    Parameters
    ----------
    slices
        ``(K, V, U, 3)`` linear RGB.
    disparities_px
        ``(K,)`` disparity in focus, falling.
    aperture_ratio
        Aperture over baseline; 0 where not known.
    source
        Name of the sweep, for messages.
    count
        Slices to make.

    Raises
    ------
    ConfigError
        If a gap between two slices is wider than the even step.

    Examples
    --------
    >>> slices = np.zeros((4, 1, 1, 3), np.float32) + np.float32([6, 5, 2, 0])[:, None, None, None]
    >>> even_stack(slices, np.array([6.0, 5.0, 2.0, 0.0]), 0.1, "example", 3).slices[:, 0, 0, 0].tolist()
    [6.0, 3.0, 0.0]
    """
    near, far = float(disparities_px[0]), float(disparities_px[-1])
    targets = np.linspace(near, far, count)
    step, widest = (near - far) / (count - 1), float(-np.diff(disparities_px).min())
    if widest > _SLACK * step:
        raise ConfigError(
            f"{source}: found slices up to {widest:.2f} px of disparity apart, expected at most {step:.2f} px: {count} "
            f"even steps from {near:.1f} to {far:.1f} px; photograph more focus distances, even in 1/m, or take "
            "--method stereo"
        )
    place = np.interp(-targets, -disparities_px, np.arange(len(slices)))
    lower = np.minimum(place.astype(np.intp), len(slices) - 2)
    share = (place - lower).astype(np.float32)[:, None, None, None]
    even = (1 - share) * slices[lower] + share * slices[lower + 1]
    return FocalStack(even.astype(np.float32, copy=False), targets.astype(np.float32), aperture_ratio, source)
