"""How well each slice of a stack is in focus at each pixel, and the all-in-focus image that follows from it.

Every slice is judged by the same weights, and convolutions along the focus axis compare neighbours; so any number of
slices will do, and what a slice's score means is the slice's own disparity. Scores are made at a quarter of the
resolution; the sharp image weighs slices at half resolution, where it adds what the local contrast says.

References
----------
Yang, Huang, Zhou, "Deep depth from focus with differential focus volume" (2022): the focus volume.
Nayar, Nakagawa, "Shape from focus" (1994), eq. 6: the modified Laplacian.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, initialise

_FLOOR = 3e-3
"""Contrast (of 1.0) of noise; below it nothing is told from the Laplacian."""


@dataclass(frozen=True, slots=True)
class Focused:
    """What the slices tell of one eye."""

    scores: Tensor
    """``(B, K, H / 4, W / 4)`` logits over the slices."""
    sharp: Tensor
    """``(B, 3, H, W)`` all-in-focus image."""


class SliceScores(nn.Module):
    """A stack ``(B, K, 3, H, W)`` in 0 to 1 to scores and a sharp image; ``H`` and ``W`` multiples of 16.

    Parameters
    ----------
    width
        Channels per slice of the volume.
    """

    kernels: Tensor

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        self.encoder = nn.Sequential(ConvBlock(3, 12, 3, 2), ConvBlock(12, width - 2, 3, 2))
        self.fine = ConvBlock(width, width)
        self.coarse = nn.ModuleList(FocusBlock(width) for _ in range(3))
        self.coarsest = nn.ModuleList(FocusBlock(width) for _ in range(2))
        self.narrow = ConvBlock(3 * width, width, 1)
        self.join = FocusBlock(width)
        self.score = nn.Conv2d(width, 1, 1)
        self.contrast = nn.Parameter(torch.tensor([2.0, 1.0]))
        across = torch.tensor([[0.0, 0, 0], [-1, 2, -1], [0, 0, 0]])
        self.register_buffer("kernels", torch.stack((across, across.T)).unsqueeze(1), persistent=False)
        initialise(self)

    def forward(self, stack: Tensor) -> Focused:
        """Score the slices of one eye."""
        batch, count = stack.shape[:2]
        grey = stack.mean(2)
        change = (grey - grey.mean(1, keepdim=True)).flatten(0, 1).unsqueeze(1)
        padded = F.pad(grey.flatten(0, 1).unsqueeze(1), (1, 1, 1, 1), mode="replicate")
        bends = F.conv2d(padded, self.kernels).abs()
        contrast = F.avg_pool2d(bends.sum(1, keepdim=True), 2)
        told = self.encoder(torch.cat((4.0 * change, 10.0 * bends), dim=1))
        x = self.fine(torch.cat((told, _log_contrast(contrast, batch, count)), dim=1))
        y = F.avg_pool2d(x, 2)
        for block in self.coarse:
            y = y + block(y, count)
        z = F.avg_pool2d(y, 2)
        for block in self.coarsest:
            z = z + block(z, count)
        x = self.join(self.narrow(torch.cat((x, _enlarged(y, 2), _enlarged(z, 4)), dim=1)), count)
        scores = self.score(x).view(batch, count, *x.shape[2:])
        return Focused(scores, self._sharp(stack, scores, contrast))

    def _sharp(self, stack: Tensor, scores: Tensor, contrast: Tensor) -> Tensor:
        """Weigh the slices: half-resolution weights, full-resolution pictures."""
        local = torch.log(F.avg_pool2d(contrast, 3, 1, 1, count_include_pad=False) + _FLOOR)
        local = local.view(*stack.shape[:2], *local.shape[2:])
        weight = F.softmax(self.contrast[0] * local + self.contrast[1] * _enlarged(scores, 2), dim=1)
        return torch.einsum("bkhw,bkchw->bchw", _enlarged(weight, 2), stack)


class FocusBlock(nn.Module):
    """3 x 3 px within each slice, then 3 slices at each pixel, each with normalisation and PReLU."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.within = ConvBlock(channels, channels)
        self.across = ConvBlock(2 * channels, channels, 1)

    def forward(self, x: Tensor, count: int) -> Tensor:
        """Return ``(B K, C, h, w)`` of the same shape; the end slices are repeated."""
        x = self.within(x)
        volume = x.view(-1, count, *x.shape[1:])
        padded = torch.cat((volume[:, :1], volume, volume[:, -1:]), dim=1)
        bend = (2 * volume - padded[:, :-2] - padded[:, 2:]).flatten(0, 1)
        out: Tensor = self.across(torch.cat((x, bend), dim=1))
        return out


def _log_contrast(contrast: Tensor, batch: int, count: int) -> Tensor:
    """Log contrast over 4 px and 20 px, relative to the mean over the slices: ``(B K, 2, H / 4, W / 4)``."""
    fine = F.avg_pool2d(contrast, 2)
    wide = F.avg_pool2d(fine, 5, 1, 2, count_include_pad=False)
    both = torch.log(torch.cat((fine, wide), dim=1) + _FLOOR)
    both = both.view(batch, count, *both.shape[1:])
    return (both - both.mean(1, keepdim=True)).flatten(0, 1)


def _enlarged(x: Tensor, factor: int) -> Tensor:
    return F.interpolate(x, scale_factor=factor, mode="bilinear", align_corners=False)
