"""How a pixel looks, for the plainest comparison of two: brightness and slopes of the three colours.

References
----------
Hirschmüller, Scharstein, "Evaluation of stereo matching costs on images with radiometric differences" (2009): absolute
differences as the cost of a match. Slopes, cut off, are compared beside brightness: they survive a change of exposure
and say most where brightness says little.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

_STEEPEST = 0.06
"""Most that the slope of a Sobel window, whose weights sum to 4 on either side, counts."""


def appearance_vectors(image: Tensor, weight: float) -> Tensor:
    """Describe every pixel by nine numbers; the sum of absolute differences of two says how much they differ.

    Parameters
    ----------
    image
        ``(B, 3, H, W)``, 0 to 1, display-referred.
    weight
        Of a difference of 1 in one colour.

    Returns
    -------
    Tensor
        ``(B, 9, H, W)``: red, green, blue, their slopes in x, their slopes in y.
    """
    across = image.new_tensor([[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]])
    kernels = torch.stack((across, across.T))[:, None]
    padded = F.pad(image, (1, 1, 1, 1), mode="reflect").flatten(0, 1)[:, None]
    slopes = F.conv2d(padded, kernels).clamp(-_STEEPEST, _STEEPEST)
    slopes = slopes.view(image.shape[0], 3, 2, *image.shape[2:]).transpose(1, 2).flatten(1, 2)
    return weight * torch.cat((image, slopes), dim=1)
