"""Resample to views: inside each micro-image where all colours are known, then from hexagons to squares."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numba
import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from lfstereo.arrays import Float32, Float64, Rgb, UInt8, Views
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import ViewSampling
from lfstereo.lightfield.fine_rows import Interpolation, fine_weights
from lfstereo.lightfield.hexagons import hexagon_weights
from lfstereo.lightfield.micro_images import Index
from lfstereo.progress import Progress, silent

_ROWS_PER_BAND = 36
_COLUMNS_AT_ONCE = 16
"""View columns of all views that are computed before they are written, so that they stay in the processor's cache."""
IntArray: TypeAlias = npt.NDArray[np.int64]


def view_sampling(grid: LensletGrid, view_step_px: float, upsampling: int = 1) -> ViewSampling:
    """Place square view pixels on a hexagonal lattice: one row per lenslet row, steps equal in x and y.

    Parameters
    ----------
    grid
        The lenslet grid.
    view_step_px
        Sensor px between neighbouring views.
    upsampling
        View pixels per row of lenslets, and as many times more columns.

    Returns
    -------
    Where the view pixels lie. Without upsampling view row v lies on lenslet row v; view column 0 lies on column 0 of
    the rows that are not shifted.
    """
    step_u, step_v = np.asarray(grid.step_u_px), np.asarray(grid.step_v_px)
    along = step_u / np.hypot(*step_u)
    across = np.array([-along[1], along[0]])
    return ViewSampling(
        origin_px=grid.origin_px,
        step_px=(float(np.hypot(*step_u) * np.sqrt(3) / 2) / upsampling, float(step_v @ across) / upsampling),
        rotation_rad=float(np.arctan2(along[1], along[0])),
        view_step_px=view_step_px,
    )


def view_columns(grid: LensletGrid) -> int:
    """Return the number of view columns that cover a grid's columns: 625 for 541 lenslets."""
    return int(np.ceil(grid.columns * 2 / np.sqrt(3)))


def view_offsets(sampling: ViewSampling, count: int) -> Float64:
    """Return ``(count, count, 2)`` offsets (x, y) px from a micro-image's centre of the views ``(t, s)``."""
    steps = (np.arange(count) - count // 2) * sampling.view_step_px
    cos, sin = np.cos(sampling.rotation_rad), np.sin(sampling.rotation_rad)
    s, t = np.meshgrid(steps, steps)
    return np.stack([cos * s - sin * t, sin * s + cos * t], axis=2)


class LensletReader(Protocol):
    """Gives the views' colours at the lenslets of some rows, on the hexagonal lattice."""

    def __call__(self, start: int, stop: int, values: Float32) -> Index:
        """Fill ``(lenslets, 3 N)`` values and return the ``(rows, columns)`` places of the lenslets among them."""


@dataclass(frozen=True, slots=True)
class LensletImage:
    """An image with all colours on the raw sensor's pixels, read by cubic convolution at the exact positions.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (IEEE TASSP 1981), eq. 15 (a = -1/2).
    """

    image: Rgb
    """``(H, W, 3)``; beyond the sensor its last pixel counts."""
    centres: Float64
    """``(rows, columns, 2)`` (x, y) px of the lenslets."""
    offsets: Float64
    """``(N, 2)`` (x, y) px of the views from a micro-image's centre."""

    def __call__(self, start: int, stop: int, values: Float32) -> Index:
        """Read the views' colours at the lenslets of some rows, as :class:`LensletReader` says."""
        centres = self.centres[start:stop].reshape(-1, 2)
        _sample_lenslets(self.image, centres, self.offsets, values.reshape(len(centres), -1, 3))
        return np.arange(len(centres), dtype=np.int32).reshape(stop - start, -1)


def sample_views(
    read: LensletReader,
    shading: Float32,
    grid: LensletGrid,
    sampling: ViewSampling,
    count: int,
    progress: Progress = silent,
    upsampling: int = 1,
    interpolation: Interpolation = "kriging",
) -> tuple[Views, UInt8]:
    """Turn the hexagonal lattice of lenslets into views of square pixels.

    By the weights of :func:`hexagon_weights` where every view row lies on a row of lenslets, else of
    :func:`fine_weights`.

    Parameters
    ----------
    read
        Gives the colours at the lenslets of the views that :func:`offsets_inside` names, in that order.
    shading
        ``(H, W)`` float32 relative illumination of the sensor's pixels, 1 = full light.
    grid
        The lenslet grid.
    sampling
        Where view pixels lie, see :func:`view_sampling`.
    count
        Views per direction, odd.
    progress
        Told of each band of rows.
    upsampling
        View pixels per row of lenslets, as the sampling was made with.
    interpolation
        How the lattice is interpolated.

    Returns
    -------
    Views ``(T, S, V, U, 3)`` float32, not below 0, and weights ``(T, S, V, U)`` uint8, 255 = full light. Views
    that would look through a neighbouring lenslet are 0 in both; off the sensor the weight is 0.
    """
    shape = (count, count, upsampling * grid.rows, upsampling * view_columns(grid))
    views = np.zeros((*shape, 3), np.float32)
    weights = np.zeros(shape, np.uint8)
    offsets = offsets_inside(grid, sampling, count)
    numbers = np.flatnonzero(views_inside(grid, sampling, count))
    centres = grid.centres()
    flat_views, flat_weights = views.reshape(-1, *shape[2:], 3), weights.reshape(-1, *shape[2:])
    starts = range(0, grid.rows, _ROWS_PER_BAND)
    room = threading.local()

    def task(start: int) -> None:
        stop = min(start + _ROWS_PER_BAND, grid.rows)
        halo = max(min(start - 1, grid.rows - 3), 0), min(stop + 2, grid.rows)
        if not hasattr(room, "values"):
            room.values = np.empty(((_ROWS_PER_BAND + 4) * grid.columns, 3 * len(offsets)), np.float32)
        values: Float32 = room.values[: (halo[1] - halo[0]) * grid.columns]
        places = read(*halo, values)
        for row in range(start, stop):
            half = int((row + grid.first_shifted_row) % 2 == 0)
            # The lattice is symmetric about a row, so beyond the first and last row those on the other side serve.
            around = np.abs(np.arange(row - 1, row + 3))
            around = np.where(around < grid.rows, around, 2 * (grid.rows - 1) - around)
            near = places[np.clip(around - halo[0], 0, len(places) - 1)]
            for part in range(upsampling):
                line, down = upsampling * row + part, part / upsampling
                first, step = _column_position(grid, sampling, row, down)
                if upsampling == 1 and interpolation == "kriging":
                    _blend_row(values, near, numbers, first, step, half, hexagon_weights(), line, flat_views)
                else:
                    table = fine_weights(interpolation, upsampling)[part]
                    _blend_fine_row(values, near, numbers, first, step, half, table, line, flat_views)
                _weigh_row(shading, centres[row], offsets, numbers, first, step, line, flat_weights)

    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for done, _ in enumerate(pool.map(task, starts)):
            progress(done + 1, len(starts))
    return views, weights


def views_inside(
    grid: LensletGrid, sampling: ViewSampling, count: int
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return ``(count, count)``: True where a view's offset stays within its own micro-image."""
    offsets = view_offsets(sampling, count)
    radius = 0.5 * float(np.hypot(*grid.step_u_px))
    return np.asarray(np.hypot(offsets[..., 0], offsets[..., 1]) <= radius, np.bool_)


def offsets_inside(grid: LensletGrid, sampling: ViewSampling, count: int) -> Float64:
    """Return ``(N, 2)`` offsets (x, y) px from a micro-image's centre of the views that stay inside it."""
    offsets = view_offsets(sampling, count)[views_inside(grid, sampling, count)]
    return np.asarray(offsets, np.float64)


def _column_position(grid: LensletGrid, sampling: ViewSampling, row: int, down: float) -> tuple[float, float]:
    """Return the lenslet coordinate in a row of view column 0, and the lenslets per view column.

    ``down`` is how far below the row the view pixels lie, in distances of rows.
    """
    pitch = float(np.hypot(*grid.step_u_px))
    along = np.asarray(grid.step_u_px) / pitch
    lean = float(np.asarray(grid.step_v_px) @ along) / pitch
    shift = 0.5 * ((row + grid.first_shifted_row) % 2 == 0)
    return -(row + down) * lean - shift, sampling.step_px[0] / pitch


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def _keys(f: float) -> tuple[float, float, float, float]:  # pragma: no cover
    g = 1.0 - f
    return (
        -0.5 * f * g * g,
        1.0 + f * f * (1.5 * f - 2.5),
        1.0 + g * g * (1.5 * g - 2.5),
        -0.5 * g * f * f,
    )


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _sample_lenslets(image: Float32, centres: Float64, offsets: Float64, out: Float32) -> None:  # pragma: no cover
    """Fill ``out`` ``(lenslets, views, 3)`` for one row of lenslets."""
    height, width = image.shape[:2]
    for k in range(centres.shape[0]):
        for n in range(offsets.shape[0]):
            x, y = centres[k, 0] + offsets[n, 0], centres[k, 1] + offsets[n, 1]
            left, top = int(np.floor(x)), int(np.floor(y))
            wx, wy = _keys(x - left), _keys(y - top)
            red = green = blue = np.float32(0.0)
            for b in range(4):
                row = min(max(top - 1 + b, 0), height - 1)
                for a in range(4):
                    column = min(max(left - 1 + a, 0), width - 1)
                    weight = np.float32(wy[b] * wx[a])
                    red += weight * image[row, column, 0]
                    green += weight * image[row, column, 1]
                    blue += weight * image[row, column, 2]
            out[k, n, 0], out[k, n, 1], out[k, n, 2] = red, green, blue


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _blend_row(
    values: Float32,
    places: Index,
    numbers: IntArray,
    first: float,
    step: float,
    half: int,
    table: Float32,
    v: int,
    views: Float32,
) -> None:  # pragma: no cover
    """Fill row ``v`` of the views, a few columns of all views at a time.

    ``places`` ``(4, columns)`` says where the lenslets of the row above, the row and the two below stand; ``half`` is 1
    in a row that lies half a pitch to the right.
    """
    lenslets = places.shape[1]
    columns, size = views.shape[2], values.shape[1]
    block = np.empty((_COLUMNS_AT_ONCE, size), np.float32)
    zero = np.float32(0.0)
    for start in range(0, columns, _COLUMNS_AT_ONCE):
        stop = min(start + _COLUMNS_AT_ONCE, columns)
        for u in range(start, stop):
            blended = block[u - start]
            blended[:] = zero
            position = min(max(first + u * step, 0.0), lenslets - 1.0)
            nearest = int(np.floor(position + 0.5))
            phase = (position - nearest + 0.5) * (table.shape[0] - 1)
            lower = min(int(phase), table.shape[0] - 2)
            for tap in range(13):
                if tap < 5:
                    row, k = 1, nearest + tap - 2
                elif tap < 9:
                    row, k = 0, nearest + tap - 7 + half
                else:
                    row, k = 2, nearest + tap - 11 + half
                weight = table[lower, tap] + np.float32(phase - lower) * (table[lower + 1, tap] - table[lower, tap])
                source = values[places[row, min(max(k, 0), lenslets - 1)]]
                for m in range(size):
                    blended[m] += weight * source[m]
        _write_block(block, numbers, start, stop, v, views)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _blend_fine_row(
    values: Float32,
    places: Index,
    numbers: IntArray,
    first: float,
    step: float,
    half: int,
    table: Float32,
    v: int,
    views: Float32,
) -> None:  # pragma: no cover
    """Fill row ``v`` of the views as :func:`_blend_row`, by sixteen lenslets of four rows."""
    lenslets = places.shape[1]
    columns, size = views.shape[2], values.shape[1]
    block = np.empty((_COLUMNS_AT_ONCE, size), np.float32)
    for start in range(0, columns, _COLUMNS_AT_ONCE):
        stop = min(start + _COLUMNS_AT_ONCE, columns)
        for u in range(start, stop):
            blended = block[u - start]
            blended[:] = np.float32(0.0)
            position = min(max(first + u * step, 0.0), lenslets - 1.0)
            left = int(position)
            phase = 2 * (position - left)
            right_half = int(phase)
            phase = (phase - right_half) * (table.shape[1] - 1)
            lower = min(int(phase), table.shape[1] - 2)
            near, far = table[right_half, lower], table[right_half, lower + 1]
            for tap in range(16):
                weight = near[tap] + np.float32(phase - lower) * (far[tap] - near[tap])
                if weight == 0:
                    continue
                row = tap // 4
                k = left - 1 + tap % 4
                if row % 2 == 0:
                    k += right_half - 1 + half
                source = values[places[row, min(max(k, 0), lenslets - 1)]]
                for m in range(size):
                    blended[m] += weight * source[m]
        _write_block(block, numbers, start, stop, v, views)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _write_block(
    block: Float32, numbers: IntArray, start: int, stop: int, v: int, views: Float32
) -> None:  # pragma: no cover
    """Write some columns of all views, not below 0."""
    zero = np.float32(0.0)
    for n in range(numbers.shape[0]):
        target = views[numbers[n], v]
        for u in range(start, stop):
            target[u, 0] = max(block[u - start, 3 * n], zero)
            target[u, 1] = max(block[u - start, 3 * n + 1], zero)
            target[u, 2] = max(block[u - start, 3 * n + 2], zero)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _weigh_row(
    shading: Float32,
    centres: Float64,
    offsets: Float64,
    numbers: IntArray,
    first: float,
    step: float,
    v: int,
    weights: UInt8,
) -> None:  # pragma: no cover
    """Fill row ``v`` of the weights: illumination, linear in the micro-image and between lenslets of the row."""
    height, width = shading.shape
    lenslets = centres.shape[0]
    light = np.empty(lenslets, np.float32)
    for n in range(offsets.shape[0]):
        for k in range(lenslets):
            x, y = centres[k, 0] + offsets[n, 0], centres[k, 1] + offsets[n, 1]
            light[k] = np.float32(0.0)
            if x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0:
                left, top = min(int(x), width - 2), min(int(y), height - 2)
                fx, fy = np.float32(x - left), np.float32(y - top)
                upper = shading[top, left] + fx * (shading[top, left + 1] - shading[top, left])
                lower = shading[top + 1, left] + fx * (shading[top + 1, left + 1] - shading[top + 1, left])
                light[k] = min(max(upper + fy * (lower - upper), np.float32(0.0)), np.float32(1.0))
        target = weights[numbers[n], v]
        for u in range(target.shape[0]):
            position = min(max(first + u * step, 0.0), lenslets - 1.0)
            k = min(int(position), max(lenslets - 2, 0))
            share = np.float32(position - k)
            between = light[k] + share * (light[min(k + 1, lenslets - 1)] - light[k])
            target[u] = int(between * np.float32(255) + np.float32(0.5))
