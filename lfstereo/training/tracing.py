"""The inner loops of the scene renderer on a processor: rays against layers, textures, sheared sums of views."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32
from lfstereo.training.layers import NEWTON_STEPS, Column

SHAPE = int(Column.SHAPE)
CX = int(Column.CX)
CY = int(Column.CY)
HALF_W = int(Column.HALF_W)
HALF_H = int(Column.HALF_H)
COS = int(Column.COS)
SIN = int(Column.SIN)
D = int(Column.D)
D_X = int(Column.D_X)
D_Y = int(Column.D_Y)
BUMP = int(Column.BUMP)
RIPPLE = int(Column.RIPPLE)
WAVE_X = int(Column.WAVE_X)
WAVE_Y = int(Column.WAVE_Y)
PHASE = int(Column.PHASE)
POINTS = int(Column.POINTS)
DEPTH = int(Column.DEPTH)
TEXTURE = int(Column.TEXTURE)
TEX_COS = int(Column.TEX_COS)
TEX_SIN = int(Column.TEX_SIN)
TEX_U = int(Column.TEX_U)
TEX_V = int(Column.TEX_V)
GAIN = int(Column.GAIN)
OFFSET = int(Column.OFFSET)
COLUMNS = int(Column.COUNT)


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator]
def _inside(row: Float32, dx: float, dy: float) -> bool:
    p, q = row[COS] * dx + row[SIN] * dy, -row[SIN] * dx + row[COS] * dy
    a, b = abs(p) / row[HALF_W], abs(q) / row[HALF_H]
    shape = row[SHAPE]
    if shape == 0.0:
        return True
    if a > 1.0 or b > 1.0:
        return False
    if shape == 2.0:
        return bool(a * a + b * b < 1.0)
    if shape == 3.0:
        inner = 1.0 - 2.0 * row[DEPTH]
        if a * a + b * b > 1.0 or a * a + b * b < inner * inner:
            return bool(a * a + b * b < 1.0)
        radius = 1.0 - row[DEPTH] * (1.0 + np.cos(row[POINTS] * np.arctan2(q / row[HALF_H], p / row[HALF_W])))
        return bool(a * a + b * b < radius * radius)
    if shape == 4.0:
        edge = 1.0 - row[DEPTH]
        return bool(a > edge or b > edge)
    if shape == 5.0:
        period = 2.0 * row[HALF_W] / (row[POINTS] + 1.0)
        turns = (p + row[HALF_W]) / period
        return bool(turns - np.floor(turns) < 0.2 + row[DEPTH])
    return True


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator]
def _curved(row: Float32, dx: float, dy: float, u_x: float, u_y: float, d: float) -> float:
    """Meet the ray through ``(dx + u_x d, dy + u_y d)`` with a curved surface, by Newton's method."""
    weight = row[BUMP] / (row[HALF_W] * row[HALF_W] + row[HALF_H] * row[HALF_H])
    for _ in range(NEWTON_STEPS):
        x, y = dx + u_x * d, dy + u_y * d
        phase = row[WAVE_X] * x + row[WAVE_Y] * y + row[PHASE]
        value = row[D] + row[D_X] * x + row[D_Y] * y - weight * (x * x + y * y) + row[RIPPLE] * np.sin(phase)
        slope = row[RIPPLE] * np.cos(phase)
        g_x = row[D_X] - 2.0 * weight * x + slope * row[WAVE_X]
        g_y = row[D_Y] - 2.0 * weight * y + slope * row[WAVE_Y]
        d -= (d - value) / (1.0 - g_x * u_x - g_y * u_y)
    return d


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")  # type: ignore[untyped-decorator]
def _box(row: Float32, u_x: float, u_y: float, width: int, height: int) -> tuple[int, int, int, int]:
    """Columns and rows of the frame that a layer can reach."""
    if row[SHAPE] == 0.0:
        return 0, width, 0, height
    reach = np.sqrt(row[HALF_W] ** 2 + row[HALF_H] ** 2)
    span = reach * (abs(row[D_X]) + abs(row[D_Y])) + abs(row[BUMP]) + abs(row[RIPPLE]) + 1.0
    half_w = abs(row[COS]) * row[HALF_W] + abs(row[SIN]) * row[HALF_H] + abs(u_x) * span + 1.0
    half_h = abs(row[SIN]) * row[HALF_W] + abs(row[COS]) * row[HALF_H] + abs(u_y) * span + 1.0
    x, y = row[CX] - u_x * row[D], row[CY] - u_y * row[D]
    left, right = max(0, int(x - half_w)), min(width, int(x + half_w) + 2)
    return left, right, max(0, int(y - half_h)), min(height, int(y + half_h) + 2)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def trace(layers: Float32, eye: Float32, x0: float, y0: float, disparity: Float32, layer: Float32) -> None:
    """Find the nearest layer along every ray.

    Parameters
    ----------
    layers
        ``(L, 28)`` float32.
    eye
        ``(2,)`` float32 offset of the eye in baselines.
    x0, y0
        Image coordinates of the first pixel.
    disparity, layer
        ``(H, W)`` filled with the disparity in px and the index of the layer.
    """
    u_x, u_y = eye[0], eye[1]
    height, width = disparity.shape
    disparity[:] = -1e9
    moved = np.empty(COLUMNS, np.float32)
    for index in range(len(layers) - 1, -1, -1):
        for k in range(COLUMNS):
            moved[k] = layers[index, k]
        moved[CX] -= x0
        moved[CY] -= y0
        left, right, top, bottom = _box(moved, u_x, u_y, width, height)
        straight = moved[BUMP] == 0.0 and moved[RIPPLE] == 0.0
        d0, g_x, g_y, c_x, c_y = moved[D], moved[D_X], moved[D_Y], moved[CX], moved[CY]
        scale = np.float32(1.0) / (np.float32(1.0) - g_x * u_x - g_y * u_y)
        bulge = np.float32(1.5) * (abs(moved[BUMP]) + abs(moved[RIPPLE])) * scale
        for r in range(top, bottom):
            dy = np.float32(r) - c_y
            for c in range(left, right):
                dx = np.float32(c) - c_x
                d = (d0 + g_x * dx + g_y * dy) * scale
                if d + bulge <= disparity[r, c]:
                    continue
                if not straight:
                    d = _curved(moved, dx, dy, u_x, u_y, d)
                if d > disparity[r, c] and _inside(moved, dx + u_x * d, dy + u_y * d):
                    disparity[r, c] = d
                    layer[r, c] = index


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def shade(
    layers: Float32,
    textures: Float32,
    eye: Float32,
    x0: float,
    y0: float,
    disparity: Float32,
    layer: Float32,
    image: Float32,
) -> None:
    """Colour every pixel of a traced picture: bilinear texture, gain and offset of its layer.

    Parameters
    ----------
    layers, eye, x0, y0, disparity, layer
        As for :func:`trace`, which filled the last two.
    textures
        ``(N, 256, 256, 3)`` float32 linear RGB.
    image
        ``(H, W, 3)`` filled.
    """
    u_x, u_y = eye[0], eye[1]
    height, width = disparity.shape
    for r in range(height):
        for c in range(width):
            index = int(layer[r, c])
            d = disparity[r, c]
            dx = np.float32(c + x0 + u_x * d - layers[index, CX])
            dy = np.float32(r + y0 + u_y * d - layers[index, CY])
            cos, sin = layers[index, TEX_COS], layers[index, TEX_SIN]
            s = cos * dx + sin * dy + layers[index, TEX_U] + np.float32(8192.0)
            t = cos * dy - sin * dx + layers[index, TEX_V] + np.float32(8192.0)
            i, j = int(t), int(s)
            a, b = t - np.float32(i), s - np.float32(j)
            i, j = i & 255, j & 255
            i1, j1 = (i + 1) & 255, (j + 1) & 255
            n = int(layers[index, TEXTURE])
            one = np.float32(1.0)
            w00, w01, w10, w11 = (one - a) * (one - b), (one - a) * b, a * (one - b), a * b
            for k in range(3):
                texel = textures[n, i, j, k] * w00 + textures[n, i, j1, k] * w01
                texel += textures[n, i1, j, k] * w10 + textures[n, i1, j1, k] * w11
                image[r, c, k] = layers[index, GAIN + k] * texel + layers[index, OFFSET + k]


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def shear_add(view: Float32, shift_x: Float32, shift_y: Float32, margin: int, total: Float32) -> None:
    """Add one view to every slice, moved so that the slice's disparity lines up.

    Parameters
    ----------
    view
        ``(H + 2 margin, W + 2 margin, 3)``.
    shift_x, shift_y
        ``(K,)`` px: slice k takes the view at ``(x - shift_x[k], y - shift_y[k])``.
    margin
        px, larger than any shift.
    total
        ``(K, H, W, 3)``, added to in place.
    """
    count, height, width, _ = total.shape
    flat = view.reshape(view.shape[0], view.shape[1] * 3)
    for k in range(count):
        x, y = margin - shift_x[k], margin - shift_y[k]
        i, j = int(np.floor(y)), int(np.floor(x))
        a, b = np.float32(y - i), np.float32(x - j)
        one = np.float32(1.0)
        w00, w01, w10, w11 = (one - a) * (one - b), (one - a) * b, a * (one - b), a * b
        out = total[k].reshape(height, width * 3)
        for r in range(height):
            upper, lower, target = flat[r + i, 3 * j :], flat[r + i + 1, 3 * j :], out[r]
            for c in range(width * 3):
                target[c] += w00 * upper[c] + w01 * upper[c + 3] + w10 * lower[c] + w11 * lower[c + 3]
