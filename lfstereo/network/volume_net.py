"""Focus volume: the same task as Focus-Net, with the focus axis kept as an axis.

Not in the paper. The paper's Focus-Net concatenates the slices and must learn by itself that channel 3 k belongs to
slice k; with minutes of training it stays at chance. Here each slice is scored by the same weights and the best slice
is read out as an expected value, so the sharpness of a slice and its disparity are tied from the first step.

References
----------
Yang, Huang, Zhou, "Deep depth from focus with differential focus volume" (2022): the focus volume.
Nayar, Nakagawa, "Shape from focus" (1994), eq. 6: the modified Laplacian.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, initialise
from lfstereo.network.stereo_net import Prediction
from lfstereo.network.volume import VolumeAggregation, soft_argmax

_MEASURES = 2
_LEARNED = 6


class FocusVolumeNet(nn.Module):
    """A stack ``(B, K, 3, H, W)`` to the fraction of its disparity range; sizes multiples of 64.

    Parameters
    ----------
    width
        Width b; the hourglass has ``4 b`` channels at a quarter of the resolution.
    slices
        Slices of the stack, near to far.
    """

    fractions: Tensor

    def __init__(self, width: int = 16, slices: int = 16) -> None:
        super().__init__()
        self.encoder = nn.Sequential(
            ConvBlock(4, width, 5, 2), ConvBlock(width, width, 3, 2), nn.Conv2d(width, _LEARNED, 1)
        )
        self.aggregate = VolumeAggregation(_MEASURES + _LEARNED, slices, 2 * _LEARNED, 4 * width, depth=4, stacks=1)
        self.register_buffer("fractions", torch.linspace(1, 0, slices), persistent=False)
        initialise(self)

    def forward(self, stack: Tensor) -> Prediction:
        """Return a map and its logits for each stage of the aggregation."""
        batch, count = stack.shape[:2]
        sharpness = modified_laplacian(stack.flatten(0, 1).mean(1, keepdim=True))
        learned = self.encoder(torch.cat((stack.flatten(0, 1) - 0.5, 10.0 * sharpness - 0.2), dim=1))
        learned = learned.view(batch, count, *learned.shape[1:]).transpose(1, 2)
        volume = torch.cat((_measures(sharpness, batch, count), learned - learned.mean(2, keepdim=True)), dim=1)
        guide = torch.cat((learned.mean(2), learned.amax(2)), dim=1)
        logits, _ = self.aggregate(volume, guide)
        maps = [
            F.interpolate(soft_argmax(scores, self.fractions), scale_factor=4, mode="bilinear", align_corners=False)
            for scores in logits
        ]
        return Prediction(tuple(maps), tuple(logits))


def modified_laplacian(grey: Tensor) -> Tensor:
    """Return ``|2 g - left - right| + |2 g - up - down|`` of ``(N, 1, H, W)``.

    Examples
    --------
    >>> spot = torch.zeros(1, 1, 5, 5); spot[0, 0, 2, 2] = 1.0
    >>> float(modified_laplacian(spot)[0, 0, 2, 2])
    4.0
    """
    padded = F.pad(grey, (1, 1, 1, 1), mode="replicate")
    centre = 2 * grey
    across = (centre - padded[..., 1:-1, :-2] - padded[..., 1:-1, 2:]).abs()
    return across + (centre - padded[..., :-2, 1:-1] - padded[..., 2:, 1:-1]).abs()


def _measures(sharpness: Tensor, batch: int, count: int) -> Tensor:
    """Log sharpness over 4 px and 20 px, relative to the mean over the slices: ``(B, 2, K, H / 4, W / 4)``."""
    fine = F.avg_pool2d(sharpness, 4)
    wide = F.avg_pool2d(fine, 5, 1, 2, count_include_pad=False)
    both = torch.log(torch.cat((fine, wide), dim=1) + 3e-3)
    both = both.view(batch, count, *both.shape[1:]).transpose(1, 2)
    return both - both.mean(2, keepdim=True)
