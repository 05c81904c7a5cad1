"""Which of its neighbours a pixel outshines: what both eyes see alike, however they were exposed.

References
----------
Zabih, Woodfill, "Non-parametric local transforms for computing visual correspondence" (1994): the census transform.
Here it is soft: a difference well below the noise says little, one above it says as much as any.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

_REACH = 3
_PLACES = tuple((y, x) for y in range(7) for x in range(7) if (y + x) % 2 == 0 and (y, x) != (_REACH, _REACH))
"""Every second pixel of a window of 7 x 7."""
_SOFTNESS = 0.01
"""Difference of brightness (of 1.0) that counts three quarters."""


def census_vectors(image: Tensor) -> Tensor:
    """Describe every pixel by its 7 x 7 window.

    Parameters
    ----------
    image
        ``(B, 3, H, W)``, 0 to 1, display-referred.

    Returns
    -------
    Tensor
        ``(B, 24, H, W)`` of length at most 1; the product of two such vectors is -1 to 1.
    """
    grey = image.mean(1, keepdim=True)
    height, width = grey.shape[2:]
    padded = F.pad(grey, (_REACH,) * 4, mode="replicate")
    beside = torch.cat([padded[:, :, y : y + height, x : x + width] for y, x in _PLACES], dim=1)
    vectors: Tensor = torch.tanh((beside - grey) / _SOFTNESS) / len(_PLACES) ** 0.5
    return vectors
