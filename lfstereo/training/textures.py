"""Procedural surface textures from a seed: noise, thresholded noise, stripes, bricks, checkers, plain.

References
----------
Perlin, "An image synthesizer" (1985): noise of several octaves.
"""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32

TEXTURE_SIDE = 256
"""Texels per side; textures repeat seamlessly."""
KINDS = {"noise": 0.38, "threshold": 0.25, "stripes": 0.07, "bricks": 0.08, "checker": 0.07, "plain": 0.15}
"""Kind -> share of the bank."""


def texture_bank(seed: int, count: int) -> Float32:
    """Make a bank of textures.

    Parameters
    ----------
    seed
        Different seeds give different textures: training and test sets use different ones.
    count
        Number of textures.

    Returns
    -------
    Float32
        ``(count, 256, 256, 3)`` linear RGB in [0, 1].
    """
    rng = np.random.default_rng([seed, 7])
    return np.stack([_texture(rng) for _ in range(count)])


def octave_noise(rng: np.random.Generator, coarsest: int, octaves: int, roughness: float) -> Float32:
    """Return seamless noise ``(256, 256)`` in [0, 1] whose amplitude falls by ``roughness`` per octave."""
    total = np.zeros((TEXTURE_SIDE, TEXTURE_SIDE), np.float32)
    for octave in range(octaves):
        cells = coarsest * 2**octave
        if cells > TEXTURE_SIDE:
            break
        grid = rng.random((cells, cells), dtype=np.float32)
        grid = np.pad(grid, 2, mode="wrap")
        step = TEXTURE_SIDE // cells
        large = cv2.resize(grid, None, fx=step, fy=step, interpolation=cv2.INTER_CUBIC)
        total += roughness**octave * large[2 * step : -2 * step, 2 * step : -2 * step]
    low, high = np.percentile(total, (1, 99))
    return np.asarray(np.clip((total - low) / max(float(high - low), 1e-6), 0, 1), np.float32)


def _texture(rng: np.random.Generator) -> Float32:
    kind = rng.choice(list(KINDS), p=list(KINDS.values()))
    dark, light = _colour(rng), _colour(rng)
    if kind == "plain":
        shade = 0.04 * octave_noise(rng, int(rng.choice([2, 4, 8])), 4, 0.6)[..., None]
        return np.asarray(np.clip(light * (0.98 + shade), 0, 1), np.float32)
    pattern = _pattern(rng, str(kind))
    image = dark + (light - dark) * pattern[..., None]
    if rng.random() < 0.85:
        grain = octave_noise(rng, int(rng.choice([8, 16, 32])), 6, 0.8)[..., None] - 0.5
        image = image * (1 + rng.uniform(0.1, 0.7) * grain)
    if kind == "noise" and rng.random() < 0.6:
        tint = np.stack([octave_noise(rng, 4, 5, 0.7) for _ in range(3)], axis=-1) - 0.5
        image = image + 0.5 * tint
    return np.asarray(np.clip(image, 0, 1), np.float32)


def _colour(rng: np.random.Generator) -> Float32:
    display = rng.random(3) * rng.uniform(0.3, 1.0) + rng.uniform(0.0, 0.25)
    return np.clip(display, 0.02, 1.0).astype(np.float32) ** 2.2


def _pattern(rng: np.random.Generator, kind: str) -> Float32:
    v, u = np.mgrid[0:TEXTURE_SIDE, 0:TEXTURE_SIDE].astype(np.float32)
    coarsest = int(rng.choice([2, 4, 8, 16, 32]))
    if kind == "noise":
        return octave_noise(rng, coarsest, 8, float(rng.uniform(0.5, 0.95)))
    if kind == "threshold":
        noise = octave_noise(rng, coarsest, 6, float(rng.uniform(0.4, 0.8)))
        return np.asarray(np.clip((noise - 0.5) * rng.uniform(6, 40) + 0.5, 0, 1), np.float32)
    cell = TEXTURE_SIDE // int(rng.choice([4, 8, 16, 32]))
    if kind == "stripes":
        along = u if rng.random() < 0.5 else v
        wave = np.sin(2 * np.pi * along / cell)
        return np.asarray(np.clip(wave * rng.uniform(0.5, 5) + 0.5, 0, 1), np.float32)
    if kind == "checker":
        return np.asarray((u // cell + v // cell) % 2, np.float32)
    row = v // cell
    width = 2 * cell
    inside = ((v % cell) >= max(1, cell // 8)) & (((u + (row % 2) * cell) % width) >= max(1, cell // 8))
    tone = rng.uniform(0.5, 1.0, (TEXTURE_SIDE // cell, TEXTURE_SIDE // cell)).astype(np.float32)
    column = ((u + (row % 2) * cell) // width).astype(int) % tone.shape[1]
    return np.asarray(inside * tone[row.astype(int) % tone.shape[0], column], np.float32)
