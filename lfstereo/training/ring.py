"""Training samples that stay on the device: a ring of rendered stack pairs in which the newest replace the oldest.

A processor renders a pool once and learns from its file; a graphics card renders faster than a disk reads: its samples
live in its own memory and never run out. Sample ``i`` depends on the seed and ``i`` alone, and so does what the ring
holds at a step: a resumed run sees the same batches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from lfstereo.arrays import Float32
from lfstereo.progress import Progress, silent
from lfstereo.training.atlas import scene_bank
from lfstereo.training.batches import Batch, draw_variation
from lfstereo.training.device_samples import DeviceSample, device_stack_sample
from lfstereo.training.pool import DISPARITY_STEPS_PER_PX

PER_BANK = 256
"""Samples that share a bank of textures."""
GRAIN = 0.03
"""Largest standard deviation of the noise on the sharp pictures that Stereo-Net learns from."""


@dataclass(frozen=True, slots=True)
class RingSize:
    """How many samples a ring holds, how large, and how fast they are replaced."""

    count: int
    height: int
    width: int
    fresh: float
    """New samples per step."""
    textures: int
    scenes: str = "layers"
    """Kind of scene, see :data:`lfstereo.training.rooms.SCENES`."""
    atlas: str = ""
    """Folder of photographs for the textures of rooms."""


class SampleRing:
    """The samples themselves, 8 bits per value, on one device; several stages can use the same ring.

    Parameters
    ----------
    size
        See :class:`RingSize`.
    seed
        Decides every sample.
    device
        Where samples are rendered and kept.
    """

    def __init__(self, size: RingSize, seed: int, device: torch.device) -> None:
        self.size, self.seed, self.device = size, seed, device
        shape = (size.height, size.width)
        self.stacks = torch.zeros((size.count, 2, 16, 3, *shape), dtype=torch.uint8, device=device)
        self.sharp = torch.zeros((size.count, 2, 3, *shape), dtype=torch.uint8, device=device)
        self.disparity = torch.zeros((size.count, 2, *shape), dtype=torch.int16, device=device)
        self.valid = torch.zeros((size.count, 2, *shape), dtype=torch.bool, device=device)
        self.held = np.full(size.count, -1)
        """Number of the sample in each place; -1 for none."""
        self._bank: tuple[int, Float32, Tensor] | None = None

    def advance(self, step: int, progress: Progress = silent) -> None:
        """Render what the ring must hold at a step and does not hold yet."""
        newest = self.size.count + math.floor(step * self.size.fresh)
        wanted = range(newest - self.size.count, newest)
        missing = [number for number in wanted if self.held[number % self.size.count] != number]
        for done, number in enumerate(missing):
            self._put(number)
            progress(done + 1, len(missing))

    def _put(self, number: int) -> None:
        bank, textures = self._textures(number // PER_BANK)
        sample: DeviceSample = device_stack_sample(
            (self.seed, 5, number), textures, bank, self.size.height, self.size.width, self.size.scenes
        )
        place = number % self.size.count
        self.stacks[place] = (sample.stacks * 255).round().byte()
        self.sharp[place] = (sample.sharp * 255).round().byte()
        self.disparity[place] = (sample.disparity.clamp(0, 127) * DISPARITY_STEPS_PER_PX).round().short()
        self.valid[place] = sample.valid
        self.held[place] = number

    def _textures(self, number: int) -> tuple[Float32, Tensor]:
        if self._bank is None or self._bank[0] != number:
            bank = scene_bank(self.size.scenes, self.seed * 100003 + number, self.size.textures, self.size.atlas)
            self._bank = (number, bank, torch.from_numpy(bank).to(self.device))
        return self._bank[1], self._bank[2]


class RingBatches:
    """Batches from a ring, mirrored, flipped, recoloured and cropped as :class:`lfstereo.training.batches.PoolBatches`.

    Parameters
    ----------
    ring
        The samples.
    seed, batch, crop
        As for a pool.
    grain
        Largest standard deviation of noise added to the sharp pictures.
    progress
        Told about the first filling of the ring.
    """

    def __init__(
        self,
        ring: SampleRing,
        seed: int,
        batch: int,
        crop: tuple[int, int] | None,
        grain: float = 0.0,
        progress: Progress = silent,
    ) -> None:
        self.ring, self.seed, self.batch, self.crop = ring, seed, batch, crop
        self.grain, self.progress = grain, progress

    def __call__(self, step: int) -> Batch:
        """Bring the ring to the step, pick and vary its batch."""
        self.ring.advance(step, self.progress)
        rng = np.random.default_rng([self.seed, 3, step])
        places = rng.choice(self.ring.size.count, self.batch, replace=self.batch > self.ring.size.count)
        parts = [self._sample(rng, int(place)) for place in places]
        stacks, sharp, disparity, valid = (torch.stack(p) for p in zip(*parts, strict=True))
        if self.grain:
            noise = torch.Generator(self.ring.device).manual_seed(int(rng.integers(2**31)))
            level = self.grain * torch.rand((len(sharp), 1, 1, 1, 1), generator=noise, device=sharp.device)
            grain = level * torch.randn(sharp.shape, generator=noise, device=sharp.device)
            sharp = (sharp + grain).clamp(0, 1)
        return Batch(sharp[:, 0], sharp[:, 1], disparity, valid, stacks[:, 0], stacks[:, 1])

    def _sample(self, rng: np.random.Generator, place: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        ring = self.ring
        change = draw_variation(rng, (ring.size.height, ring.size.width), self.crop)
        window = (..., change.rows, change.columns)
        stacks, sharp = ring.stacks[place][window], ring.sharp[place][window]
        disparity, valid = ring.disparity[place][window], ring.valid[place][window]
        if change.mirrored:
            stacks, sharp, disparity, valid = (
                torch.flip(part, (0, part.ndim - 1)) for part in (stacks, sharp, disparity, valid)
            )
        if change.flipped:
            stacks, sharp, disparity, valid = (
                torch.flip(part, (part.ndim - 2,)) for part in (stacks, sharp, disparity, valid)
            )
        table = torch.from_numpy(change.tone).to(ring.device)
        order = torch.from_numpy(change.channels).to(ring.device)
        return (
            table[stacks[:, :, order].long()],
            table[sharp[:, order].long()],
            disparity[:1].float() / (100 * DISPARITY_STEPS_PER_PX),
            valid[:1],
        )
