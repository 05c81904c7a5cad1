"""Compiled inner loops of shift-and-add: translate rows by fractions of a pixel and sum them.

A view's shift is a pure translation and its weights between pixels are a product, so the sum over the views of one
view row is taken first, along image rows; what it gives is then moved along image columns, once for all of them.
The image rows of a view row are copied once, with a margin of zeros, and serve every slice.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64, UInt8

Int64: TypeAlias = npt.NDArray[np.int64]
_FunctionT = TypeVar("_FunctionT", bound=Callable[..., Any])
ROWS_PER_BAND = 32
"""Image rows that one thread sums at a time."""
TAPS = 4
"""Most neighbours that one shifted sample is made of."""
LEAST_WEIGHT = 1e-4
"""Summed weight, in fully trusted views, below which a slice shows the centre view instead of a quotient."""


def compiled(parallel: bool = False) -> Callable[[_FunctionT], _FunctionT]:
    """Compile a function, kept on disk for the next run where any folder for that can be written."""

    def decorate(function: _FunctionT) -> _FunctionT:
        settings = {"parallel": parallel, "nogil": True, "fastmath": {"contract"}}
        try:
            return cast(_FunctionT, numba.njit(cache=True, **settings)(function))
        except RuntimeError:
            return cast(_FunctionT, numba.njit(**settings)(function))

    return decorate


@compiled()
def tap_gains(shift_px: float, cubic: bool, gains: Float32) -> int:
    """Fill ``gains (4,)`` so that ``f(x - shift) = sum of gains[j] f(x - first - j)``; return ``first``.

    Linear interpolation has two taps, cubic convolution four.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (1981), equation 15.
    """
    whole = int(np.floor(shift_px))
    part = np.float32(shift_px - whole)
    rest = np.float32(1.0) - part
    half = np.float32(0.5)
    if cubic:
        gains[0] = -half * part * rest * rest
        gains[1] = half * (3 * part * part * part - 5 * part * part + 2)
        gains[2] = half * (3 * rest * rest * rest - 5 * rest * rest + 2)
        gains[3] = -half * rest * part * part
        return whole - 1
    gains[0], gains[1], gains[2], gains[3] = rest, part, np.float32(0.0), np.float32(0.0)
    return whole


@compiled()
def _copy_rows(views: Float32, weight: UInt8, t: int, v: int, channels: int, margin: int, rows: Float32) -> None:
    """Fill ``rows (S, margin + U * channels + margin)`` with row ``v`` of view row ``t``.

    With four channels the colours are times the weight, 255 as 1, and the weight itself is the fourth.
    """
    for s in range(views.shape[1]):
        row = rows[s]
        if channels == 3:
            for x in range(views.shape[3]):
                row[margin + x] = views[t, s, v, x]
            continue
        for u in range(weight.shape[3]):
            share = np.float32(weight[t, s, v, u]) * np.float32(1.0 / 255.0)
            for c in range(3):
                row[margin + 4 * u + c] = share * views[t, s, v, 3 * u + c] if share > 0 else np.float32(0.0)
            row[margin + 4 * u + 3] = share


@compiled()
def _sum_taps(source: Float32, starts: Int64, gains: Float32, count: int, total: Float32) -> None:
    """Set ``total (W,)`` to the sum of ``gains[j] * source[starts[j] : starts[j] + W]``.

    Eight are summed in registers before the total is touched; gains beyond ``count`` must be zero.
    """
    width = total.shape[0]
    for x in range(width):
        total[x] = 0
    for j in range(0, count, 8):
        a, b = source[starts[j] : starts[j] + width], source[starts[j + 1] : starts[j + 1] + width]
        c, d = source[starts[j + 2] : starts[j + 2] + width], source[starts[j + 3] : starts[j + 3] + width]
        e, f = source[starts[j + 4] : starts[j + 4] + width], source[starts[j + 5] : starts[j + 5] + width]
        g, h = source[starts[j + 6] : starts[j + 6] + width], source[starts[j + 7] : starts[j + 7] + width]
        ga, gb, gc, gd = gains[j], gains[j + 1], gains[j + 2], gains[j + 3]
        ge, gf, gg, gh = gains[j + 4], gains[j + 5], gains[j + 6], gains[j + 7]
        for x in range(width):
            near = (ga * a[x] + gb * b[x]) + (gc * c[x] + gd * d[x])
            total[x] += near + ((ge * e[x] + gf * f[x]) + (gg * g[x] + gh * h[x]))


@compiled()
def _list_taps(
    aperture: Float32,
    slope: float,
    s0: int,
    cubic: bool,
    layout: tuple[int, int, int],
    starts: Int64,
    gains: Float32,
) -> int:
    """Fill where in the copied rows each tap of one view row begins, and its gain; return how many there are.

    ``layout`` is the channels, the length of a copied row and its margin.
    """
    channels, stride, margin = layout
    tap = np.empty(TAPS, np.float32)
    count = 0
    for s in range(aperture.shape[0]):
        first = tap_gains(slope * (s - s0), cubic, tap)
        for j in range(TAPS):
            if aperture[s] * tap[j] != 0:
                starts[count] = s * stride + margin - (first + j) * channels
                gains[count] = aperture[s] * tap[j]
                count += 1
    for j in range(count, min(count + 8, gains.shape[0])):
        starts[j], gains[j] = starts[0], np.float32(0.0)
    return count


@compiled()
def _reach_px(slopes: Float64, views_away: int) -> int:
    return int(np.ceil(np.max(np.abs(slopes)) * abs(views_away))) + 2


@compiled()
def _lands(top: int, gains: Float32, first: int, last: int) -> bool:
    """Tell whether a tap with a gain falls on a row of ``[first, last)``."""
    hit = False
    for j in range(TAPS):
        hit |= gains[j] != 0 and first <= top + j < last
    return hit


@compiled()
def _add_rows(total: Float32, top: int, gains: Float32, first: int, last: int, summed: Float32) -> None:
    """Add one row at the height of its taps to those rows of ``summed`` that lie in ``[first, last)``."""
    for j in range(TAPS):
        if gains[j] != 0 and first <= top + j < last:
            target, gain = summed[top + j - first], gains[j]
            for x in range(total.shape[0]):
                target[x] += gain * total[x]


@compiled()
def _divide_row(summed: Float32, channels: int, coverage: Float32, instead: Float32, row: Float32) -> None:
    """Fill ``row (U*3)`` with sums over weights, or with what is shown instead where hardly any weight came."""
    for u in range(row.shape[0] // 3):
        weight = summed[4 * u + 3] if channels == 4 else coverage[u]
        for c in range(3):
            if weight > LEAST_WEIGHT:
                row[3 * u + c] = summed[channels * u + c] / weight
            else:
                row[3 * u + c] = instead[3 * u + c]


@compiled(parallel=True)
def average_views(
    views: Float32,
    weight: UInt8,
    coverage: Float32,
    aperture: Float32,
    slopes: Float64,
    centre: tuple[int, int],
    cubic: bool,
    first_row: int,
    slices: Float32,
) -> None:
    """Fill ``slices (K, R, U*3)`` with the mean of all views, the image rows from ``first_row`` on.

    Parameters
    ----------
    views
        ``(T, S, V, U*3)``.
    weight
        ``(T, S, V, U)`` of each sample, 255 = full; empty where all count alike.
    coverage
        ``(K, V, U)`` summed weight where all samples count alike; else empty.
    aperture
        ``(T, S)`` weight of each view.
    slopes
        ``(K,)`` px per view.
    centre
        Row and column of the centre view; it is shown where hardly any weight comes.
    cubic
        By four neighbours instead of two along each axis.
    first_row
        Image row of the first row of ``slices``.
    slices
        Filled.
    """
    channels = 4 if weight.shape[0] > 0 else 3
    width = views.shape[3] // 3 * channels
    away = max(centre[1], views.shape[1] - 1 - centre[1])
    margin = (_reach_px(slopes, away) + 1) * channels
    count, rows_out = slices.shape[:2]
    for band in numba.prange((rows_out + ROWS_PER_BAND - 1) // ROWS_PER_BAND):
        first = first_row + band * ROWS_PER_BAND
        last = min(first + ROWS_PER_BAND, first_row + rows_out)
        summed = np.zeros((count, last - first, width), np.float32)
        rows = np.zeros((views.shape[1], margin + width + margin), np.float32)
        layout = (channels, rows.shape[1], margin)
        total = np.empty(width, np.float32)
        starts = np.zeros(TAPS * views.shape[1] + 8, np.int64)
        gains = np.zeros(TAPS * views.shape[1] + 8, np.float32)
        down = np.empty(TAPS, np.float32)
        for t in range(views.shape[0]):
            reach = _reach_px(slopes, t - centre[0])
            for v in range(max(0, first - reach), min(views.shape[2], last + reach)):
                copied = False
                for k in range(count):
                    top = v + tap_gains(slopes[k] * (t - centre[0]), cubic, down)
                    if not _lands(top, down, first, last):
                        continue
                    if not copied:
                        _copy_rows(views, weight, t, v, channels, margin, rows)
                        copied = True
                    taps = _list_taps(aperture[t], slopes[k], centre[1], cubic, layout, starts, gains)
                    _sum_taps(rows.ravel(), starts, gains, taps, total)
                    _add_rows(total, top, down, first, last, summed[k])
        for k in range(count):
            for v in range(first, last):
                known = coverage[k, v] if channels == 3 else coverage[0, 0]
                instead = views[centre[0], centre[1], v]
                _divide_row(summed[k, v - first], channels, known, instead, slices[k, v - first_row])
