"""Descriptors of every pixel, alike in both eyes where they see the same point, and the matching of them.

A small U-Net describes each pixel by a unit vector from its surroundings of some 60 px. The product of the left
pixel's vector with the right one's at ``x - d`` says how likely disparity ``d`` is; a sharpness per left pixel turns it
into a logit, so that plain places say little. Nothing here depends on where in the disparity range a surface lies.

References
----------
Žbontar, LeCun, "Stereo matching by training a convolutional neural network to compare image patches" (2016): learned
descriptors whose dot product is the matching score (the fast architecture).
Luo, Schwing, Urtasun, "Efficient deep learning for stereo matching" (2016), eq. 1: cross-entropy over all disparities.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, initialise

DESCRIPTOR = 24
"""Length of a descriptor."""
_SHARPEST = 60.0
"""Largest factor from product to logit."""


class DescriptorNet(nn.Module):
    """An image ``(B, 3, H, W)`` in 0 to 1 to descriptors; ``H`` and ``W`` multiples of 8.

    Parameters
    ----------
    width
        Channels at full resolution; 2, 3 and 4 times as many further down.
    """

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        w1, w2, w3 = 2 * width, 3 * width, 4 * width
        self.at_full = nn.Sequential(ConvBlock(3, width), ConvBlock(width, width))
        self.at_half = nn.Sequential(ConvBlock(width, w1, 3, 2), ConvBlock(w1, w1))
        self.at_quarter = nn.Sequential(ConvBlock(w1, w2, 3, 2), ConvBlock(w2, w2))
        self.at_eighth = nn.Sequential(ConvBlock(w2, w3, 3, 2), ConvBlock(w3, w3))
        self.to_quarter = ConvBlock(w3 + w2, w2)
        self.to_half = ConvBlock(w2 + w1, w1)
        self.narrow = ConvBlock(w1, width, 1)
        self.to_full = ConvBlock(2 * width, 2 * width)
        self.describe = nn.Conv2d(2 * width, DESCRIPTOR, 1)
        self.sharpness = nn.Conv2d(2 * width, 1, 1)
        initialise(self)
        nn.init.constant_(self.sharpness.bias, 2.0)  # type: ignore[arg-type]

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Return unit descriptors ``(B, 24, H, W)`` and the sharpness ``(B, 1, H, W)``, 0 to 60."""
        full = self.at_full(image - 0.5)
        half = self.at_half(full)
        quarter = self.at_quarter(half)
        x = self.to_quarter(torch.cat((_doubled(self.at_eighth(quarter)), quarter), dim=1))
        x = self.to_half(torch.cat((_doubled(x), half), dim=1))
        x = self.to_full(torch.cat((_doubled(self.narrow(x)), full), dim=1))
        return F.normalize(self.describe(x), dim=1), _SHARPEST * torch.sigmoid(self.sharpness(x) - 2.0)


def _doubled(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


def row_logits(left: Tensor, right: Tensor, sharpness: Tensor, bins: int) -> Tensor:
    """Score every disparity of every pixel, keeping gradients; meant for some rows of a picture.

    Parameters
    ----------
    left, right
        ``(B, C, h, W)`` unit descriptors of the same rows.
    sharpness
        ``(B, 1, h, W)``.
    bins
        Disparities 0 to ``bins - 1`` px.

    Returns
    -------
    Tensor
        ``(B, bins, h, W)`` logits; very low where the right picture has no such pixel.
    """
    batch, channels, height, width = left.shape
    a = left.permute(0, 2, 3, 1).reshape(batch * height, width, channels)
    b = right.permute(0, 2, 1, 3).reshape(batch * height, channels, width)
    every = torch.bmm(a, b)
    match = torch.arange(width, device=left.device).view(-1, 1) - torch.arange(bins, device=left.device)
    picked = every.gather(2, match.clamp(min=0).expand(batch * height, -1, -1))
    picked = picked.view(batch, height, width, bins) * sharpness.permute(0, 2, 3, 1)
    return picked.masked_fill(match < 0, -1e4).permute(0, 3, 1, 2)
