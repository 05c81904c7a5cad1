"""Batches of training samples; batch ``n`` depends on the seed and ``n`` alone, so a resumed run sees the same ones."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lfstereo.arrays import Float32
from lfstereo.errors import ConfigError
from lfstereo.training.atlas import scene_bank
from lfstereo.training.pool import DISPARITY_STEPS_PER_PX, Pool
from lfstereo.training.samples import pair_sample

STEPS_PER_BANK = 250


@dataclass(frozen=True, slots=True)
class Batch:
    """Inputs and truth; fields that a source does not have are empty."""

    left: Tensor
    """``(B, 3, H, W)`` all-in-focus, display-referred."""
    right: Tensor
    disparity: Tensor
    """``(B, 1, H, W)`` disparity / 100 px of the left image."""
    valid: Tensor
    """``(B, 1, H, W)`` bool."""
    left_stack: Tensor
    """``(B, 16, 3, H, W)``."""
    right_stack: Tensor


class PairBatches:
    """All-in-focus pairs, rendered when asked for; never the same scene twice."""

    def __init__(
        self, seed: int, batch: int, height: int, width: int, textures: int, kind: str = "layers", atlas: str = ""
    ) -> None:
        self.seed, self.batch, self.height, self.width, self.textures = seed, batch, height, width, textures
        self.kind, self.atlas = kind, atlas
        self._bank: tuple[int, Float32] = (-1, np.empty(0, np.float32))

    def __call__(self, step: int) -> Batch:
        """Render the batch of one step."""
        number = step // STEPS_PER_BANK
        if self._bank[0] != number:
            self._bank = (number, scene_bank(self.kind, self.seed * 100003 + number, self.textures, self.atlas))
        rng = np.random.default_rng([self.seed, 1, step])
        samples = [pair_sample(rng, self._bank[1], self.height, self.width, self.kind) for _ in range(self.batch)]
        empty = torch.empty(0)
        return Batch(
            _images(np.stack([s.left for s in samples])),
            _images(np.stack([s.right for s in samples])),
            torch.from_numpy(np.stack([s.disparity for s in samples])[:, None] / np.float32(100)),
            torch.from_numpy(np.stack([s.valid for s in samples])[:, None]),
            empty,
            empty,
        )


class PoolBatches:
    """Stack pairs from a pool, mirrored, flipped, recoloured; cropped to ``crop`` (height, width) if that is given.

    ``eyes`` says for how many of the eyes, from the left, the stacks are read at all.
    """

    def __init__(
        self, pool: Pool, seed: int, batch: int, crop: tuple[int, int] | None = None, eyes: Literal[0, 1, 2] = 2
    ) -> None:
        self.pool, self.seed, self.batch, self.crop, self.eyes = pool, seed, batch, crop, eyes

    def __call__(self, step: int) -> Batch:
        """Pick and vary the batch of one step.

        Raises
        ------
        ConfigError
            If the pool has no rendered sample.
        """
        rng = np.random.default_rng([self.seed, 3, step])
        ready = np.flatnonzero(self.pool.ready)
        if len(ready) < self.batch:
            raise ConfigError(f"pool: {len(ready)} samples are rendered, expected {self.batch} or more; fill it first")
        parts = [self._sample(rng, int(i)) for i in rng.choice(ready, self.batch, replace=False)]
        stacks, sharp, disparity, valid = (torch.stack(p) for p in zip(*parts, strict=True))
        none = torch.empty(0)
        read = [stacks[:, eye] if eye < self.eyes else none for eye in (0, 1)]
        return Batch(sharp[:, 0], sharp[:, 1], disparity, valid, *read)

    def _sample(self, rng: np.random.Generator, index: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """One sample as ``(eyes, 16, 3, H, W)``, ``(2, 3, H, W)``, ``(1, H, W)``, ``(1, H, W)``."""
        stacks, sharp = self.pool.stacks[index], self.pool.sharp[index]
        disparity, valid = self.pool.disparity[index], self.pool.valid[index]
        change = draw_variation(rng, (disparity.shape[1], disparity.shape[2]), self.crop)
        rows, columns = change.rows, change.columns
        stacks, sharp = stacks[:, :, rows, columns], sharp[:, rows, columns]
        disparity, valid = disparity[:, rows, columns], valid[:, rows, columns]
        left = 0
        if change.mirrored:
            left = 1
            stacks, sharp = stacks[::-1, :, :, ::-1], sharp[::-1, :, ::-1]
            disparity, valid = disparity[..., ::-1], valid[..., ::-1]
        if change.flipped:
            stacks, sharp = stacks[:, :, ::-1], sharp[:, ::-1]
            disparity, valid = disparity[:, ::-1], valid[:, ::-1]
        return (
            torch.from_numpy(change.tone[stacks[: self.eyes, ..., change.channels]]).movedim(-1, 2).contiguous(),
            torch.from_numpy(change.tone[sharp[..., change.channels]]).movedim(-1, 1).contiguous(),
            torch.from_numpy(disparity[left : left + 1].astype(np.float32) / (100 * DISPARITY_STEPS_PER_PX)),
            torch.from_numpy(np.array(valid[left : left + 1]) > 0),
        )


@dataclass(frozen=True, slots=True)
class Variation:
    """How a rendered sample is varied before it is learnt from."""

    rows: slice
    columns: slice
    mirrored: bool
    """A mirror exchanges the eyes: the mirrored right image is the new left one."""
    flipped: bool
    """Upside down."""
    channels: NDArray[np.int64]
    """``(3,)`` order of the colours."""
    tone: Float32
    """``(256,)`` new value of each 8-bit level, 0 to 1; black stays black."""


def draw_variation(rng: np.random.Generator, size: tuple[int, int], crop: tuple[int, int] | None) -> Variation:
    """Draw the variation of a sample of ``size`` (height, width) of which ``crop`` is kept."""
    rows, columns = _window(rng, size, crop) if crop else (slice(None), slice(None))
    mirrored, flipped = rng.random() < 0.5, rng.random() < 0.5
    return Variation(rows, columns, mirrored, flipped, rng.permutation(3), _tone_curve(rng))


def _window(rng: np.random.Generator, size: tuple[int, int], crop: tuple[int, int]) -> tuple[slice, slice]:
    rows, columns = (int(rng.integers(0, whole - part + 1)) for whole, part in zip(size, crop, strict=True))
    return slice(rows, rows + crop[0]), slice(columns, columns + crop[1])


def _tone_curve(rng: np.random.Generator) -> Float32:
    """A random gamma and gain for the 256 levels; black stays black."""
    levels = np.linspace(0, 1, 256, dtype=np.float32)
    return np.asarray(np.clip(rng.uniform(0.75, 1.05) * levels ** rng.uniform(0.8, 1.25), 0, 1), np.float32)


def _images(array: Float32) -> Tensor:
    return torch.from_numpy(array).permute(0, 3, 1, 2)


def prefetched(source: Callable[[int], Batch], first: int, last: int) -> Iterator[Batch]:
    """Yield the batches of steps ``first`` to ``last - 1``, prepared by a thread one ahead."""
    ready: queue.Queue[Batch | BaseException] = queue.Queue(maxsize=2)
    stopped = threading.Event()

    def prepare() -> None:
        for step in range(first, last):
            try:
                item: Batch | BaseException = source(step)
            except BaseException as error:
                item = error
            while not stopped.is_set():
                try:
                    ready.put(item, timeout=0.2)
                    break
                except queue.Full:
                    continue
            if stopped.is_set() or isinstance(item, BaseException):
                return

    thread = threading.Thread(target=prepare, daemon=True)
    thread.start()
    try:
        for _ in range(first, last):
            item = ready.get()
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        stopped.set()
        thread.join()
