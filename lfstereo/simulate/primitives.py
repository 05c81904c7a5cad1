"""Rays against the primitives of a scene: patches, boxes, ellipsoids, cylinders.

A primitive is one row of numbers (``SLOTS`` columns, see the constants) so that compiled code can walk a scene.
Each has local axes; a local point is ``R (X - centre)``. Patches are ``z = (kx x^2 + ky y^2) / 2`` within an
outline, cylinders run along local y and may taper.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.simulate.compiled import compiled

KIND: Final = 0
CENTRE: Final = 1
AXES: Final = 4
"""Nine numbers: rows of the local-from-camera rotation."""
HALF: Final = 13
"""Half extents along the local axes; cylinder: radius at mid-height, half height, unused."""
CURVE: Final = 16
"""Patch: curvatures kx, ky in 1/m. Cylinder: growth of the radius per metre along y, 1 = open ends."""
OUTLINE: Final = 18
TEXTURE: Final = 19
SCALE: Final = 20
COLOURS: Final = 21
"""Three linear sRGB colours."""
DETAIL: Final = 30
"""Strength of the fine mottling on top of the pattern."""
LIGHT_MAP: Final = 31
"""Index of the baked shadow map, or -1."""
PATTERN_SEED: Final = 32
SLOTS: Final = 33

PATCH: Final = 0
BOX: Final = 1
ELLIPSOID: Final = 2
CYLINDER: Final = 3

RECTANGLE: Final = 0
DISC: Final = 1
LEAF: Final = 2
LATTICE: Final = 3
RING: Final = 4

FAR_AWAY: Final = 1e9
"""Ray parameter that says: no hit."""


@compiled
def _inside(scene: Float64, n: int, x: float, y: float) -> bool:
    a, b = scene[n, HALF], scene[n, HALF + 1]
    if abs(x) > a or abs(y) > b:
        return False
    outline = int(scene[n, OUTLINE])
    if outline == RECTANGLE:
        return True
    if outline == LEAF:
        return bool(abs(y) < b * (1.0 - (x / a) * (x / a)) * (1.0 - 0.25 * x / a))
    if outline == LATTICE:
        cell, bar = scene[n, HALF + 2], 0.2
        u = abs((x + a) / cell - math.floor((x + a) / cell) - 0.5)
        v = abs((y + b) / cell - math.floor((y + b) / cell) - 0.5)
        return bool(u > 0.5 - 0.5 * bar or v > 0.5 - 0.5 * bar)
    q = (x / a) * (x / a) + (y / b) * (y / b)
    return bool(q <= 1.0 and (outline != RING or q > 0.5))


@compiled
def _hit_patch(scene: Float64, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    kx, ky = scene[n, CURVE], scene[n, CURVE + 1]
    a = 0.5 * (kx * dx * dx + ky * dy * dy)
    b = kx * ox * dx + ky * oy * dy - dz
    c = 0.5 * (kx * ox * ox + ky * oy * oy) - oz
    if abs(a) < 1e-9:
        t = -c / b if abs(b) > 1e-12 else -1.0
        return t if t > 0 and _inside(scene, n, ox + t * dx, oy + t * dy) else FAR_AWAY
    root = b * b - 4 * a * c
    if root < 0:
        return FAR_AWAY
    q = -0.5 * (b + math.sqrt(root)) if b > 0 else -0.5 * (b - math.sqrt(root))
    best = FAR_AWAY
    t = q / a
    if t > 0 and _inside(scene, n, ox + t * dx, oy + t * dy):
        best = t
    if abs(q) > 1e-15:
        t = c / q
        if 0 < t < best and _inside(scene, n, ox + t * dx, oy + t * dy):
            best = t
    return best


@compiled
def _hit_box(scene: Float64, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    first, last = 0.0, FAR_AWAY
    for axis in range(3):
        o = ox if axis == 0 else (oy if axis == 1 else oz)
        d = dx if axis == 0 else (dy if axis == 1 else dz)
        if abs(d) < 1e-12:
            if abs(o) > scene[n, HALF + axis]:
                return FAR_AWAY
            continue
        near, far = (-scene[n, HALF + axis] - o) / d, (scene[n, HALF + axis] - o) / d
        if near > far:
            near, far = far, near
        first, last = max(first, near), min(last, far)
        if first > last:
            return FAR_AWAY
    return first if first > 0 else FAR_AWAY


@compiled
def _hit_ellipsoid(scene: Float64, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    ia, ib, ic = 1 / scene[n, HALF], 1 / scene[n, HALF + 1], 1 / scene[n, HALF + 2]
    ox, oy, oz, dx, dy, dz = ox * ia, oy * ib, oz * ic, dx * ia, dy * ib, dz * ic
    a = dx * dx + dy * dy + dz * dz
    b = ox * dx + oy * dy + oz * dz
    root = b * b - a * (ox * ox + oy * oy + oz * oz - 1)
    if root < 0:
        return FAR_AWAY
    t = (-b - math.sqrt(root)) / a
    return t if t > 0 else FAR_AWAY


@compiled
def _hit_cylinder(scene: Float64, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    radius, half, taper, hollow = scene[n, HALF], scene[n, HALF + 1], scene[n, CURVE], scene[n, CURVE + 1] > 0.5
    r, dr = radius + taper * oy, taper * dy
    a = dx * dx + dz * dz - dr * dr
    b = ox * dx + oz * dz - r * dr
    c = ox * ox + oz * oz - r * r
    best = FAR_AWAY
    root = b * b - a * c
    if root >= 0 and abs(a) > 1e-12:
        root = math.sqrt(root)
        for sign in (-1.0, 1.0):
            t = (-b + sign * root) / a
            if 0 < t < best and abs(oy + t * dy) <= half and r + t * dr >= 0 and (sign < 0 or hollow):
                best = t
    if abs(dy) > 1e-12:
        for end in (-half, half):
            if hollow and end < 0:
                continue
            t = (end - oy) / dy
            x, z, limit = ox + t * dx, oz + t * dz, radius + taper * end
            if 0 < t < best and x * x + z * z <= limit * limit:
                best = t
    return best


@compiled
def hit(scene: Float64, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    """Return the ray parameter of the first hit of one primitive, or ``FAR_AWAY``."""
    px, py, pz = ox - scene[n, CENTRE], oy - scene[n, CENTRE + 1], oz - scene[n, CENTRE + 2]
    kind = int(scene[n, KIND])
    if kind == PATCH and scene[n, CURVE] == 0 and scene[n, CURVE + 1] == 0:
        lz = scene[n, AXES + 6] * px + scene[n, AXES + 7] * py + scene[n, AXES + 8] * pz
        ez = scene[n, AXES + 6] * dx + scene[n, AXES + 7] * dy + scene[n, AXES + 8] * dz
        t = -lz / ez if abs(ez) > 1e-12 else -1.0
        if t <= 0:
            return FAR_AWAY
        px, py, pz = px + t * dx, py + t * dy, pz + t * dz
        lx = scene[n, AXES] * px + scene[n, AXES + 1] * py + scene[n, AXES + 2] * pz
        ly = scene[n, AXES + 3] * px + scene[n, AXES + 4] * py + scene[n, AXES + 5] * pz
        return t if _inside(scene, n, lx, ly) else FAR_AWAY
    lx = scene[n, AXES] * px + scene[n, AXES + 1] * py + scene[n, AXES + 2] * pz
    ly = scene[n, AXES + 3] * px + scene[n, AXES + 4] * py + scene[n, AXES + 5] * pz
    lz = scene[n, AXES + 6] * px + scene[n, AXES + 7] * py + scene[n, AXES + 8] * pz
    ex = scene[n, AXES] * dx + scene[n, AXES + 1] * dy + scene[n, AXES + 2] * dz
    ey = scene[n, AXES + 3] * dx + scene[n, AXES + 4] * dy + scene[n, AXES + 5] * dz
    ez = scene[n, AXES + 6] * dx + scene[n, AXES + 7] * dy + scene[n, AXES + 8] * dz
    if kind == PATCH:
        return _hit_patch(scene, n, lx, ly, lz, ex, ey, ez)
    if kind == BOX:
        return _hit_box(scene, n, lx, ly, lz, ex, ey, ez)
    if kind == ELLIPSOID:
        return _hit_ellipsoid(scene, n, lx, ly, lz, ex, ey, ez)
    return _hit_cylinder(scene, n, lx, ly, lz, ex, ey, ez)


@compiled
def local_normal(scene: Float64, n: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the outward normal of a primitive at a local surface point, in local axes."""
    kind = int(scene[n, KIND])
    if kind == PATCH:
        nx, ny, nz = scene[n, CURVE] * x, scene[n, CURVE + 1] * y, -1.0
        if nx == 0 and ny == 0:
            return 0.0, 0.0, -1.0
    elif kind == BOX:
        u, v, w = abs(x) / scene[n, HALF], abs(y) / scene[n, HALF + 1], abs(z) / scene[n, HALF + 2]
        nx, ny, nz = 0.0, 0.0, 0.0
        if u >= v and u >= w:
            nx = math.copysign(1.0, x)
        elif v >= w:
            ny = math.copysign(1.0, y)
        else:
            nz = math.copysign(1.0, z)
    elif kind == ELLIPSOID:
        nx, ny, nz = x / scene[n, HALF] ** 2, y / scene[n, HALF + 1] ** 2, z / scene[n, HALF + 2] ** 2
    elif abs(y) >= scene[n, HALF + 1] * (1 - 1e-6):
        nx, ny, nz = 0.0, math.copysign(1.0, y), 0.0
    else:
        nx, ny, nz = x, -scene[n, CURVE] * (scene[n, HALF] + scene[n, CURVE] * y), z
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@compiled
def surface_point(scene: Float64, n: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return two coordinates on the surface of a primitive at a local point, in metres, for flat patterns."""
    kind = int(scene[n, KIND])
    if kind == PATCH:
        return x, y
    if kind == BOX:
        nx, ny, _ = local_normal(scene, n, x, y, z)
        if nx != 0:
            return z, y
        return (x, z) if ny != 0 else (x, y)
    if kind == ELLIPSOID:
        height = min(1.0, max(-1.0, y / scene[n, HALF + 1]))
        return math.atan2(x, -z) * scene[n, HALF], math.asin(height) * scene[n, HALF + 1]
    if abs(y) >= scene[n, HALF + 1] * (1 - 1e-6):
        return x, z
    return math.atan2(x, -z) * scene[n, HALF], y


def extents(primitives: Float64) -> Float64:
    """Return half the size of an upright box about each primitive's centre that holds it, ``(N, 3)`` m.

    Examples
    --------
    A ball of radius 0.1 m, whatever its axes: 0.1, 0.1, 0.1.
    """
    axes = np.abs(primitives[:, AXES : AXES + 9].reshape(-1, 3, 3))
    half, kind = primitives[:, HALF : HALF + 3].copy(), primitives[:, KIND]
    curve = np.abs(primitives[:, CURVE : CURVE + 2])
    patch, cylinder = kind == PATCH, kind == CYLINDER
    half[patch, 2] = 0.5 * np.sum(curve[patch] * half[patch, :2] ** 2, axis=1)
    widest = half[cylinder, 0] + curve[cylinder, 0] * half[cylinder, 1]
    half[cylinder, 0] = half[cylinder, 2] = widest
    box = np.einsum("nk,nkx->nx", half, axes)
    ball = np.sqrt(np.einsum("nk,nkx->nx", half**2, axes**2))
    sizes: Float64 = np.where((kind == ELLIPSOID)[:, None], ball, box) + 1e-6
    return sizes
