"""Textures cut from a folder of photographs, beside the procedural ones."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Float32, UInt8
from lfstereo.container.picture_size import picture_in
from lfstereo.errors import ConfigError
from lfstereo.training.textures import TEXTURE_SIDE, octave_noise, texture_bank

PHOTOGRAPHS = 0.4
"""Share of the bank that is cut from photographs, where there are any."""
COMPOSITES = 0.2
"""Share of the bank that shows one texture through the holes of another."""
_PICTURES = (".png", ".jpg", ".jpeg")


def scene_bank(kind: str, seed: int, count: int, atlas: str = "") -> Float32:
    """Make the bank of textures that a kind of scene is dressed in: plain procedural ones for ``"layers"``."""
    return texture_bank(seed, count) if kind == "layers" else mixed_bank(seed, count, atlas)


def mixed_bank(seed: int, count: int, folder: str = "") -> Float32:
    """Make a bank of textures like :func:`texture_bank`, some of them composites, some cut from photographs.

    Parameters
    ----------
    seed
        Decides everything.
    count
        Number of textures.
    folder
        PNG and JPEG pictures; without one all textures are procedural.

    Returns
    -------
    Float32
        ``(count, 256, 256, 3)`` linear RGB in [0, 1].

    Raises
    ------
    ConfigError
        If the folder holds no picture that can be read.
    """
    bank = texture_bank(seed, count)
    rng = np.random.default_rng([seed, 8])
    pictures = read_atlas(folder) if folder else ()
    for index in range(count):
        kind = rng.random()
        if pictures and kind < PHOTOGRAPHS:
            bank[index] = _cut(rng, pictures[int(rng.integers(len(pictures)))])
        elif kind > 1 - COMPOSITES:
            mask = octave_noise(rng, int(rng.choice([2, 4, 8])), 5, 0.5)[..., None] > rng.uniform(0.3, 0.7)
            bank[index] = np.where(mask, bank[index], bank[int(rng.integers(count))])
    return bank


@lru_cache(maxsize=1)
def read_atlas(folder: str) -> tuple[UInt8, ...]:
    """Read all pictures of a folder as ``(H, W, 3)`` RGB, the shorter side at least 64 px."""
    paths = sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in _PICTURES) if Path(folder).is_dir() else []
    found = [picture_in(path, cv2.IMREAD_COLOR) for path in paths]
    pictures = tuple(np.asarray(p[..., ::-1], np.uint8) for p in found if p is not None and min(p.shape[:2]) >= 64)
    if not pictures:
        raise ConfigError(f"{folder}: holds no PNG or JPEG picture of 64 px or more; name a folder of photographs")
    return pictures


def _cut(rng: np.random.Generator, picture: UInt8) -> Float32:
    """A square of the picture, 96 px wide or more where it has so many, any way round, in linear light."""
    side = int(rng.uniform(min(96, min(picture.shape[:2])), min(picture.shape[:2]) + 1))
    y, x = (int(rng.integers(0, length - side + 1)) for length in picture.shape[:2])
    square = np.rot90(picture[y : y + side, x : x + side], int(rng.integers(4)))
    method = cv2.INTER_AREA if side > TEXTURE_SIDE else cv2.INTER_CUBIC
    fitted = cv2.resize(np.ascontiguousarray(square), (TEXTURE_SIDE, TEXTURE_SIDE), interpolation=method)
    colours = rng.permutation(3) if rng.random() < 0.3 else np.arange(3)
    return np.asarray((fitted[..., colours].astype(np.float32) / 255) ** 2.2, np.float32)
