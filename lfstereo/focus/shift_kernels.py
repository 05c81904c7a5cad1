"""Compiled inner loops of shift-and-add: translate rows by fractions of a pixel and sum them.

A view's shift is a pure translation and its bilinear weights are a product, so the sum over the views of one
view row is taken first, along image rows; what it gives is then moved along image columns, once for all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, UInt8

_FunctionT = TypeVar("_FunctionT", bound=Callable[..., Any])
ROWS_PER_BAND = 16
"""Image rows that one thread sums at a time; their slices stay in its cache."""


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
def add_shifted_row(total: Float32, row: Float32, shift_px: float, gain: float, channels: int) -> None:
    """Add ``gain * row(x - shift_px)`` to ``total``, linearly interpolated, zero outside the row."""
    whole = int(np.floor(shift_px))
    part = np.float32(shift_px - whole)
    near_gain = np.float32(gain) * (np.float32(1.0) - part)
    far_gain = np.float32(gain) * part
    count, offset = row.shape[0], whole * channels
    first, last = max(0, offset + channels), min(count, count + offset)
    if last > first:
        near = row[first - offset : last - offset]
        far = row[first - offset - channels : last - offset - channels]
        middle = total[first:last]
        for x in range(last - first):
            middle[x] += near_gain * near[x] + far_gain * far[x]
    for x in range(max(0, offset), min(count, offset + channels)):
        total[x] += near_gain * row[x - offset]
    for x in range(max(0, count + offset), min(count, count + offset + channels)):
        total[x] += far_gain * row[x - offset - channels]


@compiled()
def add_between_rows(image: Float32, row: Float32, y: float, first: int, last: int) -> None:
    """Add one row at the height ``y`` to the two rows of ``image`` around it that lie in ``[first, last)``."""
    above = int(np.floor(y))
    part = np.float32(y - above)
    if first <= above < last:
        target = image[above]
        gain = np.float32(1.0) - part
        for x in range(row.shape[0]):
            target[x] += gain * row[x]
    if first <= above + 1 < last and part > 0:
        target = image[above + 1]
        for x in range(row.shape[0]):
            target[x] += part * row[x]


@compiled()
def _reaches(y: float, first: int, last: int) -> bool:
    return first - 1 < y < last


@compiled()
def _reach_px(slopes: Float64, views_away: int) -> int:
    return int(np.ceil(np.max(np.abs(slopes)) * abs(views_away))) + 1


@compiled(parallel=True)
def sum_views(
    views: Float32, aperture: Float32, slopes: Float64, centre: tuple[int, int], first_row: int, slices: Float32
) -> None:
    """Add all views ``(T, S, V, U*3)`` to ``slices (K, R, U*3)``, the image rows from ``first_row`` on."""
    rows = slices.shape[1]
    for band in numba.prange((rows + ROWS_PER_BAND - 1) // ROWS_PER_BAND):
        first = first_row + band * ROWS_PER_BAND
        last = min(first + ROWS_PER_BAND, first_row + rows)
        total = np.empty(views.shape[3], np.float32)
        for t in range(views.shape[0]):
            reach = _reach_px(slopes, t - centre[0])
            for v in range(max(0, first - reach), min(views.shape[2], last + reach)):
                for k in range(slopes.shape[0]):
                    y = v + slopes[k] * (t - centre[0])
                    if not _reaches(y, first, last):
                        continue
                    total[:] = 0
                    for s in range(views.shape[1]):
                        if aperture[t, s] > 0:
                            shift = slopes[k] * (s - centre[1])
                            add_shifted_row(total, views[t, s, v], shift, aperture[t, s], 3)
                    add_between_rows(slices[k], total, y - first_row, first - first_row, last - first_row)


@compiled()
def weigh_rows(views: Float32, weight: UInt8, t: int, v: int, colours: Float32, confidences: Float32) -> None:
    """Fill ``colours (S, U*3)`` and ``confidences (S, U)`` with row ``v`` of view row ``t``, weight 255 as 1."""
    for s in range(views.shape[1]):
        for u in range(weight.shape[3]):
            share = np.float32(weight[t, s, v, u]) * np.float32(1.0 / 255.0)
            confidences[s, u] = share
            for c in range(3):
                colours[s, 3 * u + c] = share * views[t, s, v, 3 * u + c] if share > 0 else np.float32(0.0)


@compiled(parallel=True)
def sum_weighted_views(
    views: Float32,
    weight: UInt8,
    aperture: Float32,
    slopes: Float64,
    centre: tuple[int, int],
    first_row: int,
    slices: Float32,
    weights: Float32,
) -> None:
    """Add all views times their weight to ``slices (K, R, U*3)`` and the weight to ``weights (K, R, U)``."""
    rows = slices.shape[1]
    for band in numba.prange((rows + ROWS_PER_BAND - 1) // ROWS_PER_BAND):
        first = first_row + band * ROWS_PER_BAND
        last = min(first + ROWS_PER_BAND, first_row + rows)
        colours = np.empty((views.shape[1], views.shape[3]), np.float32)
        confidences = np.empty((views.shape[1], weight.shape[3]), np.float32)
        total = np.empty(views.shape[3], np.float32)
        total_weight = np.empty(weight.shape[3], np.float32)
        for t in range(views.shape[0]):
            reach = _reach_px(slopes, t - centre[0])
            for v in range(max(0, first - reach), min(views.shape[2], last + reach)):
                weigh_rows(views, weight, t, v, colours, confidences)
                for k in range(slopes.shape[0]):
                    y = v + slopes[k] * (t - centre[0])
                    if not _reaches(y, first, last):
                        continue
                    total[:] = 0
                    total_weight[:] = 0
                    for s in range(views.shape[1]):
                        if aperture[t, s] > 0:
                            shift = slopes[k] * (s - centre[1])
                            add_shifted_row(total, colours[s], shift, aperture[t, s], 3)
                            add_shifted_row(total_weight, confidences[s], shift, aperture[t, s], 1)
                    add_between_rows(slices[k], total, y - first_row, first - first_row, last - first_row)
                    add_between_rows(weights[k], total_weight, y - first_row, first - first_row, last - first_row)
