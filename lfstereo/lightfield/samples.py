"""A few views of a light field as pictures, for looking about the pupil."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float32, UInt8, check_shape
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField

_MOST_ACROSS = 8


@dataclass(frozen=True, slots=True)
class ViewSamples:
    """Every n-th view inside the round pupil."""

    pictures: UInt8
    """``(N, V, U, 3)`` sRGB."""
    places: tuple[tuple[int, int], ...]
    """N times (s, t), views to the right of and below the centre view."""
    step: int
    """Views from one sample to the next."""
    views_in_all: int
    """Views of the whole light field."""

    def __post_init__(self) -> None:
        check_shape("view samples", self.pictures, (len(self.places), None, None, 3))


def sample_views(light_field: LightField, gain: float = 1.0) -> ViewSamples:
    """Return every n-th view about the centre, those in the corners left out.

    Parameters
    ----------
    light_field
        Where the views come from.
    gain
        Factor on the linear light.

    Examples
    --------
    >>> field = LightField(np.zeros((15, 15, 2, 2, 3), np.float32), None, None, "", "example")
    >>> samples = sample_views(field)
    >>> len(samples.places), samples.step
    (45, 2)
    """
    count_t, count_s = light_field.views.shape[:2]
    t0, s0 = light_field.centre
    step = math.ceil(max(count_t, count_s) / _MOST_ACROSS)
    reach = min((n for n in (count_t, count_s) if n > 1), default=1) / 2
    places = [
        (s - s0, t - t0)
        for t in range(t0 % step, count_t, step)
        for s in range(s0 % step, count_s, step)
        if math.hypot(s - s0, t - t0) <= reach
    ]
    pictures = np.stack([_picture(light_field.views[t0 + t, s0 + s], gain) for s, t in places])
    return ViewSamples(pictures, tuple(places), step, count_t * count_s)


def _picture(view: Float32, gain: float) -> UInt8:
    return srgb8(view if gain == 1.0 else view * np.float32(gain))
