"""Focus-Net (one stack to disparity by focus alone) and Focus-Net-Guided (refined by the all-in-focus image).

References
----------
Guo, Chen, Li, Yang, Yu, "Deep Eyes: Binocular Depth-from-Focus on Focal Stack Pairs" (2017), Focus-Net and
Focus-Net-Guided. The paper gives no table of layers; branch strides 1, 2, 4, 8 follow from its "multiple of 8".
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, DeconvBlock, initialise
from lfstereo.network.stereo_net import Prediction

STRIDES = (1, 2, 4, 8)


class FocusNet(nn.Module):
    """The paper's four branches with strides 1, 2, 4, 8 over the concatenated slices, joined at full resolution.

    Parameters
    ----------
    width
        Width b; the branch of stride s has ``b s`` channels.
    slices
        Slices of the stack.
    """

    def __init__(self, width: int = 16, slices: int = 16) -> None:
        super().__init__()
        self.branches = nn.ModuleList(_branch(3 * slices, width, stride) for stride in STRIDES)
        self.join = nn.Sequential(
            ConvBlock(len(STRIDES) * width, width),
            ConvBlock(width, width),
            ConvBlock(width, width),
            nn.Conv2d(width, 1, 3, 1, 1),
        )
        initialise(self)
        for name, weight in self.branches.named_parameters():
            if name.endswith(".0.conv.weight"):  # the convolution by which a branch begins
                _start_from_differences(weight, slices)

    def forward(self, stack: Tensor) -> Prediction:
        """Turn ``(B, K, 3, H, W)``, sizes multiples of 8, into the fraction of the stack's disparity range."""
        x = stack.flatten(1, 2) - 0.5
        return Prediction((self.join(torch.cat([branch(x) for branch in self.branches], dim=1)),))


def _branch(inputs: int, width: int, stride: int) -> nn.Sequential:
    channels = width * stride
    enter = ConvBlock(inputs, channels) if stride == 1 else ConvBlock(inputs, channels, 2 * stride + 1, stride)
    leave = ConvBlock(channels, width) if stride == 1 else DeconvBlock(channels, width, stride)
    return nn.Sequential(enter, *(ConvBlock(channels, channels) for _ in range(4)), leave)


@torch.no_grad()
def _start_from_differences(weight: Tensor, slices: int) -> None:
    """Let the first filters start blind to what all slices share, which otherwise drowns the differences of focus."""
    per_slice = weight.view(weight.shape[0], slices, 3, *weight.shape[2:])
    per_slice -= per_slice.mean(dim=1, keepdim=True)


class PlainStack(nn.Module):
    """Ten 3 x 3 convolutions to one map: the tail of Focus-Net-Guided and of BDfF-Net.

    Parameters
    ----------
    inputs
        Channels that come in; the first one is the map to be improved.
    width
        Width f.
    residual
        Add the first channel to the output. Not in the paper; with it an untrained tail changes nothing.
    """

    def __init__(self, inputs: int, width: int = 16, residual: bool = True) -> None:
        super().__init__()
        self.residual = residual
        last = nn.Conv2d(width, 1, 3, 1, 1)
        self.body = nn.Sequential(ConvBlock(inputs, width), *(ConvBlock(width, width) for _ in range(8)), last)
        initialise(self)
        if residual:
            nn.init.normal_(last.weight, std=1e-3)

    def forward(self, *parts: Tensor) -> Tensor:
        """Concatenate ``(B, c, H, W)`` parts and return ``(B, 1, H, W)``."""
        x = torch.cat(parts, dim=1)
        out: Tensor = self.body(x)
        return out + x[:, :1] if self.residual else out
