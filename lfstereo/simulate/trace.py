"""Trace the light that reaches every pixel of a light-field camera.

For a pixel the nearest micro-image centre tells its lenslet at ``m`` on the array and the offset inside the
micro-image its pupil point ``p``. Lenslets are focused on the pupil, so the pixel's light passes ``p`` and the area of
the lenslet; the main lens sends the ray that reaches ``x_m`` through the point ``x_m Z_f / D`` of the plane of focus
(undistorted first where the lens distorts).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.progress import Progress, silent
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.compiled import compiled, compiled_parallel
from lfstereo.simulate.scene import Scene
from lfstereo.simulate.shade import candidates, nearest, shade
from lfstereo.simulate.texture import lattice_random

_BLUR_PX = 0.45
"""Standard deviation of the spot on the sensor: the pixel's own width (0.29 px) and diffraction at f/2."""
_WIDTH_PX = _BLUR_PX * math.sqrt(12.0)
"""Width of a box with that standard deviation, over which rays are spread."""
_DARK = 1e-4
"""Pixels darker than this share of the brightest are not traced: no light reaches them."""
_ROWS_AT_ONCE = 64
_SIXTH = math.sqrt(3.0) / 6


def trace_light(
    camera: SimulatedCamera, scene: Scene, filters: Float64, samples: int, progress: Progress = silent
) -> Float32:
    """Return the light that each pixel receives through its colour filter, without noise.

    Parameters
    ----------
    camera
        The camera; its axes are those of ``scene``.
    scene
        What lies in front, in camera axes.
    filters
        ``(2, 2, 3)`` response of the four Bayer sites (row, column) to linear sRGB.
    samples
        Rays per pixel, spread over the pixel and the lenslet.

    Returns
    -------
    Float32
        ``(H, W)`` in the upright mosaic's px, >= 0; a fully lit white seen on the axis gives the sum of the
        site's filter.
    """
    width, height = camera.sensor_px
    light = np.zeros((height, width), np.float32)
    for start in range(0, height, _ROWS_AT_ONCE):
        rows = light[start : start + _ROWS_AT_ONCE]
        _trace_rows(
            rows,
            start,
            filters,
            camera.optics(),
            camera.lattice(),
            scene.primitives,
            scene.extents,
            scene.light,
            scene.light_maps,
            samples,
        )
        progress(min(start + _ROWS_AT_ONCE, height), height)
    return light


def vignetting(camera: SimulatedCamera) -> Float32:
    """Return the share of light of each pixel, ``(H, W)``, 1 = on the axis: what a white scene shows.

    Two circles bound the pupil (aperture and front rim), edges soft by the width of the spot, times cos^4.

    References
    ----------
    Aggarwal, Hua and Ahuja, "On cosine-fourth and vignetting effects in real lenses" (2001).
    """
    width, height = camera.sensor_px
    share = np.empty((height, width), np.float32)
    _vignetting_rows(share, camera.optics(), camera.lattice())
    return share


@compiled
def _lenslet_of(x: float, y: float, lattice: Float64) -> tuple[float, float]:
    """Return the (x, y) px of the micro-image centre nearest to a pixel."""
    ax, ay, bx, by = lattice[1, 0], lattice[1, 1], lattice[2, 0], lattice[2, 1]
    px, py = x - lattice[0, 0], y - lattice[0, 1]
    scale = 1 / (ax * by - ay * bx)
    u, v = (px * by - py * bx) * scale, (ax * py - ay * px) * scale
    best, cx, cy = 1e30, 0.0, 0.0
    line = math.floor(v)
    for k in range(2):
        row = line + k
        shift = 0.5 * (int(row) & 1)
        place = math.floor(u - shift + 0.5) + shift
        qx, qy = place * ax + row * bx, place * ay + row * by
        distance = (px - qx) ** 2 + (py - qy) ** 2
        if distance < best:
            best, cx, cy = distance, qx + lattice[0, 0], qy + lattice[0, 1]
    return cx, cy


@compiled
def _covered(distance_px: float) -> float:
    """Return the share of the spot on the bright side of an edge."""
    if distance_px > 4 * _BLUR_PX:
        return 1.0
    if distance_px < -4 * _BLUR_PX:
        return 0.0
    return 0.5 * (1 + math.erf(distance_px / (_BLUR_PX * math.sqrt(2.0))))


@compiled
def _share(px: float, py: float, mx: float, my: float, optics: Float64) -> float:
    """Return the light of pupil point ``p`` at lenslet ``m``, as a share of the axis."""
    distance, focus, per_px, aperture = optics[3], optics[4], optics[5], optics[6]
    share = _covered((aperture - math.sqrt(px * px + py * py)) / per_px)
    if share == 0.0:
        return 0.0
    at_rim = optics[7]
    rx = px * (1 - at_rim / focus) + mx * at_rim / distance
    ry = py * (1 - at_rim / focus) + my * at_rim / distance
    share *= _covered((optics[8] - math.sqrt(rx * rx + ry * ry)) / per_px)
    # On the sensor side the ray runs from p to the lenslet, which lies at -m before the picture is turned upright.
    sx, sy = px + mx, py + my
    cos2 = distance * distance / (distance * distance + sx * sx + sy * sy)
    return float(share * cos2 * cos2)


@compiled_parallel
def _vignetting_rows(share: Float32, optics: Float64, lattice: Float64) -> None:
    for y in numba.prange(share.shape[0]):
        for x in range(share.shape[1]):
            cx, cy = _lenslet_of(x, y, lattice)
            mx, my = (cx - optics[0]) * optics[2], (cy - optics[1]) * optics[2]
            share[y, x] = _share((x - cx) * optics[5], (y - cy) * optics[5], mx, my, optics)


@compiled
def _undistorted(x: float, y: float, k1: float) -> float:
    """Return by what to multiply a distorted direction (tangents) to get the ideal one."""
    bent, gain = x * x + y * y, 1.0
    for _ in range(8):
        gain = 1 / (1 + k1 * bent * gain * gain)
    return gain


@compiled
def _wrapped(u: float) -> float:
    return u - math.floor(u)


@compiled
def _in_lenslet(third: int, u: float, v: float, pitch: float) -> tuple[float, float]:
    """Return a point in a third of a hexagon of the given width, its neighbours along x, from two uniform numbers."""
    # Three rhombi between corners at 30, 150 and 270 degrees fill the hexagon.
    if third == 0:
        return pitch * 0.5 * (u - v), pitch * _SIXTH * (u + v)
    if third == 1:
        return pitch * -0.5 * u, pitch * _SIXTH * (u - 2 * v)
    return pitch * 0.5 * v, pitch * _SIXTH * (v - 2 * u)


@compiled_parallel
def _trace_rows(
    light_out: Float32,
    start: int,
    filters: Float64,
    optics: Float64,
    lattice: Float64,
    scene: Float64,
    extents: Float64,
    light: Float64,
    light_maps: Float32,
    samples: int,
) -> None:
    distance, focus, per_px, aperture, pitch = optics[3], optics[4], optics[5], optics[6], optics[9]
    for n in numba.prange(light_out.shape[0]):
        y = start + n
        among, entry = np.empty(scene.shape[0], np.int64), np.empty(scene.shape[0])
        count, last_x, last_y = 0, 1e30, 1e30
        ux, uy = 0.0, 0.0
        for x in range(light_out.shape[1]):
            cx, cy = _lenslet_of(x, y, lattice)
            mx, my = (cx - optics[0]) * optics[2], (cy - optics[1]) * optics[2]
            share = _share((x - cx) * per_px, (y - cy) * per_px, mx, my, optics)
            if share < _DARK:
                continue
            if cx != last_x or cy != last_y:
                ux, uy = mx / distance, my / distance
                if optics[10] != 0:
                    gain = _undistorted(ux, uy, optics[10])
                    ux, uy = gain * ux, gain * uy
                count = candidates(scene, extents, ux, uy, focus, aperture, pitch / distance, among, entry)
                last_x, last_y = cx, cy
            red, green, blue = 0.0, 0.0, 0.0
            h0, h1 = lattice_random(x, y, 0, 77), lattice_random(x, y, 1, 77)
            h2, h3 = lattice_random(x, y, 2, 77), lattice_random(x, y, 3, 77)
            for k in range(samples):
                # Low-discrepancy sequences over pixel and lenslet (Roberts 2018), shifted by a hash of the pixel.
                u0, u1 = _wrapped(h0 + 0.8566749 * k), _wrapped(h1 + 0.7338918 * k)
                u2, u3 = _wrapped(h2 + 0.7548776662 * k), _wrapped(h3 + 0.5698402910 * k)
                px, py = (x + _WIDTH_PX * (u0 - 0.5) - cx) * per_px, (y + _WIDTH_PX * (u1 - 0.5) - cy) * per_px
                beyond = (px * px + py * py) / (aperture * aperture)
                if beyond > 1:
                    px, py = px / math.sqrt(beyond), py / math.sqrt(beyond)
                qx, qy = _in_lenslet((k + x + y) % 3, u2, u3, pitch)
                fx, fy = (ux + qx / distance) * focus, (uy + qy / distance) * focus
                dx, dy = (fx - px) / focus, (fy - py) / focus
                which, t = nearest(scene, among, entry, count, px, py, 0.0, dx, dy, 1.0)
                if which < 0:
                    continue
                r, g, b = shade(
                    scene, light, light_maps, which, px + t * dx, py + t * dy, t, dx, dy, 1.0, pitch * t / distance
                )
                red, green, blue = red + r, green + g, blue + b
            site = filters[y & 1, x & 1]
            value = site[0] * red + site[1] * green + site[2] * blue
            light_out[n, x] = share * max(0.0, value) / samples
