"""Stacks of planes facing the camera: where a network that gets its slices as channels learns what focus is.

A crop of a sharp picture is set at one disparity and blurred for each slice, so that the whole crop says one thing.
Concatenated slices hold no hint that sharpness matters: on full scenes Focus-Net's four branches are no better than a
constant after minutes of a processor, on these planes they halve its error in the same time.
"""

from __future__ import annotations

import cv2
import numpy as np
import torch

from lfstereo.arrays import Float32
from lfstereo.errors import ConfigError
from lfstereo.training.batches import Batch
from lfstereo.training.pool import Pool

BLUR_PX = (3.0, 10.0)
"""Standard deviation (px) of the blur across the whole range of disparities, least and most."""
NOISE = 0.01
FLAT = 0.05
"""Crops with a smaller standard deviation show nothing to focus on."""
_SHARP_PX = 0.15
_TRIES = 50


class PlaneBatches:
    """Left stacks of single planes made from a pool's sharp pictures; batch ``n`` depends on the seed and ``n`` alone.

    Parameters
    ----------
    pool
        Rendered samples; only their sharp pictures are used.
    seed
        Decides crops and disparities.
    batch
        Planes per batch.
    crop
        Height and width, px.
    """

    def __init__(self, pool: Pool, seed: int, batch: int, crop: tuple[int, int]) -> None:
        self.pool, self.seed, self.batch, self.crop = pool, seed, batch, crop

    def __call__(self, step: int) -> Batch:
        """Pick and blur the batch of one step.

        Raises
        ------
        ConfigError
            If the pool has no rendered sample.
        """
        ready = np.flatnonzero(self.pool.ready)
        if not len(ready):
            raise ConfigError("pool: 0 samples are rendered, expected 1 or more; fill it first")
        rng = np.random.default_rng([self.seed, 4, step])
        disparity = rng.random(self.batch, dtype=np.float32)
        pictures = [self._picture(rng, ready) for _ in range(self.batch)]
        slices = self.pool.stacks.shape[2]
        stacks = np.stack(
            [plane_stack(rng, p, float(d), slices) for p, d in zip(pictures, disparity, strict=True)],
        )
        sharp = torch.from_numpy(np.stack(pictures)).movedim(-1, 1).contiguous()
        truth = torch.from_numpy(disparity)[:, None, None, None].expand(-1, 1, *self.crop)
        valid = torch.ones(truth.shape, dtype=torch.bool)
        empty = torch.empty(0)
        return Batch(sharp, empty, truth, valid, torch.from_numpy(stacks).movedim(-1, 2).contiguous(), empty)

    def _picture(self, rng: np.random.Generator, ready: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Float32:
        height, width = self.crop
        sharp = self.pool.sharp
        for _ in range(_TRIES):
            index, eye = int(rng.choice(ready)), int(rng.integers(2))
            row = int(rng.integers(sharp.shape[2] - height + 1))
            column = int(rng.integers(sharp.shape[3] - width + 1))
            picture = sharp[index, eye, row : row + height, column : column + width].astype(np.float32) / 255
            if picture.std() > FLAT:
                break
        return np.asarray(picture[..., rng.permutation(3)], np.float32)


def plane_stack(rng: np.random.Generator, picture: Float32, disparity: float, slices: int) -> Float32:
    """Blur a picture as if it stood at one disparity.

    Parameters
    ----------
    rng
        Decides blur and noise.
    picture
        ``(H, W, 3)`` sharp.
    disparity
        Disparity / 100 px, 0 to 1.
    slices
        Focused at 1 to 0, evenly spaced.

    Returns
    -------
    Float32
        ``(slices, H, W, 3)``.
    """
    full, noise = np.exp(rng.uniform(*np.log(BLUR_PX))), rng.uniform(0, NOISE)
    out = np.empty((slices, *picture.shape), np.float32)
    for slice_, focus in zip(out, np.linspace(1, 0, slices), strict=True):
        sigma = full * abs(disparity - focus)
        blurred = (
            picture if sigma < _SHARP_PX else cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
        )
        slice_[:] = blurred + noise * rng.standard_normal(picture.shape, dtype=np.float32)
    return out
