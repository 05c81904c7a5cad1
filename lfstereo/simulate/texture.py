"""Procedural colours of surfaces, evaluated at each hit point and faded where finer than what a lenslet sees."""

from __future__ import annotations

import math
from typing import Final

from lfstereo.arrays import Float64
from lfstereo.simulate.compiled import compiled
from lfstereo.simulate.primitives import (
    BOX,
    COLOURS,
    DETAIL,
    HALF,
    KIND,
    PATCH,
    PATTERN_SEED,
    SCALE,
    TEXTURE,
    local_normal,
    surface_point,
)

PLAIN: Final = 0
MOTTLED: Final = 1
MARBLE: Final = 2
BRICK: Final = 3
STRIPE: Final = 4
CHECKER: Final = 5
TERRAZZO: Final = 6
WOOD: Final = 7
GLOBE: Final = 8
PRINT: Final = 9
LANDSCAPE: Final = 10
LEAF_VEINS: Final = 11
BOOK: Final = 12
WEAVE: Final = 13
DOTS: Final = 14
BOARD: Final = 15
SPOT: Final = 16
"""One soft spot in the middle, a Gaussian whose standard deviation is the scale: a test pattern."""

Colour = tuple[float, float, float]


@compiled
def lattice_random(i: int, j: int, k: int, seed: int) -> float:
    """Return a number in [0, 1) that belongs to one lattice point."""
    h = (i * 374761393 + j * 668265263 + k * 1440662683 + seed * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 2246822519) & 0xFFFFFFFF
    return (h ^ (h >> 15)) * (1.0 / 4294967296.0)


@compiled
def value_noise(x: float, y: float, z: float, seed: int) -> float:
    """Return smooth noise in [0, 1) with unit lattice spacing."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    x, y, z = x - fx, y - fy, z - fz
    x, y, z = x * x * (3 - 2 * x), y * y * (3 - 2 * y), z * z * (3 - 2 * z)
    total = _noise_layer(i, j, k, x, y, seed)
    return total if z == 0 else total + z * (_noise_layer(i, j, k + 1, x, y, seed) - total)


@compiled
def _noise_layer(i: int, j: int, k: int, x: float, y: float, seed: int) -> float:
    a, b = lattice_random(i, j, k, seed), lattice_random(i + 1, j, k, seed)
    c, d = lattice_random(i, j + 1, k, seed), lattice_random(i + 1, j + 1, k, seed)
    near, far = a + x * (b - a), c + x * (d - c)
    return near + y * (far - near)


@compiled
def octaves(x: float, y: float, z: float, spacing: float, spot: float, seed: int, count: int = 4) -> float:
    """Return octaves of value noise about 0.5, those finer than ``spot`` (m) faded out."""
    total, strength, weights = 0.0, 1.0, 0.0
    for octave in range(count):
        shown = min(1.0, 2 * spacing / spot - 1)
        if shown > 0:
            total += strength * shown * (value_noise(x / spacing, y / spacing, z / spacing, seed + octave) - 0.5)
        weights += strength
        strength *= 0.6
        spacing *= 0.47
    return 0.5 + 1.6 * total / weights


@compiled
def _step(x: float, soft: float) -> float:
    """Return 0 below, 1 above zero, with a soft edge."""
    s = min(1.0, max(0.0, x / soft + 0.5))
    return s * s * (3 - 2 * s)


@compiled
def _mix(a: Colour, b: Colour, t: float) -> Colour:
    t = min(1.0, max(0.0, t))
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@compiled
def _times(a: Colour, s: float) -> Colour:
    return a[0] * s, a[1] * s, a[2] * s


@compiled
def _brick(
    u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float, seed: int
) -> Colour:
    tall = scene[n, SCALE]
    wide = 2.3 * tall
    line = math.floor(v / tall)
    u += 0.5 * wide * (int(line) & 1)
    column = math.floor(u / wide)
    edge = min(min(v - line * tall, (line + 1) * tall - v), min(u - column * wide, (column + 1) * wide - u))
    tone = lattice_random(int(column), int(line), 7, seed)
    stone = _times(_mix(a, b, tone), 0.82 + 0.36 * lattice_random(int(column), int(line), 8, seed))
    return _mix(c, stone, _step(edge - 0.07 * tall, max(0.04 * tall, 0.5 * spot)))


@compiled
def _terrazzo(
    u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float, seed: int
) -> Colour:
    s = scene[n, SCALE]
    i, j = math.floor(u / s), math.floor(v / s)
    colour = a
    for dj in range(-1, 2):
        for di in range(-1, 2):
            p = lattice_random(i + di, j + dj, 1, seed)
            q = lattice_random(i + di, j + dj, 2, seed)
            size = s * (0.12 + 0.38 * lattice_random(i + di, j + dj, 3, seed))
            x, y = u - (i + di + p) * s, v - (j + dj + q) * s
            if x * x + y * y > 1.7 * (size + 0.5 * spot) ** 2:
                continue
            skew = 0.6 * (lattice_random(i + di, j + dj, 4, seed) - 0.5)
            r = math.sqrt((x + skew * y) ** 2 + 1.6 * y * y)
            chip = _times(b if p + q > 1 else c, 0.7 + 0.6 * lattice_random(i + di, j + dj, 5, seed))
            colour = _mix(colour, chip, _step(size - r, max(0.1 * size, 0.5 * spot)))
    return colour


@compiled
def _print(
    u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float, seed: int
) -> Colour:
    s = scene[n, SCALE]
    if abs(u) > 0.84 * scene[n, HALF] or abs(v) > 0.88 * scene[n, HALF + 1]:
        return a
    line = math.floor(v / s)
    inside = v / s - line
    word = math.floor(u / (2.7 * s) + 3.1 * lattice_random(line, 3, 0, seed))
    gap = lattice_random(word, line, 1, seed) < 0.12
    ink = 0.0 if gap else _step(0.29 - abs(inside - 0.5), max(0.12, 0.6 * spot / s))
    letters = value_noise(u / (0.3 * s), line + 0.5, inside * 2.2, seed)
    ink *= _step(letters - 0.42, 0.25)
    heading = lattice_random(line // 9, 5, 2, seed) < 0.35 and line % 9 < 2
    return _mix(a, c if heading else b, ink)


@compiled
def _landscape(
    u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float, seed: int
) -> Colour:
    wide, tall = scene[n, HALF], scene[n, HALF + 1]
    x, y = u / wide, v / tall
    if abs(x) > 0.93 or abs(y) > 0.93 * min(1.0, wide / tall + 0.4):
        return 0.82, 0.80, 0.75
    clouds = octaves(x, 2.4 * y, 0.3, 0.55, spot / wide, seed)
    colour = _mix(a, (0.92, 0.9, 0.86), 1.6 * (clouds - 0.45) * (0.6 - y))
    sun = math.sqrt((x - 0.35) ** 2 + ((y + 0.35) * tall / wide) ** 2)
    colour = _mix((0.95, 0.75, 0.35), colour, _step(sun - 0.16, 0.05))
    for layer in range(4):
        height = (
            0.1 + 0.24 * layer - 0.55 * octaves(1.3 * x + 5.0 * layer, 0.5, 0.5, 0.7, spot / wide, seed + 11 * layer)
        )
        shade = _times(_mix(b, c, layer / 3.0), 0.75 + 0.5 * octaves(x, y, 0.5 + layer, 0.12, spot / wide, seed + 5))
        colour = _mix(colour, shade, _step(y - height, max(0.015, spot / tall)))
    return colour


@compiled
def _leaf(x: float, y: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float) -> Colour:
    s = scene[n, SCALE]
    rib = _step(0.05 * scene[n, HALF + 1] - abs(y), max(0.04 * scene[n, HALF + 1], spot))
    vein = abs((x + 0.8 * abs(y)) / s - math.floor((x + 0.8 * abs(y)) / s) - 0.5)
    soft = max(0.12, 0.7 * spot / s)
    colour = _mix(a, b, 0.5 + 0.5 * x / scene[n, HALF])
    return _mix(colour, c, max(rib, 0.6 * _step(0.1 - vein, soft)))


@compiled
def _book(x: float, y: float, z: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float) -> Colour:
    """Return a book lying flat: cover above and below, spine towards -z, pages on the other sides."""
    _, ny, nz = local_normal(scene, n, x, y, z)
    half = scene[n, HALF + 1]
    if ny != 0:
        frame = min(scene[n, HALF] - abs(x), scene[n, HALF + 2] - abs(z))
        return _mix(a, b, _step(0.35 * half - abs(frame - 0.9 * half), max(0.1 * half, 0.5 * spot)))
    if nz < 0:
        along = abs(x) / scene[n, HALF]
        band = _step(0.035 - abs(along - 0.78), 0.02) + _step(0.012 - abs(along - 0.86), 0.012)
        letters = value_noise(x / (0.22 * half), 0.5, 0.5 + y / half, 3)
        title = _step(0.55 - along, 0.02) * _step(0.34 * half - abs(y), 0.2 * half) * _step(letters - 0.45, 0.2)
        return _mix(a, b, max(band, title))
    if abs(y) > 0.86 * half:
        return a
    sheets = value_noise(0.5, y / max(0.1 * half, 0.5 * spot), (x + z) / (6 * half), 5)
    return _times(c, 0.8 + 0.35 * sheets)


@compiled
def _board(u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour) -> Colour:
    """Return the checkerboard: ``HALF`` leaves one square of margin around it."""
    s = scene[n, SCALE]
    if abs(u) > scene[n, HALF] - s or abs(v) > scene[n, HALF + 1] - s:
        return a
    column = math.floor((u + scene[n, HALF]) / s + 1e-9)
    line = math.floor((v + scene[n, HALF + 1]) / s + 1e-9)
    return b if (column + line) & 1 == 0 else a


@compiled
def _flat_pattern(
    kind: int, u: float, v: float, scene: Float64, n: int, a: Colour, b: Colour, c: Colour, spot: float, seed: int
) -> Colour:
    s = scene[n, SCALE]
    if kind == BRICK:
        return _brick(u, v, scene, n, a, b, c, spot, seed)
    if kind == TERRAZZO:
        return _terrazzo(u, v, scene, n, a, b, c, spot, seed)
    if kind == PRINT:
        return _print(u, v, scene, n, a, b, c, spot, seed)
    if kind == LANDSCAPE:
        return _landscape(u, v, scene, n, a, b, c, spot, seed)
    if kind == BOARD:
        return _board(u, v, scene, n, a, b)
    if kind == SPOT:
        return _mix(a, b, math.exp(-(u * u + v * v) / (2 * s * s)))
    if kind == CHECKER:
        i, j = math.floor(u / s), math.floor(v / s)
        edge = min(min(u - i * s, (i + 1) * s - u), min(v - j * s, (j + 1) * s - v))
        t = 0.5 + (0.5 if (int(i) + int(j)) & 1 else -0.5) * min(1.0, edge / max(0.3 * spot, 1e-6))
        return _mix(a, b, t)
    if kind == DOTS:
        line = math.floor(v / s)
        x = u / s + 0.5 * (int(line) & 1)
        r = math.sqrt((x - math.floor(x) - 0.5) ** 2 + (v / s - line - 0.5) ** 2)
        return _mix(a, b, _step(0.27 - r, max(0.05, 0.5 * spot / s)))
    if kind == WEAVE:
        p, q = math.sin(2 * math.pi * u / s), math.sin(2 * math.pi * v / s)
        fade = min(1.0, s / (2 * spot))
        return _mix(a, b, 0.5 + 0.5 * fade * (p * q + 0.4 * math.sin(0.9 * (u + v) / s)))
    across = (v + 0.1 * s * math.sin(2.2 * u / s)) / s
    place = across - math.floor(across)
    soft = max(0.04, 0.5 * spot / s)
    colour = _mix(a, b, _step(0.24 - abs(place - 0.5), soft))
    return _mix(colour, c, _step(0.035 - abs(place - 0.86), soft))


@compiled
def surface_colour(scene: Float64, n: int, x: float, y: float, z: float, spot: float) -> Colour:
    """Return the linear sRGB reflectance of a primitive at a local point seen through a spot of given size (m)."""
    kind, seed, s = int(scene[n, TEXTURE]), int(scene[n, PATTERN_SEED]), scene[n, SCALE]
    a = (scene[n, COLOURS], scene[n, COLOURS + 1], scene[n, COLOURS + 2])
    b = (scene[n, COLOURS + 3], scene[n, COLOURS + 4], scene[n, COLOURS + 5])
    c = (scene[n, COLOURS + 6], scene[n, COLOURS + 7], scene[n, COLOURS + 8])
    if kind == PLAIN:
        return a
    if int(scene[n, KIND]) == PATCH:
        z = 0.0
    if kind == MOTTLED:
        colour = _mix(a, b, 2.2 * (octaves(x, y, z, s, spot, seed) - 0.5) + 0.5)
    elif kind == MARBLE:
        warp = octaves(x, y, z, s, spot, seed)
        t = 0.5 + 0.5 * math.sin(4.0 * (x + 0.6 * y - 0.4 * z) / s + 8.0 * warp)
        colour = _mix(_mix(a, b, t), c, _step(t - 0.88, 0.2))
    elif kind == GLOBE:
        land = octaves(x, y, z, s, spot, seed)
        colour = _mix(a, _mix(b, c, 5.0 * (land - 0.56)), _step(land - 0.52, max(0.02, 0.1 * spot / s)))
        u, v = surface_point(scene, n, x, y, z)
        grid = min(abs(u / s - math.floor(u / s) - 0.5), abs(v / s - math.floor(v / s) - 0.5))
        colour = _mix(colour, (0.75, 0.72, 0.62), 0.55 * _step(0.02 - grid, 0.03 + 0.5 * spot / s))
    elif kind == WOOD:
        grain = octaves(x / 9, y, z, s, spot, seed)
        ring = y / (0.8 * s) + 0.35 * math.sin(x / (4 * s)) + 2.4 * grain
        t = ring - math.floor(ring)
        colour = _mix(a, b, t * t)
        colour = _mix(colour, c, 1.5 * (octaves(x / 14, y, z, 0.14 * s, spot, seed + 9) - 0.55))
    elif kind == LEAF_VEINS:
        colour = _leaf(x, y, scene, n, a, b, c, spot)
    elif kind == BOOK and int(scene[n, KIND]) == BOX:
        colour = _book(x, y, z, scene, n, a, b, c, spot)
    else:
        u, v = surface_point(scene, n, x, y, z)
        colour = _flat_pattern(kind, u, v, scene, n, a, b, c, spot, seed)
    detail = scene[n, DETAIL]
    if detail > 0:
        colour = _times(colour, 1 + detail * (octaves(x, y, z, 0.25 * s, spot, seed + 31, 3) - 0.5) * 2)
    return colour
