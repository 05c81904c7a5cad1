"""Interpolation weights from a hexagonal lattice of lenslets to square columns on the same rows."""

from __future__ import annotations

import functools

import numpy as np
from scipy.special import j1

from lfstereo.arrays import Float32, Float64

PHASES = 64
"""Positions between two lenslets of a row that have weights of their own."""
REACH_OWN, REACH_NEXT = 2, 2
"""Lenslets used to either side, in the row of the point and in the rows above and below it."""
PITCH = 2 / np.sqrt(3)
"""Distance of two lenslets of a row; the unit of length here is the distance of two rows."""
_DETAIL_POWER = 1.2
_NOISE = 1e-4


@functools.cache
def hexagon_weights() -> Float32:
    """Return the weights of the thirteen lenslets around a point on a row of lenslets.

    They are the best linear unbiased estimate (universal kriging) for pictures whose amplitude spectrum falls as
    ``1 / f^1.2``, seen through the round aperture of the lenslets; surfaces up to second order come out exactly.

    Returns
    -------
    ``(PHASES + 1, 13)`` float32 weights, each row of sum 1, for a point ``phase / PHASES - 1/2`` of a pitch to the
    right of the nearest lenslet of its row. In order: the five lenslets of the row from -2 to 2 pitches, the four
    of the row above from -1.5 to 1.5, the four of the row below.

    References
    ----------
    Matheron, "Principles of geostatistics" (Economic Geology 1963), the kriging equations.
    Field, "Relations between the statistics of natural images and the response properties of cortical cells"
    (JOSA A 1987), spectra of natural images.

    Examples
    --------
    >>> at_lenslet = hexagon_weights()[PHASES // 2]
    >>> int(at_lenslet.argmax()), bool(at_lenslet[2] > 0.998)
    (2, True)
    """
    own = [(float(k), 0.0) for k in range(-REACH_OWN, REACH_OWN + 1)]
    beside = [(k + 0.5, row) for row in (-1.0, 1.0) for k in range(-REACH_NEXT, REACH_NEXT)]
    places = np.array(own + beside) * (PITCH, 1.0)
    along = (np.arange(PHASES + 1) / PHASES - 0.5) * PITCH
    return kriging_weights(places, np.stack([along, np.zeros_like(along)], axis=1))


def kriging_weights(places: Float64, targets: Float64) -> Float32:
    """Return ``(T, P)`` weights of lenslets at ``places`` for points at ``targets``, (x, y) in distances of rows."""
    covariance = lenslet_covariance()
    count = len(places)
    drift = _drift(places)
    between = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    system = np.zeros((count + drift.shape[1],) * 2)
    system[:count, :count] = np.interp(between, *covariance) + _NOISE * np.eye(count)
    system[:count, count:] = drift
    system[count:, :count] = drift.T
    towards = np.hypot(*(places[:, None] - targets[None]).transpose(2, 0, 1))
    right = np.concatenate([np.interp(towards, *covariance), _drift(targets).T])
    return np.asarray(np.linalg.solve(system, right)[:count].T, np.float32)


def _drift(places: Float64) -> Float64:
    """Return the shapes that must come out exactly: flat, sloping and curved surfaces."""
    x, y = places.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


@functools.cache
def lenslet_covariance() -> tuple[Float64, Float64]:
    """Return distances in rows of lenslets, and the covariance of lenslet brightnesses at each, 1 at distance 0."""
    size, step = 512, 0.25
    frequency = np.fft.fftfreq(size, step)
    radial = np.hypot(*np.meshgrid(frequency, frequency))
    argument = np.maximum(np.pi * radial * PITCH, 1e-9)
    aperture = 2 * j1(argument) / argument
    spectrum = aperture**2 / np.maximum(radial, 1 / 64) ** (2 * _DETAIL_POWER)
    profile = np.fft.ifft2(spectrum).real[0, : size // 2]
    return np.asarray(step * np.arange(size // 2), np.float64), np.asarray(profile / profile[0], np.float64)
