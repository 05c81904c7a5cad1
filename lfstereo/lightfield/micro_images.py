"""The light inside micro-images, estimated in all colours at the views' offsets from the Bayer samples of each."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeAlias

import numba
import numpy as np
import numpy.typing as npt
from scipy.special import ndtr
from threadpoolctl import threadpool_limits

from lfstereo.arrays import Float32, Float64
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.hexagons import lenslet_covariance

Index: TypeAlias = npt.NDArray[np.int32]
IntArray: TypeAlias = npt.NDArray[np.int64]

PHASES = 16
"""Positions of a micro-image's centre within the two px of a Bayer cell, per direction, with an operator each."""
_USUAL_SLOPE, _LARGEST_SLOPE = 0.3, 1.4
"""Motion of the scene over the lenslets, rows of lenslets per px inside a micro-image: half as likely as none, and
not thought possible."""
_COLOUR_SHARE = 0.3
"""Variance that a colour has of its own, of the variance of the light common to all three. Photographs have less;
a larger share costs them little and saves strong colours."""
_NOISE = 1e-3
"""Variance of a fully lit sample's noise, of the variance of the light."""
_LEAKAGE = 0.7
"""Variance of the light of the next lenslet against this one's."""
_SPOT_PX = 0.45
"""Standard deviation of a point of light on the sensor: half a pixel's width and diffraction at f/2."""
_RIM_PX = 0.1
"""No sample nearer to the border of the lenslet's cell is used."""
_FILL_BELOW = 0.2
"""Relative illumination below which a sample is replaced by the next one of its colour towards the centre."""
_TABLE_STEP_PX = 1 / 128


@dataclass(frozen=True, slots=True)
class MicroImages:
    """A developed mosaic and what reads the views from its micro-images, a :class:`LensletReader`."""

    mosaic: Float32
    """``(H, W)`` devignetted and white balanced, greys equal in all colours."""
    shading: Float32
    """``(H, W)`` relative illumination of its pixels, 1 = full light."""
    centres: Float64
    """``(rows, columns, 2)`` (x, y) px of the lenslets."""
    operators: dict[int, Operator]
    """By phase, from :func:`micro_image_operators`."""

    def __call__(self, start: int, stop: int, values: Float32) -> Index:
        """Read the views' colours at the lenslets of some rows of the grid.

        Parameters
        ----------
        start, stop
            The rows.
        values
            Filled with ``(lenslets, 3 N)``, colours running fastest, in an order of their own.

        Returns
        -------
        ``(rows, columns)`` places of the lenslets among the values.
        """
        cells, phases = _cells(self.centres[start:stop])
        order = np.argsort(phases, kind="stable")
        edges = np.searchsorted(phases[order], np.arange(PHASES**2 + 1))
        places = np.empty(len(order), np.int32)
        places[order] = np.arange(len(order), dtype=np.int32)
        for phase in np.flatnonzero(np.diff(edges)):
            operator = self.operators[int(phase)]
            members = order[edges[phase] : edges[phase + 1]]
            patches = np.empty((members.size, len(operator.pixels)), np.float32)
            _gather(self.mosaic, self.shading, cells[members], operator.pixels, operator.inner, patches)
            np.matmul(patches, operator.weights, out=values[edges[phase] : edges[phase + 1]])
        return places.reshape(stop - start, -1)


@dataclass(frozen=True, slots=True)
class Operator:
    """How the views follow from the samples of a micro-image whose centre lies at one phase of the Bayer pattern."""

    pixels: Index
    """``(P, 2)`` (x, y) of the samples from the first pixel of the Bayer cell, nearest to the centre first."""
    inner: Index
    """``(P,)`` for each the next sample of its colour towards the centre; itself where there is none."""
    weights: Float32
    """``(P, 3 N)``, colours running fastest; a light that is even in each colour comes out exactly."""


def micro_image_operators(grid: LensletGrid, offsets: Float64, bayer: str, matrix: Float64) -> dict[int, Operator]:
    """Return, by phase, what reads all colours of all views from a micro-image, straight from the mosaic.

    Each micro-image's samples of all colours are weighted at once, by the best linear unbiased estimate for light
    fields of limited slope whose colours resemble each other. So there is no demosaic of the mosaic as if it were a
    picture, nothing is taken from the micro-images beside it, and samples near the rim count as little as their
    light and the neighbour's share in it allow.

    Parameters
    ----------
    grid
        The lenslet grid.
    offsets
        ``(N, 2)`` (x, y) px of the views from a micro-image's centre.
    bayer
        Colours of the top-left 2 x 2 sites row by row.
    matrix
        ``(3, 3)`` from the mosaic's colours to those of the views.

    References
    ----------
    Matheron, "Principles of geostatistics" (Economic Geology 1963), the kriging equations.
    Field, "Relations between the statistics of natural images and the response properties of cortical cells"
    (JOSA A 1987), spectra of natural images.
    Gunturk, Altunbasak, Mersereau, "Color plane interpolation using alternating projections" (IEEE TIP 2002):
    fine detail is nearly the same in all colours.
    """
    phases = np.unique(_cells(grid.centres())[1])
    pitch = float(np.hypot(*grid.step_u_px))
    angle = float(np.arctan2(grid.step_u_px[1], grid.step_u_px[0]))

    def operator(phase: int) -> Operator:
        centre = (np.array([phase % PHASES, phase // PHASES]) + 0.5) * (2 / PHASES)
        return micro_image_operator(centre, offsets, pitch, angle, bayer, matrix)

    # Many small products side by side: each stays on its own thread.
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        return dict(zip(phases.tolist(), pool.map(operator, phases), strict=True))


def micro_image_operator(
    centre: Float64, offsets: Float64, pitch_px: float, angle_rad: float, bayer: str, matrix: Float64
) -> Operator:
    """Return the operator of micro-images with a given centre.

    Parameters
    ----------
    centre
        ``(2,)`` (x, y) px of the micro-image's centre from a pixel whose site is the first of the Bayer pattern.
    offsets
        ``(N, 2)`` (x, y) px of the views from the centre.
    pitch_px, angle_rad
        Distance of the lenslets, and direction of their rows.
    bayer
        Colours of the top-left 2 x 2 sites.
    matrix
        ``(3, 3)`` applied to the colours.
    """
    pixels, border = _pixels_of(centre, pitch_px, angle_rad)
    count = len(pixels)
    colours = np.array(["rgb".index(c) for c in bayer]).reshape(2, 2)[pixels[:, 1] & 1, pixels[:, 0] & 1]
    radius = np.hypot(*(pixels - centre).T)
    foreign = ndtr(-border / _SPOT_PX)
    lit = np.maximum(ndtr((0.49 * pitch_px - radius) / _SPOT_PX), 0.05)
    system, common = _covariances(pixels, colours, offsets + centre, _covariance_table())
    system[np.diag_indices(count)] += _NOISE / lit**2 + _LEAKAGE * foreign**2
    inverse = np.linalg.inv(system)[:count]
    # What a pixel shares with each of the views' colours, after the matrix.
    shared = (1 + _COLOUR_SHARE * (colours[:, None, None] == np.arange(3))) @ matrix.T
    right = (common[..., None] * shared).reshape(count, -1)
    even = np.tile(inverse[:, count:] @ matrix.T, len(offsets))
    weights = np.asarray(inverse[:, :count] @ right + even, np.float32)
    return Operator(pixels, _inner_neighbours(pixels, centre), weights)


def _cells(centres: Float64) -> tuple[Index, Index]:
    """Return the Bayer cells that hold micro-images' centres, ``(lenslets, 2)``, and the centres' phases there."""
    centres = centres.reshape(-1, 2)
    cells = 2 * np.floor(centres / 2).astype(np.int32)
    x, y = ((centres - cells) * (PHASES / 2)).astype(np.int32).T
    return cells, y * PHASES + x


def _pixels_of(centre: Float64, pitch_px: float, angle_rad: float) -> tuple[Index, Float64]:
    """Return the pixels of a round micro-image, ``(P, 2)``, and how far inside its hexagon's border each lies."""
    reach = int(np.ceil(pitch_px / 2)) + 2
    y, x = np.mgrid[-reach : reach + 3, -reach : reach + 3]
    pixels = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.int32)
    turns = np.arange(6) * np.pi / 3 + angle_rad
    places = pixels - centre
    border = pitch_px / 2 - (places @ np.stack([np.cos(turns), np.sin(turns)])).max(axis=1)
    radius = np.hypot(*places.T)
    kept = np.flatnonzero(radius <= pitch_px / 2 - _RIM_PX)
    kept = kept[np.argsort(radius[kept], kind="stable")]
    return pixels[kept], border[kept]


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _inner_neighbours(pixels: Index, centre: Float64) -> Index:  # pragma: no cover
    """Return for each pixel the index of the one two px nearer to the centre, itself where there is none."""
    inner = np.arange(pixels.shape[0]).astype(np.int32)
    for k in range(pixels.shape[0]):
        dx, dy = centre[0] - pixels[k, 0], centre[1] - pixels[k, 1]
        x, y = pixels[k, 0], pixels[k, 1]
        if abs(dx) > abs(dy):
            x += 2 if dx > 0 else -2
        else:
            y += 2 if dy > 0 else -2
        for j in range(k):
            if pixels[j, 0] == x and pixels[j, 1] == y:
                inner[k] = j
    return inner


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _covariances(
    pixels: Index, colours: IntArray, targets: Float64, table: Float64
) -> tuple[Float64, Float64]:  # pragma: no cover
    """Return the kriging system without noise, ``(P + 3, P + 3)``, and what pixels and targets share, ``(P, N)``."""
    count = pixels.shape[0]
    system = np.zeros((count + 3, count + 3))
    common = np.empty((count, targets.shape[0]))
    for i in range(count):
        system[count + colours[i], i] = system[i, count + colours[i]] = 1.0
        for j in range(i + 1):
            dx, dy = pixels[i, 0] - pixels[j, 0], pixels[i, 1] - pixels[j, 1]
            found = table[int(np.sqrt(dx * dx + dy * dy) / _TABLE_STEP_PX + 0.5)]
            if colours[i] == colours[j]:
                found *= 1 + _COLOUR_SHARE
            system[i, j] = system[j, i] = found
    for i in range(count):
        for n in range(targets.shape[0]):
            dx, dy = targets[n, 0] - pixels[i, 0], targets[n, 1] - pixels[i, 1]
            common[i, n] = table[int(np.sqrt(dx * dx + dy * dy) / _TABLE_STEP_PX + 0.5)]
    return system, common


@functools.cache
def _covariance_table() -> Float64:
    """Return the covariance at multiples of ``_TABLE_STEP_PX``: the mean of the lenslets' over all slopes."""
    distances_px = np.arange(0, 40, _TABLE_STEP_PX)
    slopes = np.linspace(0, _LARGEST_SLOPE, 57)
    likely = 1 / (1 + (slopes / _USUAL_SLOPE) ** 2)
    parts = [
        p * np.interp(distances_px * slope, *lenslet_covariance()) for p, slope in zip(likely, slopes, strict=True)
    ]
    return np.asarray(sum(parts) / likely.sum(), np.float64)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _gather(
    mosaic: Float32, shading: Float32, cells: Index, pixels: Index, inner: Index, patches: Float32
) -> None:  # pragma: no cover
    """Fill ``patches`` ``(lenslets, P)``; dark pixels take what stands further in, those off the sensor its border."""
    height, width = mosaic.shape
    for k in range(cells.shape[0]):
        for p in range(pixels.shape[0]):
            x, y = cells[k, 0] + pixels[p, 0], cells[k, 1] + pixels[p, 1]
            # The nearest pixel of the same colour on the sensor.
            if x < 0 or y < 0 or x >= width or y >= height:
                x = x & 1 if x < 0 else x
                y = y & 1 if y < 0 else y
                x = width - 2 + ((x - width) & 1) if x >= width else x
                y = height - 2 + ((y - height) & 1) if y >= height else y
            if shading[y, x] < _FILL_BELOW and inner[p] != p:
                patches[k, p] = patches[k, inner[p]]
            else:
                patches[k, p] = mosaic[y, x]
