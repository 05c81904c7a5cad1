"""Resample a developed lenslet image to views: inside each micro-image, then from hexagons to squares."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64, Rgb, UInt8, Views
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import ViewSampling
from lfstereo.lightfield.hexagons import hexagon_weights
from lfstereo.progress import Progress, silent

_ROWS_PER_TASK = 24
IntArray: TypeAlias = npt.NDArray[np.int64]


def view_sampling(grid: LensletGrid, view_step_px: float) -> ViewSampling:
    """Place square view pixels on a hexagonal lattice: one row per lenslet row, steps equal in x and y.

    Parameters
    ----------
    grid
        The lenslet grid.
    view_step_px
        Sensor px between neighbouring views.

    Returns
    -------
    Where the view pixels lie. View row v lies on lenslet row v; view column 0 lies on column 0 of the rows that
    are not shifted.
    """
    step_u, step_v = np.asarray(grid.step_u_px), np.asarray(grid.step_v_px)
    along = step_u / np.hypot(*step_u)
    across = np.array([-along[1], along[0]])
    return ViewSampling(
        origin_px=grid.origin_px,
        step_px=(float(np.hypot(*step_u) * np.sqrt(3) / 2), float(step_v @ across)),
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


def sample_views(
    image: Rgb,
    shading: Float32,
    grid: LensletGrid,
    sampling: ViewSampling,
    count: int,
    progress: Progress = silent,
) -> tuple[Views, UInt8]:
    """Read all views and the weights of their samples from an image on the raw sensor's pixels.

    Inside a micro-image by cubic convolution at the exact sub-pixel position; then from the hexagonal lattice of
    lenslets to the square columns by the weights of :func:`hexagon_weights`, and nothing in between.

    Parameters
    ----------
    image
        ``(H, W, 3)`` linear RGB.
    shading
        ``(H, W)`` float32 relative illumination of the same pixels, 1 = full light.
    grid
        The lenslet grid.
    sampling
        Where view pixels lie, see :func:`view_sampling`.
    count
        Views per direction, odd.
    progress
        Told of each batch of rows.

    Returns
    -------
    Views ``(T, S, V, U, 3)`` float32, not below 0, and weights ``(T, S, V, U)`` uint8, 255 = full light. Views
    that would look through a neighbouring lenslet are 0 in both; beyond the sensor the last pixel counts, with
    weight 0.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (IEEE TASSP 1981), eq. 15 (a = -1/2).
    """
    columns = view_columns(grid)
    views = np.zeros((count, count, grid.rows, columns, 3), np.float32)
    weights = np.zeros((count, count, grid.rows, columns), np.uint8)
    inside = views_inside(grid, sampling, count).ravel()
    offsets = np.ascontiguousarray(view_offsets(sampling, count).reshape(-1, 2)[inside])
    numbers = np.flatnonzero(inside)
    centres = grid.centres()
    first, step = _column_positions(grid, sampling)
    table = hexagon_weights()
    flat_views = views.reshape(count * count, grid.rows, columns, 3)
    flat_weights = weights.reshape(count * count, grid.rows, columns)
    starts = list(range(0, grid.rows, _ROWS_PER_TASK))

    def task(start: int) -> None:
        stop = min(start + _ROWS_PER_TASK, grid.rows)
        shifted = grid.first_shifted_row
        _sample_rows(
            image,
            shading,
            centres,
            offsets,
            numbers,
            first,
            step,
            shifted,
            table,
            start,
            stop,
            flat_views,
            flat_weights,
        )

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
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


def _column_positions(grid: LensletGrid, sampling: ViewSampling) -> tuple[Float64, float]:
    """Return for each row the lenslet coordinate of view column 0, and the lenslets per view column."""
    pitch = float(np.hypot(*grid.step_u_px))
    along = np.asarray(grid.step_u_px) / pitch
    lean = float(np.asarray(grid.step_v_px) @ along) / pitch
    rows = np.arange(grid.rows)
    shift = 0.5 * ((rows + grid.first_shifted_row) % 2 == 0)
    return -rows * lean - shift, sampling.step_px[0] / pitch


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
def _sample_lenslets(
    image: Float32, shading: Float32, centres: Float64, offsets: Float64, out: Float32
) -> None:  # pragma: no cover
    """Fill ``out`` ``(views, lenslets, 4)``: RGB and shading of one row of lenslets."""
    height, width = shading.shape
    for k in range(centres.shape[0]):
        for n in range(offsets.shape[0]):
            x, y = centres[k, 0] + offsets[n, 0], centres[k, 1] + offsets[n, 1]
            left, top = int(np.floor(x)), int(np.floor(y))
            wx, wy = _keys(x - left), _keys(y - top)
            red = green = blue = light = np.float32(0.0)
            for b in range(4):
                row = min(max(top - 1 + b, 0), height - 1)
                for a in range(4):
                    column = min(max(left - 1 + a, 0), width - 1)
                    weight = np.float32(wy[b] * wx[a])
                    red += weight * image[row, column, 0]
                    green += weight * image[row, column, 1]
                    blue += weight * image[row, column, 2]
                    light += weight * shading[row, column]
            out[n, k, 0], out[n, k, 1], out[n, k, 2] = red, green, blue
            on_sensor = x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0
            out[n, k, 3] = light if on_sensor else np.float32(0.0)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _sample_rows(
    image: Float32,
    shading: Float32,
    centres: Float64,
    offsets: Float64,
    numbers: IntArray,
    first: Float64,
    step: float,
    first_shifted_row: int,
    table: Float32,
    start: int,
    stop: int,
    views: Float32,
    weights: UInt8,
) -> None:  # pragma: no cover
    """Fill rows ``start`` to ``stop`` of the views, keeping three rows of lenslets at a time."""
    rows, lenslets = centres.shape[0], centres.shape[1]
    blend = np.empty(13, np.float32)
    ring = np.zeros((3, offsets.shape[0], lenslets, 4), np.float32)
    for v in range(max(start - 1, 0), min(start + 1, rows)):
        _sample_lenslets(image, shading, centres[v], offsets, ring[v % 3])
    for v in range(start, stop):
        if v + 1 < rows:
            _sample_lenslets(image, shading, centres[v + 1], offsets, ring[(v + 1) % 3])
        # The lattice is symmetric about a row, so beyond the first and last row the other neighbour serves.
        above = v - 1 if v > 0 else min(1, rows - 1)
        below = v + 1 if v + 1 < rows else max(rows - 2, 0)
        shifted = (v + first_shifted_row) % 2 == 0
        half = 1 if shifted else 0
        for u in range(views.shape[2]):
            position = min(max(first[v] + u * step, 0.0), lenslets - 1.0)
            nearest = int(np.floor(position + 0.5))
            phase = (position - nearest + 0.5) * (table.shape[0] - 1)
            lower = min(int(phase), table.shape[0] - 2)
            for tap in range(13):
                blend[tap] = table[lower, tap] + np.float32(phase - lower) * (table[lower + 1, tap] - table[lower, tap])
            for n in range(offsets.shape[0]):
                red = green = blue = light = np.float32(0.0)
                for tap in range(13):
                    if tap < 5:
                        source, k = v, nearest + tap - 2
                    elif tap < 9:
                        source, k = above, nearest + tap - 7 + half
                    else:
                        source, k = below, nearest + tap - 11 + half
                    k = min(max(k, 0), lenslets - 1)
                    weight = blend[tap]
                    red += weight * ring[source % 3, n, k, 0]
                    green += weight * ring[source % 3, n, k, 1]
                    blue += weight * ring[source % 3, n, k, 2]
                    light += weight * ring[source % 3, n, k, 3]
                zero = np.float32(0.0)
                views[numbers[n], v, u, 0] = max(red, zero)
                views[numbers[n], v, u, 1] = max(green, zero)
                views[numbers[n], v, u, 2] = max(blue, zero)
                weights[numbers[n], v, u] = int(
                    min(max(light, zero), np.float32(1.0)) * np.float32(255) + np.float32(0.5)
                )
