"""What the refinement starts from, computed once for every sample of a pool and kept on disk; never shipped."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lfstereo.errors import ConfigError
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.blocks import channels_last, fold_batch_norms
from lfstereo.network.refine_net import CLUES, OFFERS
from lfstereo.progress import Progress, silent
from lfstereo.training.pool import DISPARITY_STEPS_PER_PX, Pool, open_pool
from lfstereo.training.recipe import Recipe
from lfstereo.training.samples import SLICE_DISPARITIES

CUES = ("both", "stereo", "focus")
"""What the front was given."""
CHANCES = (0.6, 0.2, 0.2)
"""How often each is learnt from."""
_MAPS = CLUES + OFFERS


@dataclass(frozen=True, slots=True)
class FrontBatch:
    """What the refinement is given, and the truth."""

    clues: Tensor
    """``(B, 16, H, W)``."""
    offers: Tensor
    """``(B, 4, H, W)`` px."""
    disparity: Tensor
    """``(B, 1, H, W)`` disparity / 100 px."""
    valid: Tensor
    """``(B, 1, H, W)`` bool."""


def open_fronts(folder: Path, pool: Pool) -> tuple[NDArray[np.float16], NDArray[np.uint8]]:
    """Open or create the cache of a pool: ``(N, 3, 20, H, W)`` maps and ``(N,)`` which are ready."""
    folder.mkdir(parents=True, exist_ok=True)
    count, _, height, width = pool.disparity.shape
    found = []
    shapes = {"maps": (np.float16, (count, len(CUES), _MAPS, height, width)), "ready": (np.uint8, (count,))}
    for name, (kind, shape) in shapes.items():
        path = folder / f"{name}.npy"
        if not path.exists():
            np.lib.format.open_memmap(path, "w+", kind, shape)
        array = np.load(path, mmap_mode="r+", allow_pickle=False)
        if array.shape != shape:
            raise ConfigError(f"{path}: holds maps of shape {array.shape}, expected {shape}; name another folder")
        found.append(array)
    return found[0], found[1]


def fill_fronts(folder: Path, recipe: Recipe, network: BinocularNet, progress: Progress = silent) -> None:
    """Compute the fronts of all samples that are rendered and not done yet; several processes may share the work.

    Raises
    ------
    ConfigError
        If the recipe names no pool.
    """
    if not recipe.pool:
        raise ConfigError("stage fronts: no pool is named; render one with stage 'pool' and give its folder")
    pool = open_pool(Path(recipe.pool), recipe.pool_size, recipe.height, recipe.width, recipe.seed)
    maps, ready = open_fronts(folder, pool)
    fold_batch_norms(network)
    channels_last(network)
    order = np.random.default_rng(os.getpid()).permutation(np.flatnonzero(pool.ready))
    for index in order:
        if ready[index]:
            continue
        stacks = torch.from_numpy(pool.stacks[index].astype(np.float32) / 255).permute(0, 1, 4, 2, 3)
        with torch.inference_mode():
            seen = network.look(stacks[:1], stacks[1:], _FOCI)
            for number, cue in enumerate(CUES):
                front = network.gather(seen, _FOCI, cue != "stereo", cue != "focus")
                maps[index, number] = torch.cat((front.clues, front.offers), dim=1)[0].numpy()
        ready[index] = 1
        progress(int(ready.sum()), len(order))


_FOCI = torch.from_numpy(SLICE_DISPARITIES)


class FrontBatches:
    """Crops of the cached fronts, upside down half of the time, with one or both cues."""

    def __init__(self, pool: Pool, recipe: Recipe) -> None:
        if not recipe.fronts:
            raise ConfigError("stage refine: no fronts are named; make them with stage 'fronts' and give their folder")
        self.pool, self.recipe = pool, recipe
        self.maps, self.ready = open_fronts(Path(recipe.fronts), pool)

    def __call__(self, step: int) -> FrontBatch:
        """Pick the batch of one step.

        Raises
        ------
        ConfigError
            If too few samples are ready.
        """
        rng = np.random.default_rng([self.recipe.seed, 4, step])
        ready = np.flatnonzero(self.ready)
        if len(ready) < self.recipe.batch:
            raise ConfigError(f"fronts: {len(ready)} samples are ready, expected {self.recipe.batch} or more")
        parts = [self._sample(rng, int(i)) for i in rng.choice(ready, self.recipe.batch, replace=False)]
        maps, disparity, valid = (torch.from_numpy(np.stack(p)) for p in zip(*parts, strict=True))
        return FrontBatch(maps[:, :CLUES], maps[:, CLUES:], disparity, valid)

    def _sample(
        self, rng: np.random.Generator, index: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        height, width = self.pool.disparity.shape[2:]
        h, w = self.recipe.crop or (height, width)
        y, x = int(rng.integers(0, height - h + 1)), int(rng.integers(0, width - w + 1))
        cue = int(rng.choice(len(CUES), p=CHANCES))
        maps = self.maps[index, cue, :, y : y + h, x : x + w].astype(np.float32)
        disparity = self.pool.disparity[index, :1, y : y + h, x : x + w].astype(np.float32)
        valid = self.pool.valid[index, :1, y : y + h, x : x + w] > 0
        maps[:3] = maps[rng.permutation(3)]
        if rng.random() < 0.5:
            maps, disparity, valid = maps[:, ::-1], disparity[:, ::-1], valid[:, ::-1]
        return maps, disparity / np.float32(100 * DISPARITY_STEPS_PER_PX), valid
