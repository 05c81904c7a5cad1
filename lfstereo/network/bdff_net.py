"""BDfF-Net: two focal stacks to one disparity map, by focus and stereo together.

Left and right stack go through the same EDoF-Net, the two sharp images through Stereo-Net; the left stack goes through
Focus-Net and is refined with the left sharp image (Focus-Net-Guided); ten convolutions join the two disparity maps.

References
----------
Guo, Chen, Li, Yang, Yu, "Deep Eyes: Binocular Depth-from-Focus on Focal Stack Pairs" (2017), BDfF-Net.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.network.blocks import ConvBlock, initialise
from lfstereo.network.edof_net import EdofNet
from lfstereo.network.focus_net import FocusNet, PlainStack
from lfstereo.network.stereo_net import BIN_PX, BINS, Prediction, StereoNet
from lfstereo.network.volume import likeness, resample_bins, warp_right
from lfstereo.network.volume_net import FocusVolumeNet
from lfstereo.options import option

FOCUS_FLOOR = 0.03
"""Probability added to every slice before focus weighs the stereo bins: focus may be wrong."""


@dataclass(frozen=True, slots=True)
class Architecture:
    """Widths and variants of a BDfF-Net; the defaults are what is shipped."""

    slices: int = option(SLICES_DEFAULT, "slices of each focal stack")
    focus_width: int = option(16, "Focus-Net's width b")
    edof_width: int = option(16, "EDoF-Net's width c")
    tail_width: int = option(16, "width f of the ten convolutions of Focus-Net-Guided and of BDfF-Net")
    stereo_width: int = option(64, "Stereo-Net's width C")
    focus: Literal["branches", "volume"] = option("volume", "the paper's four branches, or a focus volume")
    stereo: Literal["concat", "correlation"] = option(
        "correlation", "the paper's concatenation, or a correlation volume"
    )
    residual: bool = option(True, "add the mean slice to EDoF-Net's, the input map to each tail's output")
    fusion_guide: bool = option(True, "show the fusion also the left sharp image and where each cue can be trusted")

    @property
    def multiple(self) -> int:
        """Height and width of the images must be multiples of this."""
        return 64


def paper_architecture() -> Architecture:
    """Return the widths R16 with every choice as the paper reads."""
    return Architecture(focus="branches", stereo="concat", residual=False, fusion_guide=False)


@dataclass(frozen=True, slots=True)
class PairPrediction:
    """Everything that BDfF-Net computes on the way; maps are ``(B, 1, H, W)`` disparity / 100 px."""

    edof_left: Tensor
    """``(B, 3, H, W)`` all-in-focus image, display-referred."""
    focus: Tensor
    guided: Tensor
    stereo: Prediction
    fused: Tensor


class BdffNet(nn.Module):
    """All five networks under one roof, so that one file of weights serves each of them."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        self.architecture = architecture
        wide = architecture.residual
        tail = architecture.tail_width
        self.edof = EdofNet(architecture.edof_width, architecture.slices, wide)
        focus = FocusVolumeNet if architecture.focus == "volume" else FocusNet
        self.focus = focus(architecture.focus_width, architecture.slices)
        self.guided = PlainStack(4, tail, wide)
        self.stereo = StereoNet(architecture.stereo_width, architecture.stereo)
        self.fusion: nn.Module = Blend(tail) if architecture.fusion_guide else PlainStack(2, tail, wide)

    def forward(
        self, left: Tensor, right: Tensor, range_px: tuple[float, float] = (0.0, DISPARITY_RANGE_PX)
    ) -> PairPrediction:
        """Estimate the disparity of the left view.

        Parameters
        ----------
        left, right
            ``(B, K, 3, H, W)`` display-referred slices, 0 to 1, near to far.
        range_px
            Disparity of the last (far) and of the first (near) slice. Focus only tells a fraction of this range,
            stereo tells px.
        """
        edof_left, edof_right = self.edof(left), self.edof(right)
        by_focus = self.focus(left)
        focus = to_range(by_focus.final, range_px)
        guided = self.guided(focus, edof_left - 0.5)
        prior = focus_prior(by_focus, range_px) if self.architecture.fusion_guide else None
        stereo = self.stereo(edof_left, edof_right, prior)
        if self.architecture.fusion_guide:
            joint = stereo.final if stereo.joint is None else stereo.joint
            support = _support(edof_left, edof_right, joint)
            trust = torch.cat((support, _sureness(stereo, support), _sureness(by_focus, support)), dim=1)
            fused = self.fusion(joint, guided, edof_left - 0.5, trust)
        else:
            fused = self.fusion(stereo.final, guided)
        return PairPrediction(edof_left, focus, guided, stereo, fused)


class Blend(nn.Module):
    """Ten 3 x 3 convolutions that weigh stereo against focus, and correct the weighted map.

    The published fusion maps two disparity maps to one. Here the convolutions also see the left sharp image and, per
    pixel, how well the stereo match explains the image and how sure either cue is, and they return a weight and a
    correction; untrained, the answer is nearly the map that comes in. That map is Stereo-Net's, read from its bins
    after the focus volume has weighed them (:func:`focus_prior`).
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        last = nn.Conv2d(width, 2, 3, 1, 1)
        self.body = nn.Sequential(ConvBlock(8, width), *(ConvBlock(width, width) for _ in range(8)), last)
        initialise(self)
        nn.init.normal_(last.weight, std=1e-3)

    def forward(self, stereo: Tensor, guided: Tensor, image: Tensor, trust: Tensor) -> Tensor:
        """Join ``(B, 1, H, W)`` maps; ``image`` has 3, ``trust`` 3 channels."""
        weight, correction = self.body(torch.cat((stereo, guided, image, trust), dim=1)).chunk(2, dim=1)
        share = torch.sigmoid(weight - 3.0)
        joined: Tensor = (1 - share) * stereo + share * guided + 0.1 * correction
        return joined


def focus_prior(by_focus: Prediction, range_px: tuple[float, float]) -> Tensor | None:
    """Log-probability of every stereo bin as focus sees it: two independent cues multiply.

    Returns
    -------
    Tensor
        ``(B, 27, H / 4, W / 4)``; ``None`` for a focus network without bins.
    """
    if not by_focus.logits:
        return None
    share = F.softmax(by_focus.logits[-1], dim=1)
    bins = torch.arange(BINS, device=share.device, dtype=share.dtype) * BIN_PX
    return torch.log(resample_bins(share, range_px[1], range_px[0], bins) + FOCUS_FLOOR)


@torch.no_grad()
def _support(left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
    """Likeness of each left pixel to its stereo match, -1 to 1; -1 where the match lies outside the right image."""
    shift = disparity * DISPARITY_RANGE_PX
    alike = likeness(left, warp_right(right, shift), 7)
    x = torch.arange(left.shape[3], device=left.device, dtype=left.dtype)
    return torch.where(x - shift < 0, torch.full_like(alike, -1.0), alike)


@torch.no_grad()
def _sureness(prediction: Prediction, like: Tensor) -> Tensor:
    """Highest probability of any bin, at the pictures' resolution; 0 for networks without bins."""
    if not prediction.logits:
        return torch.zeros_like(like)
    highest = F.softmax(prediction.logits[-1], dim=1).amax(1, keepdim=True)
    return F.interpolate(highest, size=like.shape[2:], mode="bilinear", align_corners=False)


def to_range(fraction: Tensor, range_px: tuple[float, float]) -> Tensor:
    """Turn a fraction of the stack's range into disparity / 100 px."""
    far, near = range_px
    return (far + fraction * (near - far)) / DISPARITY_RANGE_PX
