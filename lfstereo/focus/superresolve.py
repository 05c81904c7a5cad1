"""Refocus onto a finer grid: views that differ by parts of a pixel see between each other's samples."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numba
import numpy as np

from lfstereo.arrays import Float32, Rgb, UInt8
from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights
from lfstereo.focus.refocus import refocus
from lfstereo.focus.shift_kernels import compiled
from lfstereo.lightfield.field import LightField

_PRIOR_SHARE = 0.05
"""Weight of the interpolated picture beside the samples, as a share of what samples weigh on the average."""
_LARGEST_FACTOR = 8


def superresolve(light_field: LightField, slope: float, factor: int, options: RefocusOptions = RefocusOptions()) -> Rgb:
    """Return the picture focused at a slope with ``factor`` times the pixels along each axis.

    Every sample of every view is put where it falls on the fine grid, shared between the four pixels around it; the
    mean of what falls on a pixel is shown. Where no sample comes near, as at slope 0 where all views coincide, the
    refocused picture is interpolated. Only what lies at the slope gains detail; elsewhere
    neighbouring fine pixels are reached by other views, which shows as a fine lattice in what is far out of focus.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    slope
        px of the views per view.
    factor
        Fine px per px.
    options
        Which views take part.

    Returns
    -------
    ``(V * factor, U * factor, 3)``; fine px ``X`` lies at ``(X + 0.5) / factor - 0.5``.

    Raises
    ------
    ConfigError
        If the factor is not from 1 to 8, or the options ask for another reduction than the mean, or for a tilt.
    ShapeError, InputError
        As :func:`lfstereo.focus.refocus.refocus`.

    References
    ----------
    Fruchter and Hook, "Drizzle: a method for the linear reconstruction of undersampled images" (2002);
    Bishop, Zanetti, Favaro, "Light field superresolution" (2009), on what fractional slopes give.
    """
    if not 1 <= factor <= _LARGEST_FACTOR:
        raise ConfigError(f"factor = {factor}: expected a whole number from 1 to {_LARGEST_FACTOR}")
    if options.reduction != "mean" or any(options.tilt):
        raise ConfigError(
            f"found reduction '{options.reduction}' and tilt {options.tilt}, expected the mean without tilt for a "
            "finer picture; leave them out"
        )
    coarse = refocus(light_field, [slope], replace(options, interpolation="cubic"))[0]
    fine = tuple(n * factor for n in coarse.shape[1::-1])
    smooth: Float32 = np.asarray(cv2.resize(coarse, fine, interpolation=cv2.INTER_CUBIC), np.float32)
    if factor == 1:
        return smooth
    aperture = aperture_weights(light_field, options)
    weight = np.empty((0, 0, 0, 0), np.uint8) if light_field.weight is None else light_field.weight.copy()
    if light_field.weight is not None and options.least_weight > 0:
        weight[weight < 255 * options.least_weight] = 0
    prior = _PRIOR_SHARE * float(aperture.sum()) / factor**2
    views = np.ascontiguousarray(light_field.views)
    _gather(views, weight, aperture, float(slope), light_field.centre, factor, prior, smooth)
    return smooth


@compiled()
def _add_row(row: Float32, weight: UInt8, gain: float, first: float, factor: int, total: Float32) -> None:
    """Share the samples of one row ``(U, 3)`` between fine pixels; ``first`` is where the first one falls."""
    for u in range(row.shape[0]):
        x = first + factor * u
        left = int(np.floor(x))
        part = np.float32(x - left)
        share = np.float32(gain)
        if weight.shape[0] > 0:
            if weight[u] == 0:
                continue
            share *= np.float32(weight[u]) * np.float32(1.0 / 255.0)
        for i in range(2):
            to = left + i
            if 0 <= to < total.shape[0]:
                part_of = share * (part if i == 1 else np.float32(1.0) - part)
                for c in range(3):
                    total[to, c] += part_of * row[u, c]
                total[to, 3] += part_of


@compiled(parallel=True)
def _gather(
    views: Float32,
    weight: UInt8,
    aperture: Float32,
    slope: float,
    centre: tuple[int, int],
    factor: int,
    prior: float,
    picture: Float32,
) -> None:
    """Change an interpolated ``picture (V*factor, U*factor, 3)`` to the mean of it and the samples near each pixel."""
    rows = views.shape[2]
    for fine in numba.prange(picture.shape[0]):
        total = np.zeros((picture.shape[1], 4), np.float32)
        extra = np.float32(prior)
        for t in range(views.shape[0]):
            # View row v falls on fine row factor * (v + slope (t - t0) + 1/2) - 1/2.
            at = (fine + 0.5) / factor - 0.5 - slope * (t - centre[0])
            for v in range(int(np.ceil(at - 1.0 / factor)), int(np.floor(at + 1.0 / factor)) + 1):
                gain = 1.0 - factor * abs(v - at)
                if v < 0 or v >= rows or gain <= 0:
                    continue
                for s in range(views.shape[1]):
                    if aperture[t, s] > 0:
                        first = factor * (slope * (s - centre[1]) + 0.5) - 0.5
                        of_row = weight[t, s, v] if weight.shape[0] > 0 else weight[0:0, 0, 0, 0]
                        _add_row(views[t, s, v], of_row, gain * aperture[t, s], first, factor, total)
        for x in range(picture.shape[1]):
            for c in range(3):
                picture[fine, x, c] = (total[x, c] + extra * picture[fine, x, c]) / (total[x, 3] + extra)
