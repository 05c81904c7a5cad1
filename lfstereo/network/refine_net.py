"""The disparity that aggregation found, made better: which pixels to trust, and whose disparity the others take over.

A U-Net looks at the sharp left image and at what the aggregation tells. It mixes the disparities on offer, says how far
each pixel can be trusted, and for six distances, from 32 px to 1, how much a pixel takes over from each of its eight
neighbours at that distance. A plain wall so gets the disparity of its textured rim, a half-hidden place that of the
background beside it, and edges stay edges, because values are chosen and not blurred. A small correction and the
expected error come last.

References
----------
Knutsson, Westin, "Normalized and differential convolution" (1993): averages weighted by trust.
Park et al., "Non-local spatial propagation network for depth completion" (2020), eq. 3: learned affinities.
Kendall, Gal, "What uncertainties do we need in Bayesian deep learning for computer vision?" (2017), eq. 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, initialise

CLUES = 16
"""Channels that the U-Net looks at, see :func:`lfstereo.network.clues.clue_maps`."""
OFFERS = 4
"""Disparities on offer: the best, the second best, that of focus alone, that of the background beside a gap."""
REACH_PX = (32, 16, 8, 4, 2, 1)
_CORRECTION_PX = 2.0
_NEIGHBOURS = tuple((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1))


@dataclass(frozen=True, slots=True)
class Refined:
    """What refinement returns."""

    disparity: Tensor
    """``(B, 1, H, W)`` px."""
    log_error: Tensor
    """``(B, 1, H, W)`` logarithm of the expected absolute error in px."""
    stages: tuple[Tensor, ...]
    """Earlier disparities ``(B, 1, H, W)``: as mixed, and as taken over."""


class RefineNet(nn.Module):
    """Clues ``(B, 16, H, W)`` and offers ``(B, 4, H, W)`` in px to a disparity; ``H`` and ``W`` multiples of 32.

    Parameters
    ----------
    width
        Channels at full resolution.
    """

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        widths = (width, width * 3 // 2, 2 * width, 3 * width, 4 * width, 4 * width)
        self.down = nn.ModuleList()
        inputs = CLUES
        for level, outputs in enumerate(widths):
            self.down.append(nn.Sequential(ConvBlock(inputs, outputs, 3, 1 + (level > 0)), ConvBlock(outputs, outputs)))
            inputs = outputs
        self.narrow = nn.ModuleList(ConvBlock(b, a, 1) for a, b in pairwise(widths))
        self.up = nn.ModuleList(ConvBlock(2 * a, a) for a in widths[:-1])
        self.affinity = nn.Conv2d(width, len(REACH_PX) * len(_NEIGHBOURS), 1)
        self.tell = nn.Conv2d(width, OFFERS + 3, 1)
        initialise(self)
        with torch.no_grad():
            self.affinity.weight.mul_(0.2)
            self.tell.weight.mul_(0.2)
            self.tell.bias[:] = torch.tensor([2.0, -1, -1, -1, 1, 0, 0])  # type: ignore[index]
            middle = self.affinity.bias.view(len(REACH_PX), len(_NEIGHBOURS))  # type: ignore[union-attr]
            middle[:, _NEIGHBOURS.index((0, 0))] = 4.0

    def forward(self, clues: Tensor, offers: Tensor) -> Refined:
        """Refine the disparity of the left view."""
        levels: list[Tensor] = []
        x = clues
        for block in self.down:
            x = block(x)
            levels.append(x)
        for level in range(len(levels) - 2, -1, -1):
            larger = F.interpolate(self.narrow[level](x), scale_factor=2, mode="bilinear", align_corners=False)
            x = self.up[level](torch.cat((larger, levels[level]), dim=1))
        told = self.tell(x)
        mixed = (F.softmax(told[:, :OFFERS], dim=1) * offers).sum(1, keepdim=True)
        trust = torch.sigmoid(told[:, OFFERS : OFFERS + 1]) + 1e-3
        shares = self.affinity(x).view(x.shape[0], len(REACH_PX), len(_NEIGHBOURS), *x.shape[2:])
        disparity = mixed
        for index, reach in enumerate(REACH_PX):
            disparity, trust = take_over(disparity, trust, F.softmax(shares[:, index], dim=1), reach)
        corrected = disparity + _CORRECTION_PX * torch.tanh(told[:, OFFERS + 1 : OFFERS + 2])
        return Refined(corrected, told[:, OFFERS + 2 :].clamp(-4, 5), (mixed, disparity))


def take_over(value: Tensor, trust: Tensor, shares: Tensor, reach: int) -> tuple[Tensor, Tensor]:
    """Average each pixel and its neighbours ``reach`` px away by share and trust.

    Parameters
    ----------
    value, trust
        ``(B, 1, H, W)``.
    shares
        ``(B, 9, H, W)``, summing to 1: rows from above to below, the pixel itself in the middle.
    reach
        px.

    Returns
    -------
    tuple
        The averaged value and the trust it has now.

    Examples
    --------
    >>> value, trust = torch.tensor([[[[1.0, 5.0]]]]), torch.tensor([[[[1.0, 0.0]]]])
    >>> even = torch.full((1, 9, 1, 2), 1 / 9)
    >>> take_over(value, trust, even, 1)[0].flatten().tolist()
    [1.0, 1.0]
    """
    height, width = value.shape[2:]
    both = F.pad(torch.cat((value * trust, trust), dim=1), (reach,) * 4)
    total = torch.zeros_like(both[..., :height, :width])
    for index, (dy, dx) in enumerate(_NEIGHBOURS):
        y, x = reach * (1 + dy), reach * (1 + dx)
        total = total + shares[:, index : index + 1] * both[..., y : y + height, x : x + width]
    weight = total[:, 1:].clamp(min=1e-6)
    return total[:, :1] / weight, weight
