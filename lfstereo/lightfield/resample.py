"""Resample a developed lenslet image to views: inside each micro-image, then from hexagons to squares."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, Rgb, UInt8, Views
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import ViewSampling
from lfstereo.progress import Progress, silent

_ROWS_PER_TASK = 8


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
    image: Rgb | Float32, grid: LensletGrid, sampling: ViewSampling, count: int, progress: Progress = silent
) -> Views | Float32:
    """Read all views from an image on the raw sensor's pixels.

    Inside a micro-image by cubic convolution at the exact sub-pixel position; then along each row of lenslets
    from their spacing to the square columns, again by cubic convolution.

    Parameters
    ----------
    image
        ``(H, W, 3)`` linear RGB, or ``(H, W)``.
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
    ``(T, S, V, U, 3)`` or ``(T, S, V, U)`` float32. Beyond the border of the sensor the last pixel counts.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (IEEE TASSP 1981), eq. 15 (a = -1/2).
    """
    channels = 1 if image.ndim == 2 else 3
    planes = image.reshape(*image.shape[:2], channels)
    columns = view_columns(grid)
    out = np.empty((count, count, grid.rows, columns, channels), np.float32)
    offsets = np.ascontiguousarray(view_offsets(sampling, count).reshape(-1, 2))
    flat_out = out.reshape(count * count, grid.rows, columns, channels)
    centres = grid.centres()
    first, step = _column_positions(grid, sampling)
    starts = list(range(0, grid.rows, _ROWS_PER_TASK))

    def task(start: int) -> None:
        stop = min(start + _ROWS_PER_TASK, grid.rows)
        _sample_rows(planes, centres[start:stop], offsets, first[start:stop], step, flat_out[:, start:stop])

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for done, _ in enumerate(pool.map(task, starts)):
            progress(done + 1, len(starts))
    return out if image.ndim == 3 else out[..., 0]


def sample_weights(shading: Float32, grid: LensletGrid, sampling: ViewSampling, count: int) -> UInt8:
    """Read the confidence of every view sample from the illumination of the pixels.

    Parameters
    ----------
    shading
        ``(H, W)`` float32 relative illumination, 1 = full light.
    grid, sampling, count
        As for :func:`sample_views`.

    Returns
    -------
    ``(T, S, V, U)`` uint8, 255 = full light; 0 where the view would look through a neighbouring lenslet.
    """
    out = np.empty((count, count, grid.rows, view_columns(grid)), np.uint8)
    inside = views_inside(grid, sampling, count)
    sampled = sample_views(shading, grid, sampling, count)
    for t in range(count):
        for s in range(count):
            out[t, s] = np.clip(sampled[t, s] * 255 + 0.5, 0, 255) if inside[t, s] else 0
    return out


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
def _sample_rows(
    image: Float32, centres: Float64, offsets: Float64, first: Float64, step: float, out: Float32
) -> None:  # pragma: no cover
    """Fill ``out`` ``(views, rows, columns, channels)`` for some rows of lenslets."""
    height, width, channels = image.shape
    views, rows, columns = out.shape[0], out.shape[1], out.shape[2]
    lenslets = centres.shape[1]
    hexagons = np.empty((views, lenslets, channels), np.float32)
    for v in range(rows):
        for k in range(lenslets):
            cx, cy = centres[v, k, 0], centres[v, k, 1]
            for n in range(views):
                x, y = cx + offsets[n, 0], cy + offsets[n, 1]
                left, top = int(np.floor(x)), int(np.floor(y))
                wx, wy = _keys(x - left), _keys(y - top)
                for c in range(channels):
                    hexagons[n, k, c] = 0.0
                for b in range(4):
                    row = min(max(top - 1 + b, 0), height - 1)
                    for a in range(4):
                        column = min(max(left - 1 + a, 0), width - 1)
                        weight = np.float32(wy[b] * wx[a])
                        for c in range(channels):
                            hexagons[n, k, c] += weight * image[row, column, c]
        for u in range(columns):
            position = min(max(first[v] + u * step, 0.0), lenslets - 1.0)
            base = int(position)
            w = _keys(position - base)
            k0, k1 = max(base - 1, 0), base
            k2, k3 = min(base + 1, lenslets - 1), min(base + 2, lenslets - 1)
            w0, w1, w2, w3 = np.float32(w[0]), np.float32(w[1]), np.float32(w[2]), np.float32(w[3])
            for n in range(views):
                for c in range(channels):
                    out[n, v, u, c] = (
                        w0 * hexagons[n, k0, c]
                        + w1 * hexagons[n, k1, c]
                        + w2 * hexagons[n, k2, c]
                        + w3 * hexagons[n, k3, c]
                    )
