"""Stereo-Net: two all-in-focus images to the disparity of the left one.

``fusion = "concat"`` is the paper's reading: both images concatenated, a stem to half resolution and two stacked
hourglasses of depth 5, a prediction after each. Concatenation must learn what "the same point" means, which takes far
more training than an hour of a processor gives.

``fusion = "correlation"`` deviates on purpose: the stem runs on each image by itself (siamese) down to a quarter of the
resolution, a group-wise correlation over 0 to 104 px replaces the concatenation, and the same two hourglasses (depth 4,
which reaches the same 1/64 of the resolution) work on that volume together with the left features. The disparity is
the expected bin around the most likely one; a small refinement at half resolution brings back the edges of the left
image. Half of the volume is not learned at all: normalised cross-correlation of the images themselves, which knows what
matching means before the first step and carries over to pictures unlike the training scenes.

References
----------
Guo, Chen, Li, Yang, Yu, "Deep Eyes: Binocular Depth-from-Focus on Focal Stack Pairs" (2017), Stereo-Net.
Newell, Yang, Deng, "Stacked hourglass networks for human pose estimation" (2016).
Guo et al., "Group-wise correlation stereo network" (2019), eq. 2 (the correlation variant).
Kendall et al., "End-to-end learning of geometry and context for deep stereo regression" (2017), eq. 1 (soft argmin).
Teed, Deng, "RAFT" (2020), section 3.3 (convex upsampling).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, DeconvBlock, Hourglass, Residual, initialise
from lfstereo.network.volume import (
    VolumeAggregation,
    group_correlation,
    likeness,
    likeness_volume,
    mode_mean,
    soft_argmax,
    warp_right,
)

BIN_PX = 4
BINS = 27
SEARCH_PX = float(BIN_PX * (BINS - 1))
"""Largest disparity (px) that the correlation variant can find."""
GROUPS = 4
"""Learned groups of the volume; as many again are cross-correlations: two windows at two shifts per bin."""
DILATIONS = (1, 3)
"""Of the 5 x 5 windows of the cross-correlation at half resolution: 10 and 26 px of the picture."""
LOOK_AROUND_PX = (-3.0, -1.5, 0.0, 1.5, 3.0)
"""Where, around the coarse disparity, the refinement compares the images."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """What a disparity network returns."""

    maps: tuple[Tensor, ...]
    """Disparity / 100 px, ``(B, 1, H, W)`` each, from the first stage to the final one."""
    logits: tuple[Tensor, ...] = ()
    """Scores of the disparity bins, ``(B, bins, H / 4, W / 4)`` each; empty for networks without bins."""
    joint: Tensor | None = None
    """The final map once more, with the prior; ``None`` where no prior was given or the network has no bins."""

    @property
    def final(self) -> Tensor:
        """The last map."""
        return self.maps[-1]


class StereoNet(nn.Module):
    """Two images ``(B, 3, H, W)`` in [0, 1] to disparity; ``H`` and ``W`` multiples of 64.

    Parameters
    ----------
    channels
        Width C of the hourglasses; the stem has C / 2 at half resolution.
    fusion
        How the two images meet; see the module's text.
    """

    def __init__(self, channels: int = 64, fusion: Literal["concat", "correlation"] = "correlation") -> None:
        super().__init__()
        self.body: nn.Module = _Concatenated(channels) if fusion == "concat" else _Correlated(channels)
        initialise(self)
        if isinstance(self.body, _Correlated):
            self.body.start_from_likeness()

    def forward(self, left: Tensor, right: Tensor, prior: Tensor | None = None) -> Prediction:
        """Return the predictions of every stage.

        Parameters
        ----------
        left, right
            ``(B, 3, H, W)``.
        prior
            ``(B, 27, H / 4, W / 4)`` log-probabilities of the bins from another cue, added to the scores of stereo for
            the map :attr:`Prediction.joint` alone.
        """
        out: Prediction = self.body(left - 0.5, right - 0.5, prior)
        return out


class _Concatenated(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        half = channels // 2
        self.stem = nn.Sequential(ConvBlock(6, half, 7, 2), Residual(half, half), Residual(half, channels))
        self.glasses = nn.ModuleList(
            nn.Sequential(Hourglass(channels, 5), Residual(channels, channels), ConvBlock(channels, channels, 1))
            for _ in range(2)
        )
        self.heads = nn.ModuleList(
            nn.Sequential(DeconvBlock(channels, half, 2), nn.Conv2d(half, 1, 3, 1, 1)) for _ in range(2)
        )
        self.back_features = nn.Conv2d(channels, channels, 1)
        self.back_map = nn.Conv2d(1, channels, 2, 2)

    def forward(self, left: Tensor, right: Tensor, prior: Tensor | None = None) -> Prediction:
        del prior  # this variant has no bins
        x = self.stem(torch.cat((left, right), dim=1))
        features = self.glasses[0](x)
        first = self.heads[0](features)
        second = self.heads[1](self.glasses[1](x + self.back_features(features) + self.back_map(first)))
        return Prediction((first, second))


class _Features(nn.Module):
    """One image to features at 1/2 (C / 2 channels) and 1/4 (C channels) of the resolution."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        half = channels // 2
        self.stem = nn.Sequential(ConvBlock(3, half, 7, 2), Residual(half, half))
        self.quarter = nn.Sequential(ConvBlock(half, channels, 3, 2), Residual(channels, channels))
        self.wide = nn.Sequential(
            nn.MaxPool2d(2), Residual(channels, channels), Residual(channels, channels), DeconvBlock(channels, channels)
        )
        self.out = nn.Sequential(Residual(channels, channels), nn.Conv2d(channels, channels, 1))

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        half = self.stem(image)
        quarter = self.quarter(half)
        return half, self.out(quarter + self.wide(quarter))


class _Refinement(nn.Module):
    """Quarter-resolution disparity to full resolution, guided by the images' half-resolution features."""

    def __init__(self, half: int, channels: int) -> None:
        super().__init__()
        self.context = nn.Conv2d(channels, half, 1)
        self.enter = ConvBlock(3 * half + 1 + len(LOOK_AROUND_PX), half)
        self.body = nn.Sequential(Residual(half, half), ConvBlock(half, half), Residual(half, half))
        self.residual = nn.Conv2d(half, 1, 3, 1, 1)
        self.mask = nn.Conv2d(half, 4 * 9, 1)

    def start_small(self) -> None:
        """Begin as plain upsampling."""
        for part in (self.residual, self.mask):
            nn.init.normal_(part.weight, std=1e-3)

    def forward(self, disparity: Tensor, context: Tensor, left: Tensor, right: Tensor, images: Tensor) -> Tensor:
        coarse = F.interpolate(disparity, scale_factor=2, mode="bilinear", align_corners=False)
        context = F.interpolate(self.context(context), scale_factor=2, mode="bilinear", align_corners=False)
        warped = warp_right(right, coarse * 50.0)
        x = self.body(
            self.enter(torch.cat((left, left - warped, context, coarse, _look_around(images, coarse)), dim=1))
        )
        return convex_upsample(coarse + 0.1 * self.residual(x), self.mask(x))


@torch.no_grad()
def _look_around(images: Tensor, coarse: Tensor) -> Tensor:
    """Likeness of the half-resolution images ``(2 B, 3, h, w)`` at disparities around the coarse one."""
    left, right = images.chunk(2)
    near = [likeness(left, warp_right(right, coarse * 50.0 + 0.5 * px), 5) for px in LOOK_AROUND_PX]
    return torch.cat(near, dim=1)


def convex_upsample(small: Tensor, mask: Tensor) -> Tensor:
    """Double the resolution: each new pixel is a convex mix of the nine old ones around it.

    Parameters
    ----------
    small
        ``(B, 1, h, w)``.
    mask
        ``(B, 36, h, w)`` logits: 9 neighbours for each of the 2 x 2 new pixels.
    """
    batch, _, h, w = small.shape
    weights = F.softmax(mask.view(batch, 9, 4, h, w), dim=1)
    neighbours = F.unfold(F.pad(small, (1, 1, 1, 1), mode="replicate"), 3).view(batch, 9, 1, h, w)
    return F.pixel_shuffle((weights * neighbours).sum(1), 2)


class _Correlated(nn.Module):
    bin_values: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.features = _Features(channels)
        groups = GROUPS + 2 * len(DILATIONS)
        self.aggregate = VolumeAggregation(groups, BINS, channels, channels, depth=4, stacks=2)
        self.refine = _Refinement(channels // 2, channels)
        values = torch.arange(BINS, dtype=torch.float32) * (BIN_PX / 100.0)
        self.register_buffer("bin_values", values, persistent=False)

    def start_from_likeness(self) -> None:
        """Begin as block matching with plain upsampling."""
        self.refine.start_small()
        score = self.aggregate.score.weight
        nn.init.normal_(score, std=0.02)
        with torch.no_grad():
            score[0, GROUPS:, 1, 1, 1] = 3.0

    def forward(self, left: Tensor, right: Tensor, prior: Tensor | None = None) -> Prediction:
        batch = left.shape[0]
        images = torch.cat((left, right))
        half, quarter = self.features(images)
        images = F.avg_pool2d(images, 2)
        learned = group_correlation(quarter[:batch], quarter[batch:], BINS, GROUPS)
        volume = torch.cat((learned, likeness_volume(images[:batch], images[batch:], BINS, DILATIONS)), dim=1)
        logits, context = self.aggregate(volume, quarter[:batch])
        coarse = [soft_argmax(scores, self.bin_values) for scores in logits]
        around = (context, half[:batch], half[batch:], images)
        final = self.refine(mode_mean(logits[-1], self.bin_values), *around)
        joint = None if prior is None else self.refine(mode_mean(logits[-1] + prior, self.bin_values), *around)
        full = [F.interpolate(m, scale_factor=4, mode="bilinear", align_corners=False) for m in coarse]
        return Prediction((*full, final), tuple(logits), joint)
