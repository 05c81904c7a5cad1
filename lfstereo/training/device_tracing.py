"""The scene renderer on the training device: what :mod:`lfstereo.training.tracing` draws, all eyes at once, in torch.

One pass over the layers from near to far, each within the box of the frame it can reach; no data leave the device.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from lfstereo.arrays import Float32, Float64
from lfstereo.training.layers import NEWTON_STEPS, SHAPES, Column
from lfstereo.training.scenes import SUBPIXELS

_FAR = -1e9
_GATHERED = (Column.CX, Column.CY, *range(Column.TEXTURE, Column.COUNT))


@dataclass(frozen=True, slots=True)
class Frame:
    """What part of the image plane is rendered."""

    height: int
    """px, without margins."""
    width: int
    margin: int = 0
    """px rendered beyond the frame on every side."""
    shift_y: float = 0.0
    """px by which the picture is moved down."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns with the margins."""
        return self.height + 2 * self.margin, self.width + 2 * self.margin


@torch.no_grad()
def render_views(
    layers: Float32, textures: Tensor, eyes: Float32, frame: Frame, samples: int = 1
) -> tuple[Tensor, Tensor]:
    """Render a scene from several points of a pupil.

    Parameters
    ----------
    layers
        ``(L, 28)`` the scene's table.
    textures
        ``(N, 256, 256, 3)`` linear RGB on the device that renders.
    eyes
        ``(P, 2)`` offsets from the left centre in baselines; near each other, or boxes get wide.
    frame
        Size and place of the pictures.
    samples
        Points per pixel over which colours are averaged: 1, 2 or 4.

    Returns
    -------
    tuple
        Images ``(P, H, W, 3)`` linear RGB, disparities ``(P, H, W)`` px, exact at pixel centres.
    """
    table = torch.from_numpy(layers).to(textures.device)
    u = torch.from_numpy(eyes).to(textures.device)[:, :, None, None]
    image: Tensor | None = None
    for dx, dy in SUBPIXELS[samples]:
        x0, y0 = dx - frame.margin, dy - frame.margin - frame.shift_y
        disparity, layer = _trace(layers, eyes, u, x0, y0, frame.shape)
        part = _shade(table, textures, u, x0, y0, disparity, layer) / len(SUBPIXELS[samples])
        image = part if image is None else image + part
    if samples > 1:
        disparity, _ = _trace(layers, eyes, u, -frame.margin, -frame.margin - frame.shift_y, frame.shape)
    assert image is not None
    return image, disparity


def _trace(
    layers: Float32, eyes: Float32, u: Tensor, x0: float, y0: float, shape: tuple[int, int]
) -> tuple[Tensor, Tensor]:
    """Find the nearest layer along every ray: disparities and layer numbers, ``(P, H, W)`` each."""
    height, width = shape
    disparity = torch.full((len(eyes), height, width), _FAR, device=u.device)
    layer = torch.zeros((len(eyes), height, width), dtype=torch.int64, device=u.device)
    columns, rows = torch.arange(width, device=u.device), torch.arange(height, device=u.device)
    for index in range(len(layers) - 1, -1, -1):
        row = layers[index].astype(np.float64)
        row[[Column.CX, Column.CY]] -= x0, y0
        left, right, top, bottom = _box(row, eyes, width, height)
        if left >= right or top >= bottom:
            continue
        dx = (columns[left:right] - float(row[Column.CX])).float()[None, None, :]
        dy = (rows[top:bottom] - float(row[Column.CY])).float()[None, :, None]
        d = _meet(row, dx, dy, u)
        box = np.s_[:, top:bottom, left:right]
        hit = (d > disparity[box]) & _inside(row, dx + u[:, 0] * d, dy + u[:, 1] * d)
        disparity[box] = torch.where(hit, d, disparity[box])
        layer[box] = torch.where(hit, index, layer[box])
    return disparity, layer


def _meet(row: Float64, dx: Tensor, dy: Tensor, u: Tensor) -> Tensor:
    """Disparity at which the rays meet a layer's surface, by Newton's method where it is curved."""
    c = [float(value) for value in row]
    u_x, u_y = u[:, 0], u[:, 1]
    d = (c[Column.D] + c[Column.D_X] * dx + c[Column.D_Y] * dy) / (1 - c[Column.D_X] * u_x - c[Column.D_Y] * u_y)
    bump, ripple = c[Column.BUMP], c[Column.RIPPLE]
    if bump == 0 and ripple == 0:
        return d
    weight = bump / (c[Column.HALF_W] ** 2 + c[Column.HALF_H] ** 2)
    for _ in range(NEWTON_STEPS):
        x, y = dx + u_x * d, dy + u_y * d
        phase = c[Column.WAVE_X] * x + c[Column.WAVE_Y] * y + c[Column.PHASE]
        value = c[Column.D] + c[Column.D_X] * x + c[Column.D_Y] * y - weight * (x * x + y * y)
        value = value + ripple * torch.sin(phase)
        slope = ripple * torch.cos(phase)
        g_x = c[Column.D_X] - 2 * weight * x + slope * c[Column.WAVE_X]
        g_y = c[Column.D_Y] - 2 * weight * y + slope * c[Column.WAVE_Y]
        d = d - (d - value) / (1 - g_x * u_x - g_y * u_y)
    return d


def _inside(row: Float64, dx: Tensor, dy: Tensor) -> Tensor:
    """Whether points, relative to the layer's centre, lie within its silhouette."""
    shape = SHAPES[int(row[Column.SHAPE])]
    if shape == "everywhere":
        return torch.ones_like(dx, dtype=torch.bool)
    cos, sin = float(row[Column.COS]), float(row[Column.SIN])
    half_w, half_h = float(row[Column.HALF_W]), float(row[Column.HALF_H])
    points, depth = float(row[Column.POINTS]), float(row[Column.DEPTH])
    p, q = cos * dx + sin * dy, cos * dy - sin * dx
    a, b = p.abs() / half_w, q.abs() / half_h
    box = (a <= 1) & (b <= 1)
    if shape == "ellipse":
        return a * a + b * b < 1
    if shape == "star":
        radius = 1 - depth * (1 + torch.cos(points * torch.atan2(q / half_h, p / half_w)))
        return a * a + b * b < radius * radius
    if shape == "frame":
        return box & ((a > 1 - depth) | (b > 1 - depth))
    if shape == "comb":
        turns = (p + half_w) * ((points + 1) / (2 * half_w))
        return box & (turns - turns.floor() < 0.2 + depth)
    return box


def _box(row: Float64, eyes: Float32, width: int, height: int) -> tuple[int, int, int, int]:
    """Columns and rows of the frame that a layer can reach, seen from any of the eyes."""
    if SHAPES[int(row[Column.SHAPE])] == "everywhere":
        return 0, width, 0, height
    reach = np.hypot(row[Column.HALF_W], row[Column.HALF_H])
    span = reach * (abs(row[Column.D_X]) + abs(row[Column.D_Y])) + abs(row[Column.BUMP]) + abs(row[Column.RIPPLE]) + 1
    cos, sin = abs(row[Column.COS]), abs(row[Column.SIN])
    half = np.array(
        (cos * row[Column.HALF_W] + sin * row[Column.HALF_H], sin * row[Column.HALF_W] + cos * row[Column.HALF_H])
    )
    half = half + np.abs(eyes) * span + 1
    centre = row[[Column.CX, Column.CY]] - eyes * row[Column.D]
    left, top = np.maximum((centre - half).min(0), 0).astype(int)
    right, bottom = np.minimum((centre + half).max(0) + 2, (width, height)).astype(int)
    return int(left), int(right), int(top), int(bottom)


def _shade(
    table: Tensor, textures: Tensor, u: Tensor, x0: float, y0: float, disparity: Tensor, layer: Tensor
) -> Tensor:
    """Colour every traced pixel: bilinear texture, gain and offset of its layer; ``(P, H, W, 3)``."""
    rows = table[:, list(_GATHERED)][layer]
    of = {column: rows[..., k] for k, column in enumerate(_GATHERED)}
    _, height, width = disparity.shape
    x = torch.arange(width, device=u.device)[None, None, :] + x0
    y = torch.arange(height, device=u.device)[None, :, None] + y0
    dx, dy = x + u[:, 0] * disparity - of[Column.CX], y + u[:, 1] * disparity - of[Column.CY]
    cos, sin = of[Column.TEX_COS], of[Column.TEX_SIN]
    s, t = cos * dx + sin * dy + of[Column.TEX_U], cos * dy - sin * dx + of[Column.TEX_V]
    i, j = t.floor(), s.floor()
    a, b = (t - i)[..., None], (s - j)[..., None]
    i, j = i.long() & 255, j.long() & 255
    texture = of[Column.TEXTURE].long() * 65536
    flat = textures.reshape(-1, 3)
    upper, lower = texture + i * 256, texture + ((i + 1) & 255) * 256
    next_j = (j + 1) & 255
    texel = (1 - a) * ((1 - b) * flat[upper + j] + b * flat[upper + next_j])
    texel = texel + a * ((1 - b) * flat[lower + j] + b * flat[lower + next_j])
    gain, offset = (rows[..., _GATHERED.index(c) : _GATHERED.index(c) + 3] for c in (Column.GAIN, Column.OFFSET))
    return gain * texel + offset
