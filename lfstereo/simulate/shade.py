"""What a ray sees: the nearest primitive and the light that leaves it."""

from __future__ import annotations

import math
from typing import Final

import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64
from lfstereo.simulate.compiled import compiled, compiled_parallel
from lfstereo.simulate.primitives import (
    AXES,
    CENTRE,
    FAR_AWAY,
    HALF,
    LIGHT_MAP,
    hit,
    local_normal,
)
from lfstereo.simulate.texture import Colour, surface_colour

Candidates = npt.NDArray[np.int64]

TOWARDS_LIGHT: Final = 0
KEY: Final = 3
AMBIENT: Final = 6
FLOOR: Final = 9
"""Plane ``n . X = d`` (four numbers) near which things grow darker."""
CONTACT: Final = 13
"""Height over the floor up to which they do, m; 0 turns it off."""
LIGHT_SLOTS: Final = 14


@compiled
def nearest(
    scene: Float64,
    among: Candidates,
    entry: Float64,
    count: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[int, float]:
    """Return the first primitive among the candidates that a ray meets (-1: none) and the ray parameter.

    ``entry`` gives a ray parameter before which each candidate is not met, in rising order.
    """
    best, which = FAR_AWAY, -1
    for k in range(count):
        if entry[k] > best:
            break
        t = hit(scene, among[k], ox, oy, oz, dx, dy, dz)
        if 1e-6 < t < best:
            best, which = t, among[k]
    return which, best


@compiled
def candidates(
    scene: Float64,
    extents: Float64,
    dx: float,
    dy: float,
    waist: float,
    widen: float,
    grain: float,
    among: Candidates,
    entry: Float64,
) -> int:
    """Collect the primitives that a bundle of rays around one ray can meet, by rising depth of their near side.

    The ray is ``s (dx, dy, 1)`` in camera axes; at depth s the bundle has the radius
    ``|widen (s/waist - 1)| + grain s``.
    """
    count = 0
    for n in range(scene.shape[0]):
        pz, ez = scene[n, CENTRE + 2], extents[n, 2]
        first, last = pz - ez, pz + ez
        spread = max(abs(widen * (first / waist - 1)), abs(widen * (last / waist - 1))) + grain * last
        if abs(scene[n, CENTRE] - pz * dx) > extents[n, 0] + abs(dx) * ez + spread:
            continue
        if last <= 0 or abs(scene[n, CENTRE + 1] - pz * dy) > extents[n, 1] + abs(dy) * ez + spread:
            continue
        place = count
        while place > 0 and entry[place - 1] > first:
            entry[place], among[place] = entry[place - 1], among[place - 1]
            place -= 1
        entry[place], among[place] = first, n
        count += 1
    return count


@compiled
def _baked(light_maps: Float32, index: int, x: float, y: float, scene: Float64, n: int) -> float:
    """Read a shadow map bilinearly at a local point of its patch."""
    size = light_maps.shape[1]
    u = min(max((x / scene[n, HALF] + 1) * 0.5 * (size - 1), 0.0), size - 1.001)
    v = min(max((y / scene[n, HALF + 1] + 1) * 0.5 * (size - 1), 0.0), size - 1.001)
    i, j = int(u), int(v)
    a, b = u - i, v - j
    top = (1 - a) * light_maps[index, j, i] + a * light_maps[index, j, i + 1]
    return float((1 - b) * top + b * ((1 - a) * light_maps[index, j + 1, i] + a * light_maps[index, j + 1, i + 1]))


@compiled
def shade(
    scene: Float64,
    light: Float64,
    light_maps: Float32,
    n: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    spot: float,
) -> Colour:
    """Return the linear sRGB radiance that leaves a surface point, Lambertian, 1 = fully lit white."""
    px, py, pz = x - scene[n, CENTRE], y - scene[n, CENTRE + 1], z - scene[n, CENTRE + 2]
    lx = scene[n, AXES] * px + scene[n, AXES + 1] * py + scene[n, AXES + 2] * pz
    ly = scene[n, AXES + 3] * px + scene[n, AXES + 4] * py + scene[n, AXES + 5] * pz
    lz = scene[n, AXES + 6] * px + scene[n, AXES + 7] * py + scene[n, AXES + 8] * pz
    r, g, b = surface_colour(scene, n, lx, ly, lz, spot)
    mx, my, mz = local_normal(scene, n, lx, ly, lz)
    nx = scene[n, AXES] * mx + scene[n, AXES + 3] * my + scene[n, AXES + 6] * mz
    ny = scene[n, AXES + 1] * mx + scene[n, AXES + 4] * my + scene[n, AXES + 7] * mz
    nz = scene[n, AXES + 2] * mx + scene[n, AXES + 5] * my + scene[n, AXES + 8] * mz
    towards = nx * light[0] + ny * light[1] + nz * light[2]
    if nx * dx + ny * dy + nz * dz > 0:
        towards = -towards
    key = max(0.0, (towards + 0.2) / 1.2)
    ambient = 1.0
    index = int(scene[n, LIGHT_MAP])
    if index >= 0:
        shadow = _baked(light_maps, index, lx, ly, scene, n)
        key *= shadow
        ambient = 0.45 + 0.55 * shadow
    elif light[CONTACT] > 0:
        height = light[FLOOR] * x + light[FLOOR + 1] * y + light[FLOOR + 2] * z - light[FLOOR + 3]
        ambient = 0.5 + 0.5 * min(1.0, max(0.0, height / light[CONTACT]))
        key *= 0.7 + 0.3 * ambient
    return (
        r * (key * light[KEY] + ambient * light[AMBIENT]),
        g * (key * light[KEY + 1] + ambient * light[AMBIENT + 1]),
        b * (key * light[KEY + 2] + ambient * light[AMBIENT + 2]),
    )


@compiled_parallel
def bake(scene: Float64, light: Float64, which: int, size: int, rays: int, spread: float) -> Float32:
    """Return the shadow map of a flat patch: the share of a soft light above that each place sees, ``(size, size)``."""
    n = which
    half_x, half_y = scene[n, HALF], scene[n, HALF + 1]
    seen = np.empty((size, size), np.float32)
    others = np.array([n for k in range(scene.shape[0]) if k != which and int(scene[k, LIGHT_MAP]) < 0])
    whenever = np.zeros(len(others))
    for j in numba.prange(size):
        for i in range(size):
            lx, ly = (2.0 * i / (size - 1) - 1) * half_x, (2.0 * j / (size - 1) - 1) * half_y
            x = scene[n, CENTRE] + scene[n, AXES] * lx + scene[n, AXES + 3] * ly
            y = scene[n, CENTRE + 1] + scene[n, AXES + 1] * lx + scene[n, AXES + 4] * ly
            z = scene[n, CENTRE + 2] + scene[n, AXES + 2] * lx + scene[n, AXES + 5] * ly
            free = 0
            for k in range(rays):
                # Points of a sphere of directions about the light, spaced by the golden ratio.
                height = 1 - 2 * (k + 0.5) / rays
                angle = 2.399963 * k
                across = math.sqrt(1 - height * height)
                dx = light[0] + spread * across * math.cos(angle)
                dy = light[1] + spread * across * math.sin(angle)
                dz = light[2] + spread * height
                found, _ = nearest(scene, others, whenever, len(others), x, y, z, dx, dy, dz)
                free += found < 0
            seen[j, i] = free / rays
    return seen
