"""Procedural scenes of slanted, curved layers, rendered from any point of either camera's pupil, exactly.

A scene lives in the coordinates of the rectified left centre view: ``(x, y, d)``, disparity ``d`` in px. An eye at
offset ``u`` (in baselines; left centre ``(0, 0)``, right centre ``(1, 0)``) sees that point at
``(x - u_x d, y - u_y d)``. A plane in space is an affine function ``d(x, y)``, so every surface here is such a plane
plus a bump and a ripple; the ray through a pixel of any eye is intersected by Newton's method, the nearest hit wins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.training.layers import Column

SUBPIXELS = {
    1: ((0.0, 0.0),),
    2: ((-0.25, -0.25), (0.25, 0.25)),
    4: ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)),
}


@dataclass(frozen=True, slots=True)
class Scene:
    """Layers in front of a background."""

    layers: Float32
    """``(L, 28)`` one row per layer: silhouette, surface, texture placement, colour; the background first."""
    textures: Float32
    """``(N, 256, 256, 3)`` linear RGB bank the layers draw from."""
    height: int
    width: int


@dataclass(frozen=True, slots=True)
class View:
    """What one eye sees."""

    image: Float32
    """``(H, W, 3)`` linear RGB."""
    disparity: Float32
    """``(H, W)`` px, exact at pixel centres."""
    layer: Float32
    """``(H, W)`` index of the layer seen."""


def random_scene(rng: np.random.Generator, textures: Float32, height: int, width: int, top_px: float = 100.0) -> Scene:
    """Draw a scene: 8 to 30 layers, disparities somewhere in 0 to ``top_px``.

    Parameters
    ----------
    rng
        Decides everything.
    textures
        ``(N, 256, 256, 3)`` bank.
    height, width
        Size in px of the views that will be rendered.
    top_px
        Largest disparity.
    """
    if rng.random() < 0.7:
        near, far = rng.uniform(0.55, 1.0) * top_px, rng.uniform(0.0, 0.35) * top_px
    else:
        middle, half = rng.uniform(0.1, 0.9) * top_px, rng.uniform(0.05, 0.25) * top_px
        near, far = min(middle + half, top_px), max(middle - half, 0.0)
    count = int(rng.integers(8, 31))
    rows = [_background(rng, far, near, height, width)]
    power = rng.uniform(0.6, 1.8)
    centres = far + (near - far) * rng.random(count) ** power
    rows.extend(flat_object(rng, float(d), near, far, height, width) for d in centres)
    layers = np.stack(rows).astype(np.float32)
    layers[1:] = layers[1:][np.argsort(layers[1:, Column.D])]
    dress(rng, layers, len(textures))
    return Scene(layers, textures, height, width)


def _background(rng: np.random.Generator, far: float, near: float, height: int, width: int) -> Float64:
    row = np.zeros(Column.COUNT)
    row[[Column.CX, Column.CY, Column.HALF_W, Column.HALF_H, Column.COS]] = width / 2, height / 2, width, height, 1
    span = near - far
    tilt = rng.uniform(0, 0.7) * span if rng.random() < 0.6 else rng.uniform(0, 0.1) * span
    angle = rng.choice([np.pi / 2, rng.uniform(0, 2 * np.pi)])
    row[Column.D_X] = 0.5 * tilt * np.cos(angle) / width
    row[Column.D_Y] = tilt * np.sin(angle) / height
    row[Column.D] = far + abs(row[Column.D_X]) * width / 2 + abs(row[Column.D_Y]) * height / 2
    if rng.random() < 0.4:
        _ripple(rng, row, 0.05 * span)
        row[Column.D] += row[Column.RIPPLE]
    return row


def flat_object(rng: np.random.Generator, d: float, near: float, far: float, height: int, width: int) -> Float64:
    """Draw a layer at disparity ``d``: a slanted, bulging or rippled sheet of any silhouette, within far to near."""
    row = np.zeros(Column.COUNT)
    shape = rng.choice(5, p=[0.3, 0.25, 0.25, 0.1, 0.1]) + 1
    size = height * (0.05 + 0.4 * rng.random() ** 1.5) * (0.6 + 0.7 * d / 100)
    aspect = np.exp(rng.uniform(-0.9, 0.9))
    hw, hh = size * np.sqrt(aspect), size / np.sqrt(aspect)
    if shape == 1 and rng.random() < 0.35:
        hw, hh = rng.uniform(0.8, 4.0), rng.uniform(0.2, 0.7) * height
    angle = rng.choice([0.0, np.pi / 2, rng.uniform(0, 2 * np.pi)])
    row[Column.SHAPE], row[Column.HALF_W], row[Column.HALF_H] = shape, hw, hh
    row[Column.CX], row[Column.CY] = (
        rng.uniform(-0.05, 1.05) * width + rng.uniform(0, d),
        rng.uniform(-0.05, 1.05) * height,
    )
    row[Column.COS], row[Column.SIN] = np.cos(angle), np.sin(angle)
    row[Column.POINTS], row[Column.DEPTH] = rng.integers(2, 8), rng.uniform(0.1, 0.45)
    room = max(min(near - d, d - far), 0.0)
    reach = np.hypot(hw, hh)
    slant, heading = min(rng.random() ** 2 * room / reach, 0.35), rng.uniform(0, 2 * np.pi)
    row[Column.D], row[Column.D_X], row[Column.D_Y] = d, slant * np.cos(heading), slant * np.sin(heading)
    room -= slant * reach
    if rng.random() < 0.35 and hw > 8 and hh > 8:
        row[Column.BUMP] = rng.uniform(-1, 1) * min(0.5 * room, 0.12 * min(hw, hh))
        room -= abs(row[Column.BUMP])
    if rng.random() < 0.2 and min(hw, hh) > 8:
        _ripple(rng, row, min(0.3 * room, 2.0))
    return row


def _ripple(rng: np.random.Generator, row: Float64, most: float) -> None:
    period, heading = rng.uniform(30, 160), rng.uniform(0, 2 * np.pi)
    row[Column.RIPPLE] = min(most, 0.15 * period / (2 * np.pi)) * rng.random()
    row[Column.WAVE_X], row[Column.WAVE_Y] = 2 * np.pi / period * np.cos(heading), 2 * np.pi / period * np.sin(heading)
    row[Column.PHASE] = rng.uniform(0, 2 * np.pi)


def dress(rng: np.random.Generator, layers: Float32, bank: int) -> None:
    """Give every layer a texture of the bank, placed at random, and a colour."""
    count = len(layers)
    layers[:, Column.TEXTURE] = rng.integers(0, bank, count)
    scale, angle = np.exp(rng.uniform(-0.8, 0.4, count)), rng.uniform(0, 2 * np.pi, count)
    angle[rng.random(count) < 0.4] = 0.0
    layers[:, Column.TEX_COS], layers[:, Column.TEX_SIN] = scale * np.cos(angle), scale * np.sin(angle)
    layers[:, Column.TEX_U : Column.TEX_V + 1] = rng.uniform(0, 256, (count, 2))
    bright = np.exp(rng.uniform(-1.2, 0.3, (count, 1)))
    layers[:, Column.GAIN : Column.GAIN + 3] = bright * np.exp(rng.uniform(-0.35, 0.35, (count, 3)))
    layers[:, Column.OFFSET : Column.OFFSET + 3] = rng.uniform(0, 0.05, (count, 1))


def render(scene: Scene, u_x: float, u_y: float, margin: int = 0, shift_y: float = 0.0, samples: int = 1) -> View:
    """Render the scene from one point of a pupil.

    Parameters
    ----------
    scene
        What to see.
    u_x, u_y
        Offset of the eye in baselines from the left centre.
    margin
        px rendered beyond the frame on every side.
    shift_y
        px by which the picture is moved down (misalignment of a rig).
    samples
        Points per pixel over which colours are averaged: 1, 2 (on the diagonal) or 4.

    Returns
    -------
    View
        ``H + 2 margin`` by ``W + 2 margin``.
    """
    from lfstereo.training.tracing import shade, trace  # compiled, and only needed where scenes are rendered here

    h, w = scene.height + 2 * margin, scene.width + 2 * margin
    disparity, layer = np.empty((h, w), np.float32), np.empty((h, w), np.float32)
    image, part = np.zeros((h, w, 3), np.float32), np.empty((h, w, 3), np.float32)
    eye = np.array((u_x, u_y), np.float32)
    offsets = SUBPIXELS[samples]
    for dx, dy in offsets:
        x0, y0 = dx - margin, dy - margin - shift_y
        trace(scene.layers, eye, x0, y0, disparity, layer)
        shade(scene.layers, scene.textures, eye, x0, y0, disparity, layer, part)
        image += part / len(offsets)
    if samples > 1:
        trace(scene.layers, eye, float(-margin), float(-margin - shift_y), disparity, layer)
    return View(image, disparity, layer)
