"""EDoF-Net: a focal stack to one image with everything in focus."""

from __future__ import annotations

from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, initialise

CONVOLUTIONS = 20
RECEPTIVE_FIELD_PX = 2 * CONVOLUTIONS + 1
"""41 px: each of the 20 convolutions of 3 x 3 adds 2."""


class EdofNet(nn.Module):
    """Twenty 3 x 3 convolutions at full resolution; receptive field exactly 41 x 41.

    Parameters
    ----------
    channels
        Width c.
    slices
        Slices of the stack.
    residual
        Add the mean of the slices to the output, so that the convolutions learn only what a mean lacks. Not in the
        paper; it makes training on a processor possible and leaves the receptive field as it is.

    References
    ----------
    Guo, Chen, Li, Yang, Yu, "Deep Eyes: Binocular Depth-from-Focus on Focal Stack Pairs" (2017), EDoF-Net: 20
    convolutions, receptive field 41 x 41, larger than the largest blur.
    """

    def __init__(self, channels: int = 16, slices: int = 16, residual: bool = True) -> None:
        super().__init__()
        self.residual = residual
        last = nn.Conv2d(channels, 3, 3, 1, 1)
        inner = (ConvBlock(channels, channels) for _ in range(CONVOLUTIONS - 2))
        self.body = nn.Sequential(ConvBlock(3 * slices, channels), *inner, last)
        initialise(self)
        if residual:
            nn.init.normal_(last.weight, std=1e-3)

    def forward(self, stack: Tensor) -> Tensor:
        """Turn ``(B, K, 3, H, W)`` display-referred slices, 0 to 1, into ``(B, 3, H, W)``."""
        out: Tensor = self.body(stack.flatten(1, 2) - 0.5)
        return out + stack.mean(1) if self.residual else out + 0.5
