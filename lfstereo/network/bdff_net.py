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

from torch import Tensor, nn

from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.network.edof_net import EdofNet
from lfstereo.network.focus_net import FocusNet, PlainStack
from lfstereo.network.stereo_net import Prediction, StereoNet
from lfstereo.network.volume_net import FocusVolumeNet
from lfstereo.options import option


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
    fusion_guide: bool = option(True, "show the left all-in-focus image to the fusion as well")

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
        self.fusion = PlainStack(5 if architecture.fusion_guide else 2, tail, wide)

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
        focus = to_range(self.focus(left).final, range_px)
        guided = self.guided(focus, edof_left - 0.5)
        stereo = self.stereo(edof_left, edof_right)
        return PairPrediction(edof_left, focus, guided, stereo, self.fuse(stereo.final, guided, edof_left))

    def fuse(self, stereo: Tensor, guided: Tensor, edof_left: Tensor) -> Tensor:
        """Join the two maps."""
        parts = (stereo, guided, edof_left - 0.5) if self.architecture.fusion_guide else (stereo, guided)
        fused: Tensor = self.fusion(*parts)
        return fused


def to_range(fraction: Tensor, range_px: tuple[float, float]) -> Tensor:
    """Turn a fraction of the stack's range into disparity / 100 px."""
    far, near = range_px
    return (far + fraction * (near - far)) / DISPARITY_RANGE_PX
