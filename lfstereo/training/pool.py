"""A pool of rendered stack pairs on disk, so that stages which learn from stacks need not render them again.

The pool is a cache, never shipped: sample ``i`` depends on the seed and ``i`` alone.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, UInt8, UInt16
from lfstereo.conventions import SLICES_DEFAULT
from lfstereo.errors import ConfigError
from lfstereo.progress import Progress, silent
from lfstereo.training.atlas import scene_bank
from lfstereo.training.samples import stack_sample

DISPARITY_STEPS_PER_PX = 256
_PER_BANK = 64


@dataclass(frozen=True, slots=True)
class Pool:
    """Memory-mapped samples."""

    stacks: UInt8
    """``(N, 2, 16, H, W, 3)`` display-referred, 0 to 255."""
    sharp: UInt8
    """``(N, 2, H, W, 3)``."""
    disparity: UInt16
    """``(N, 2, H, W)`` in 1/256 px."""
    valid: UInt8
    """``(N, 2, H, W)`` 0 or 1."""
    ready: UInt8
    """``(N,)`` 1 where the sample has been rendered."""
    aperture_ratio: Float32
    """``(N,)``."""


def open_pool(folder: Path, count: int, height: int, width: int, seed: int) -> Pool:
    """Open a pool, or create an empty one.

    Raises
    ------
    ConfigError
        If the folder holds a pool of another size or seed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {"count": count, "height": height, "width": width, "seed": seed}
    card = folder / "pool.json"
    fresh = not card.exists()
    if fresh:
        card.write_text(json.dumps(wanted))
    elif (found := json.loads(card.read_text())) != wanted:
        raise ConfigError(f"{folder}: holds a pool of {found}, expected {wanted}; name another folder or delete it")
    shapes: dict[str, tuple[tuple[int, ...], npt.DTypeLike]] = {
        "stacks": ((count, 2, SLICES_DEFAULT, height, width, 3), np.uint8),
        "sharp": ((count, 2, height, width, 3), np.uint8),
        "disparity": ((count, 2, height, width), np.uint16),
        "valid": ((count, 2, height, width), np.uint8),
        "ready": ((count,), np.uint8),
        "aperture_ratio": ((count,), np.float32),
    }
    arrays = {}
    for name, (shape, kind) in shapes.items():
        path = folder / f"{name}.npy"
        if fresh:
            arrays[name] = np.lib.format.open_memmap(path, "w+", kind, shape)
        else:
            arrays[name] = np.load(path, mmap_mode="r+", allow_pickle=False)
    return Pool(**arrays)


def fill_pool(
    pool: Pool, seed: int, textures: int, progress: Progress = silent, kind: str = "layers", atlas: str = ""
) -> None:
    """Render every sample that is not ready yet; see :func:`scene_bank` for ``kind`` and ``atlas``."""
    count, _, height, width = pool.disparity.shape
    bank, bank_number = scene_bank(kind, seed, 1), -1
    for index in range(count):
        if pool.ready[index]:
            continue
        if index // _PER_BANK != bank_number:
            bank_number = index // _PER_BANK
            bank = scene_bank(kind, seed * 100003 + bank_number, textures, atlas)
        sample = stack_sample(np.random.default_rng([seed, 2, index]), bank, height, width, kind=kind)
        pool.stacks[index] = np.round(sample.stacks * 255)
        pool.sharp[index] = np.round(sample.sharp * 255)
        pool.disparity[index] = np.round(np.clip(sample.disparity, 0, 255) * DISPARITY_STEPS_PER_PX)
        pool.valid[index] = sample.valid
        pool.aperture_ratio[index] = sample.aperture_ratio
        pool.ready[index] = 1
        progress(index + 1, count)
