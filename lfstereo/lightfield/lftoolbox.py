"""The decode of the Light Field Toolbox for MATLAB, number for number."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, Mosaic, UInt8, Views
from lfstereo.container.capture import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.develop.demosaic import malvar2004
from lfstereo.errors import AssetError
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.progress import Progress, silent

_LEVELS = np.float32(65535)
_ROWS_PER_TASK = 8
_COLUMN_STEP = np.sqrt(3) / 2


@dataclass(frozen=True, slots=True)
class AlignedLattice:
    """The lenslet lattice after the turn and the stretch that put all its centres on whole pixels.

    A raw pixel ``(x, y)``, counted from 1, lies at ``scale * R(-rotation) (x, y) + shift`` in the aligned frame.
    """

    scale: tuple[float, float]
    """Aligned px per raw px in x and y."""
    shift: tuple[float, float]
    """Aligned px in x and y; rounds the first centre to a whole pixel."""
    rotation_rad: float
    first: tuple[float, float]
    """Aligned (x, y) of the lenslet in column 0, row 0 without its row's half-pitch shift."""
    spacing: tuple[int, int]
    """Aligned px between lenslets of a row, and between rows; both even."""

    @classmethod
    def of(cls, grid: LensletGrid) -> AlignedLattice:
        """Return the aligned lattice of a grid; a shear, which the toolbox does not know, is left out.

        References
        ----------
        Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), LFDecodeLensletImageDirect.
        """
        step_u, step_v = np.asarray(grid.step_u_px), np.asarray(grid.step_v_px)
        pitch = float(np.hypot(*step_u))
        along = step_u / pitch
        across = np.array([-along[1], along[0]])
        distance = float(step_v @ across)
        # Leaving the shear out about the middle row keeps every centre as near as can be to where it was.
        origin = np.asarray(grid.origin_px) + (grid.rows - 1) / 2 * float(step_v @ along) * along
        spacing = _next_even(pitch), _next_even(distance)
        scale = np.array([spacing[0] / pitch, spacing[1] / distance])
        offset = (origin + 1.0) * scale
        first = np.floor(offset + 0.5)
        shift = first - offset
        return cls(
            scale=(float(scale[0]), float(scale[1])),
            shift=(float(shift[0]), float(shift[1])),
            rotation_rad=float(np.arctan2(along[1], along[0])),
            first=(float(first[0]), float(first[1])),
            spacing=spacing,
        )

    @property
    def reach(self) -> int:
        """Aligned px from a micro-image's centre to the outermost sample."""
        return max(self.spacing) // 2

    @property
    def to_raw(self) -> Float64:
        """``(2, 3)``: maps aligned ``(x, y, 1)`` to raw px counted from 0."""
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        turn = np.array([[cos, -sin], [sin, cos]]) / np.asarray(self.scale)
        return np.column_stack([turn, -turn @ np.asarray(self.shift) - 1.0])

    def sampling(self) -> ViewSampling:
        """Return where the view pixels lie on the sensor."""
        matrix = self.to_raw
        origin = matrix @ [*self.first, 1.0]
        return ViewSampling(
            origin_px=(float(origin[0]), float(origin[1])),
            step_px=(self.spacing[0] / self.scale[0] * float(_COLUMN_STEP), self.spacing[1] / self.scale[1]),
            rotation_rad=self.rotation_rad,
            view_step_px=1.0 / max(self.scale),
        )


def decode_as_lftoolbox(capture: Capture, white: Capture, grid: LensletGrid, progress: Progress = silent) -> LightField:
    """Decode a capture as the Light Field Toolbox v0.5.3 does by default, with a known grid.

    Its values differ from those of :func:`lfstereo.lightfield.decode` on purpose: they are those of MATLAB's users.
    Camera colours as the white image balances them, without a colour matrix; clipped to 0..1 after devignetting;
    read by linear interpolation on a turned and stretched frame, then along rows of lenslets, then along the view
    columns.

    Parameters
    ----------
    capture
        The photograph.
    white
        Its white image.
    grid
        Its lenslet grid.
    progress
        Told of the work done, in hundredths.

    Returns
    -------
    For an Illum ``(15, 15, 434, 625, 3)``, values of 16 bits between 0 and 1; the weight is the white image's
    share of its brightest sample and keeps its Bayer pattern.

    Raises
    ------
    AssetError
        If the white image has another size.
    """
    views, weight = sample_as_lftoolbox(capture, white, grid, progress)
    codes: UInt8 = np.empty(weight.shape, np.uint8)
    for t in range(weight.shape[0]):
        codes[t] = np.rint(weight[t] * np.float32(255)).astype(np.uint8)
    return LightField(
        views=views,
        weight=codes,
        sampling=AlignedLattice.of(grid).sampling(),
        serial=capture.metadata.serial,
        source=capture.source,
        zoom_step=capture.metadata.lens.zoom_step,
        focus_step=capture.metadata.lens.focus_step,
    )


def sample_as_lftoolbox(
    capture: Capture, white: Capture, grid: LensletGrid, progress: Progress = silent
) -> tuple[Views, Float32]:
    """Return the toolbox's views ``(T, S, V, U, 3)`` and weights ``(T, S, V, U)``, float32 multiples of 1/65535.

    Raises
    ------
    AssetError
        If the white image has another size.
    """
    rgb, light = _develop(capture, white)
    progress(30, 100)
    lattice = AlignedLattice.of(grid)
    count = 2 * lattice.reach - 1
    columns = int(np.ceil(grid.columns / _COLUMN_STEP))
    views = np.empty((count, count, grid.rows, columns, 3), np.float32)
    weight = np.empty((count, count, grid.rows, columns), np.float32)
    ratio = lattice.scale[0] / lattice.scale[1]
    starts = list(range(0, grid.rows, _ROWS_PER_TASK))

    def task(start: int) -> float:
        stop = min(start + _ROWS_PER_TASK, grid.rows)
        place = np.array(lattice.first), np.array(lattice.spacing, np.float64), lattice.to_raw
        shifted, lenslets = grid.first_shifted_row, grid.columns
        return float(
            _sample_rows(rgb, light, *place, lattice.reach, ratio, shifted, lenslets, start, stop, views, weight)
        )

    brightest = 0.0
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for done, found in enumerate(pool.map(task, starts)):
            brightest = max(brightest, found)
            progress(30 + 70 * (done + 1) // len(starts), 100)
    for row in weight:
        row *= np.float32(1 / max(brightest, 1e-6))
        np.clip(row, 0, 1, out=row)
        _quantise(row)
    return views, weight


def _develop(capture: Capture, white: Capture) -> tuple[Float32, Float32]:
    """Return ``(H, W, 3)`` RGB in multiples of 1/65535, and the white image ``(H, W)`` with its levels at 0 and 1."""
    if capture.mosaic.shape != white.mosaic.shape:
        found, wanted = white.mosaic.shape, capture.mosaic.shape
        raise AssetError(
            f"{white.source}: found a white image of {found[1]} x {found[0]} px, expected {wanted[1]} x {wanted[0]} "
            f"as {capture.source}; give the white image of the same camera"
        )
    light = _between_levels(white.mosaic, capture.metadata)
    mosaic = _between_levels(capture.mosaic, capture.metadata)
    with np.errstate(divide="ignore", invalid="ignore"):
        mosaic /= light
    np.fmax(mosaic, np.float32(0), out=mosaic)
    np.fmin(mosaic, np.float32(1), out=mosaic)
    mosaic *= _LEVELS
    mosaic += np.float32(0.5)
    rgb = malvar2004(np.floor(mosaic, out=mosaic), capture.metadata.bayer)
    del mosaic
    for part in np.array_split(rgb, 16):
        part += np.float32(0.5)
        np.floor(part, out=part)
        np.clip(part, 0, _LEVELS, out=part)
        part *= np.float32(1) / _LEVELS
    return rgb, light


def _between_levels(mosaic: Mosaic, metadata: FrameMetadata) -> Float32:
    """Put the photograph's black and white level of one green site at 0 and 1, for all sites, as the toolbox does."""
    black, white = metadata.black[1], metadata.white[1]
    scaled: Float32 = mosaic.astype(np.float32)
    scaled -= np.float32(black)
    scaled /= np.float32(white - black)
    return scaled


def _quantise(values: Float32) -> None:
    values *= _LEVELS
    values += np.float32(0.5)
    np.floor(values, out=values)
    values /= _LEVELS


def _next_even(length: float) -> int:
    """Round up to a whole number, and that to an even one."""
    return 2 * int(np.ceil(np.ceil(length) / 2))


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _sample_row(
    rgb: Float32, light: Float32, first: Float64, spacing: Float64, to_raw: Float64, ratio: float, out: Float32
) -> None:  # pragma: no cover
    """Fill ``out`` ``(N, N, lenslets, 4)`` from the micro-images of one row, linearly; 0 outside them and the frame.

    ``first`` is the aligned position of the row's first lenslet, ``ratio`` the aligned scale in x over that in y.
    """
    height, width = light.shape
    reach = out.shape[0] // 2
    for t in range(out.shape[0]):
        for s in range(out.shape[1]):
            dy, dx = t - reach, s - reach
            if np.sqrt(dx * dx + (dy * ratio) ** 2) >= reach:
                out[t, s] = np.float32(0.0)
                continue
            ay = first[1] + dy
            for k in range(out.shape[2]):
                ax = first[0] + k * spacing[0] + dx
                x = to_raw[0, 0] * ax + to_raw[0, 1] * ay + to_raw[0, 2]
                y = to_raw[1, 0] * ax + to_raw[1, 1] * ay + to_raw[1, 2]
                if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
                    out[t, s, k] = np.float32(0.0)
                    continue
                left, top = min(int(x), width - 2), min(int(y), height - 2)
                fx, fy = x - left, y - top
                a, b = np.float32((1 - fx) * (1 - fy)), np.float32(fx * (1 - fy))
                c, d = np.float32((1 - fx) * fy), np.float32(fx * fy)
                for n in range(3):
                    out[t, s, k, n] = (
                        a * rgb[top, left, n]
                        + b * rgb[top, left + 1, n]
                        + c * rgb[top + 1, left, n]
                        + d * rgb[top + 1, left + 1, n]
                    )
                out[t, s, k, 3] = (
                    a * light[top, left]
                    + b * light[top, left + 1]
                    + c * light[top + 1, left]
                    + d * light[top + 1, left + 1]
                )


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _sample_rows(
    rgb: Float32,
    light: Float32,
    first: Float64,
    spacing: Float64,
    to_raw: Float64,
    reach: int,
    ratio: float,
    first_shifted_row: int,
    lenslets: int,
    start: int,
    stop: int,
    views: Views,
    weight: Float32,
) -> float:  # pragma: no cover
    """Fill view rows ``start`` to ``stop`` and return their brightest weight before it is divided by the maximum."""
    size, columns = 2 * reach + 1, views.shape[3]
    row = np.empty((size, size, lenslets, 4), np.float32)
    square = np.zeros((size, size, columns, 4), np.float32)
    levels, half = np.float32(65535), np.float32(0.5)
    brightest = np.float32(0.0)
    for v in range(start, stop):
        shift = 0.5 if (v + first_shifted_row) % 2 == 0 else 0.0
        place = np.array([first[0] + shift * spacing[0], first[1] + v * spacing[1]])
        _sample_row(rgb, light, place, spacing, to_raw, ratio, row)
        square[:] = np.float32(0.0)
        for u in range(columns):
            position = u * np.sqrt(3) / 2 - shift
            if position < 0.0 or position > lenslets - 1:
                continue
            k = min(int(position), max(lenslets - 2, 0))
            next_k = min(k + 1, lenslets - 1)
            f = np.float32(position - k)
            for t in range(size):
                for s in range(size):
                    for n in range(4):
                        square[t, s, u, n] = (1 - f) * row[t, s, k, n] + f * row[t, s, next_k, n]
                    brightest = max(brightest, square[t, s, u, 3])
        # The finer of the two view axes sets the step of both; the other is read between its samples.
        step_t, step_s = min(1.0, 1.0 / ratio), min(1.0, ratio)
        for t in range(1, size - 1):
            at_t = (t - reach) * step_t + reach
            low_t = min(int(at_t), size - 2)
            ft = np.float32(at_t - low_t)
            for s in range(1, size - 1):
                at_s = (s - reach) * step_s + reach
                low_s = min(int(at_s), size - 2)
                fs = np.float32(at_s - low_s)
                for u in range(columns):
                    for n in range(4):
                        near = (1 - fs) * square[low_t, low_s, u, n] + fs * square[low_t, low_s + 1, u, n]
                        far = (1 - fs) * square[low_t + 1, low_s, u, n] + fs * square[low_t + 1, low_s + 1, u, n]
                        value = (1 - ft) * near + ft * far
                        if n < 3:
                            views[t - 1, s - 1, v, u, n] = np.floor(value * levels + half) / levels
                        else:
                            weight[t - 1, s - 1, v, u] = value
    return float(brightest)
