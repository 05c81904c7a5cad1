"""Rectification of one camera as the Light Field Toolbox does it, from its 5 x 5 intrinsics, for people from MATLAB."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, UInt8
from lfstereo.errors import RigError, ShapeError
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent

_EDGE = 1e-9
"""A sample this close to the border, in samples, lies on it: rounding must not blacken an outermost view."""


@dataclass(frozen=True, slots=True)
class ToolboxIntrinsics:
    """A calibration as the toolbox stores it: ``(s, t, u, v, 1) = H (i, j, k, l, 1)`` with indices counted from 1.

    ``i, k`` count columns of views and of pixels, ``j, l`` rows; ``(s, t)`` is a place in m on the plane of the
    camera, ``(u, v)`` the tangents of the direction.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), equations 6 and 13.
    """

    matrix: Float64
    """``(5, 5)``: H."""
    distortion: Float64
    """``(5,)`` k1, k2, k3, b1, b2 in the order of the toolbox's code; its manual lists b first."""

    def __post_init__(self) -> None:
        for name, expected in (("matrix", (5, 5)), ("distortion", (5,))):
            found = getattr(self, name)
            if found.shape != expected or not np.isfinite(found).all():
                raise ShapeError(
                    f"intrinsics: {name} has shape {found.shape}, expected {expected} finite numbers; give "
                    "EstCamIntrinsicsH and EstCamDistortionV of the toolbox's calibration"
                )
        if abs(np.linalg.det(self.matrix)) < 1e-30:
            raise RigError("intrinsics: the matrix has no inverse, expected one ray per sample; calibrate again")


def requested_intrinsics(measured: ToolboxIntrinsics, shape: tuple[int, int, int, int]) -> Float64:
    """Return the toolbox's default target: as measured, but with square samples and the central one on the axis.

    Parameters
    ----------
    measured
        The calibration.
    shape
        (T, S, V, U) of the light field.

    Examples
    --------
    >>> import numpy as np
    >>> h = np.diag([6e-4, 6.1e-4, 0.011, 0.0112, 1.0])
    >>> target = requested_intrinsics(ToolboxIntrinsics(h, np.zeros(5)), (15, 15, 48, 49))
    >>> float(target[0, 0]), round(float(target[2, 4]), 6)  # (6e-4 + 6.1e-4) / 2, and -0.0111 * 25
    (0.000605, -0.2775)
    """
    target = measured.matrix.copy()
    for a, b in ((0, 0), (0, 2), (2, 0), (2, 2)):
        target[a, b] = target[a + 1, b + 1] = (target[a, b] + target[a + 1, b + 1]) / 2
    t, s, v, u = shape
    centre = np.array([s + 1, t + 1, u + 1, v + 1]) / 2
    target[:4, 4] = -target[:4, :4] @ centre
    return target


def rectify_as_lftoolbox(
    light_field: LightField, measured: ToolboxIntrinsics, requested: Float64 | None = None, progress: Progress = silent
) -> LightField:
    """Resample a light field in ray space from its measured to requested intrinsics, without distortion.

    Parameters
    ----------
    light_field
        Decoded as the calibration's light fields were.
    measured
        The toolbox's calibration of the camera.
    requested
        ``(5, 5)`` H of the result; ``None`` takes :func:`requested_intrinsics`.

    Returns
    -------
    LightField
        Of the same shape, clipped to 0..1; the weight is resampled like a colour and 0 where no ray was captured.

    Raises
    ------
    ShapeError
        If the requested matrix is not 5 x 5.
    """
    t, s, v, u = light_field.views.shape[:4]
    target = requested_intrinsics(measured, (t, s, v, u)) if requested is None else requested
    full = np.broadcast_to(np.uint8(255), (t, s, v, u))
    weight = full if light_field.weight is None else light_field.weight
    views = resample_rays(light_field.views, measured, target, progress)
    np.clip(views, 0, 1, out=views)
    codes: UInt8 = np.rint(resample_rays(weight[..., None], measured, target)[..., 0]).astype(np.uint8)
    return replace(light_field, views=views, weight=codes, sampling=None)


def resample_rays(
    samples: Float32 | UInt8, measured: ToolboxIntrinsics, requested: Float64, progress: Progress = silent
) -> Float32:
    """Read a light field along the rays of other intrinsics, linearly in all four directions.

    The distorted direction of an ideal one is found, as in the toolbox, by two steps of
    ``d = b + (u - b) / (1 + k1 r^2 + k2 r^4 + k3 r^6)`` with r of the step before.

    Parameters
    ----------
    samples
        ``(T, S, V, U, C)``.
    requested
        ``(5, 5)`` intrinsics of the result.

    Returns
    -------
    ``(T, S, V, U, C)`` float32; 0 along rays that were not captured.

    Raises
    ------
    ShapeError
        If the requested matrix is not 5 x 5.
    """
    if requested.shape != (5, 5):
        raise ShapeError(
            f"requested intrinsics have shape {requested.shape}, expected (5, 5); give an H of the toolbox"
        )
    index_from_ray = np.ascontiguousarray(np.linalg.inv(measured.matrix))
    ray_from_index = np.ascontiguousarray(requested, np.float64)
    bend = np.ascontiguousarray(measured.distortion, np.float64)
    rows = samples.shape[0]
    out = np.empty(samples.shape, np.float32)

    def task(t: int) -> None:
        _resample_view_row(samples, t, ray_from_index, index_from_ray, bend, out[t])

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for done, _ in enumerate(pool.map(task, range(rows))):
            progress(done + 1, rows)
    return out


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _resample_view_row(
    samples: Float32, t: int, ray_from_index: Float64, index_from_ray: Float64, bend: Float64, out: Float32
) -> None:  # pragma: no cover
    """Fill ``out`` ``(S, V, U, C)``, the views of row ``t``."""
    s_count, v_count, u_count, channels = out.shape
    last = np.array([s_count, samples.shape[0], u_count, v_count]) - 1
    n, ray, place = np.empty(4), np.empty(4), np.empty(4)
    low, part = np.empty(4, np.int64), np.empty(4)
    for s in range(s_count):
        for v in range(v_count):
            for u in range(u_count):
                out[s, v, u] = 0.0
                n[0], n[1], n[2], n[3] = s + 1, t + 1, u + 1, v + 1
                for a in range(4):
                    ray[a] = ray_from_index[a, 4]
                    for b in range(4):
                        ray[a] += ray_from_index[a, b] * n[b]
                x, y = ray[2] - bend[3], ray[3] - bend[4]
                dx, dy = x, y
                for _ in range(2):
                    r2 = dx * dx + dy * dy
                    gain = 1 + r2 * (bend[0] + r2 * (bend[1] + r2 * bend[2]))
                    dx, dy = x / gain, y / gain
                ray[2], ray[3] = dx + bend[3], dy + bend[4]
                inside = True
                for a in range(4):
                    place[a] = index_from_ray[a, 4] - 1
                    for b in range(4):
                        place[a] += index_from_ray[a, b] * ray[b]
                    inside = inside and place[a] >= -_EDGE and place[a] <= last[a] + _EDGE
                    low[a] = max(min(int(place[a]), last[a] - 1), 0)
                    part[a] = min(max(place[a] - low[a], 0.0), 1.0)
                if not inside:
                    continue
                for c in range(channels):
                    total = 0.0
                    for corner in range(16):
                        share = 1.0
                        for a in range(4):
                            share *= part[a] if corner >> a & 1 else 1 - part[a]
                        if share > 0:
                            total += (
                                share
                                * samples[
                                    low[1] + (corner >> 1 & 1),
                                    low[0] + (corner & 1),
                                    low[3] + (corner >> 3 & 1),
                                    low[2] + (corner >> 2 & 1),
                                    c,
                                ]
                            )
                    out[s, v, u, c] = total
