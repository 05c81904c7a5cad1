"""Refocusing as the Light Field Toolbox for MATLAB does it, number for number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lfstereo.arrays import Float32, Float64, Views
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.options import option
from lfstereo.progress import Progress, silent

SlopeRule = Literal["per-view", "lftoolbox"]
_LEAST_WEIGHT = 10 * float(np.finfo(np.float32).eps)
_VALUES_AT_ONCE = 32 * 10**6


@dataclass(frozen=True, slots=True)
class ShiftSumOptions:
    """How the toolbox's ``LFFiltShiftSum`` puts the views together."""

    reduction: Literal["sum", "median", "max", "min"] = option("sum", "what is shown of the views' values")
    interpolation: Literal["linear", "cubic"] = option("linear", "how views are read between their px")
    upsample: float = option(1.0, "px of the picture per px of a view")
    mask: bool = option(False, "leave out samples of little weight")
    mask_threshold: float = option(0.5, "weight from which a sample counts where they are masked")


@dataclass(frozen=True, slots=True)
class ShiftSum:
    """What ``LFFiltShiftSum`` returns."""

    picture: Float32
    """``(V * upsample, U * upsample, 3)``, not clipped."""
    weight: Float32 | None
    """``(V * upsample, U * upsample)`` summed weight; ``None`` where the values are not divided by it."""


def slopes_by_rule(slopes: Sequence[float] | Float64 | Float32, rule: SlopeRule, views_per_direction: int) -> Float64:
    """Return px of shift per view, positive = nearer, of slopes that follow a rule.

    Parameters
    ----------
    slopes
        ``(K,)`` slopes as the rule has them.
    rule
        ``"per-view"``: they are what is wanted. ``"lftoolbox"``: its slope grows with distance, and its views lie at
        ``slope * N * linspace(-1/2, 1/2, N)``, so that neighbours are ``N / (N - 1)`` times the slope apart.
    views_per_direction
        N.

    References
    ----------
    Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), LFFiltShiftSum.

    Examples
    --------
    >>> slopes_by_rule([0.28], "lftoolbox", 15).round(6).tolist()
    [-0.3]
    """
    given = np.asarray(slopes, np.float64)
    if rule == "per-view":
        return given
    return -given * views_per_direction / max(views_per_direction - 1, 1)


def refocus_as_lftoolbox(
    views: Views,
    weight: Float32 | None,
    slope: float,
    options: ShiftSumOptions = ShiftSumOptions(),
    progress: Progress = silent,
) -> ShiftSum:
    """Shift and add as the toolbox does, with its slopes, its borders and its weights.

    Views go on beyond their border with their last value. With ``"sum"``, colours are times their weight and the
    sum is divided by that of the weights, 0 where it is next to nothing; the other reductions take the colours as
    they are. A mask leaves out each sample that touches one of too little weight, or lies outside its view.

    Parameters
    ----------
    views
        ``(T, S, V, U, 3)``.
    weight
        ``(T, S, V, U)`` 0 to 1, or ``None``.
    slope
        The toolbox's slope: it grows with distance; see :func:`slopes_by_rule`.
    options
        What the toolbox calls FiltOptions.
    progress
        Told the rows done.

    Raises
    ------
    ConfigError
        If a mask is asked for without weights, or the picture would have no pixels.
    ShapeError
        If views and weights do not fit together.

    References
    ----------
    Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), LFFiltShiftSum.
    """
    samples = _samples(views, weight, options)
    count_t, count_s, rows, columns, channels = samples.shape
    at_v, at_u = (np.linspace(0, n - 1, round(n * options.upsample)) for n in (rows, columns))
    down, across = (slope * n * np.linspace(-0.5, 0.5, n) for n in (count_t, count_s))
    picture = np.empty((len(at_v), len(at_u), channels), np.float32)
    step = max(1, _VALUES_AT_ONCE // (count_t * count_s * len(at_u) * channels))
    cubic = options.interpolation == "cubic"
    for first in range(0, len(at_v), step):
        part = at_v[first : first + step]
        shifted = np.empty((count_t * count_s, len(part), len(at_u), channels), np.float32)
        for t in range(count_t):
            for s in range(count_s):
                v, u = part + down[t], at_u + across[s]
                shifted[t * count_s + s] = _between(_between(samples[t, s], v, 0, cubic), u, 1, cubic)
                if options.mask:
                    shifted[t * count_s + s, _outside(v, rows)] = np.nan
                    shifted[t * count_s + s][:, _outside(u, columns)] = np.nan
        picture[first : first + step] = _REDUCTIONS[options.reduction](shifted)
        progress(min(first + step, len(at_v)), len(at_v))
    return _divided(picture) if options.reduction == "sum" else ShiftSum(picture[..., :3], None)


def _samples(views: Views, weight: Float32 | None, options: ShiftSumOptions) -> Float32:
    """Return what is interpolated: colours, for a sum times their weight, and the weight; NaN where masked."""
    if weight is not None and weight.shape != views.shape[:4]:
        raise ShapeError(f"weight: found an array of shape {weight.shape}, expected {views.shape[:4]} as the views")
    if options.mask and weight is None:
        raise ConfigError("mask: found views without weights, expected a weight for each sample; leave the mask out")
    if not (np.isfinite(options.upsample) and min(views.shape[2:4]) * options.upsample >= 1):
        raise ConfigError(f"upsample = {options.upsample}: expected a factor that leaves at least one px")
    share = np.ones(views.shape[:4], np.float32) if weight is None else weight
    colours = views * share[..., None] if options.reduction == "sum" else views
    samples: Float32 = np.concatenate([colours, share[..., None]], axis=-1)
    if options.mask:
        samples[share < options.mask_threshold] = np.nan
    return samples


def _outside(positions: Float64, count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    beyond: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (positions < 0) | (positions > count - 1)
    return beyond


def _between(samples: Float32, positions: Float64, axis: int, cubic: bool) -> Float32:
    """Read samples at fractional positions along an axis; the last ones go on beyond both ends.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (1981), equations 15, 19 and 25.
    """
    count = samples.shape[axis]
    if count == 1:
        return np.repeat(samples, len(positions), axis)
    at = np.clip(positions, 0, count - 1)
    low = np.clip(np.floor(at).astype(np.intp), 0, count - 2)
    shape = [1] * samples.ndim
    shape[axis] = -1
    part = (at - low).astype(np.float32).reshape(shape)
    if not cubic:
        linear: Float32 = np.take(samples, low, axis) * (1 - part) + np.take(samples, low + 1, axis) * part
        return linear
    ends = [(3, -3, 1), (1, -3, 3)] if count > 2 else [(2, -1), (-1, 2)]
    before, after = (
        sum(f * np.take(samples, [i if end == 0 else count - len(ends[0]) + i], axis) for i, f in enumerate(factors))
        for end, factors in enumerate(ends)
    )
    longer = np.concatenate([before, samples, after], axis)
    a, b, c, d = (np.take(longer, low + i, axis) for i in range(4))
    curved: Float32 = b + 0.5 * part * (c - a + part * (2 * a - 5 * b + 4 * c - d + part * (3 * (b - c) + d - a)))
    return curved


def _median(shifted: Float32) -> Float32:
    middle: Float32 = np.nanmedian(shifted, axis=0) if np.isnan(shifted).any() else np.median(shifted, axis=0)
    return middle


def _sum(shifted: Float32) -> Float32:
    total: Float32 = np.nansum(shifted, axis=0)
    return total


def _max(shifted: Float32) -> Float32:
    largest: Float32 = np.fmax.reduce(shifted, axis=0)
    return largest


def _min(shifted: Float32) -> Float32:
    smallest: Float32 = np.fmin.reduce(shifted, axis=0)
    return smallest


_REDUCTIONS: dict[str, Callable[[Float32], Float32]] = {"sum": _sum, "median": _median, "max": _max, "min": _min}


def _divided(picture: Float32) -> ShiftSum:
    weight = picture[..., 3]
    enough = weight >= _LEAST_WEIGHT
    colours = np.where(enough[..., None], picture[..., :3] / np.where(enough, weight, 1)[..., None], 0)
    return ShiftSum(colours.astype(np.float32), weight.copy())
