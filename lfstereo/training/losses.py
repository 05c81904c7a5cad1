"""Losses: mean absolute error on disparity / 100 px, cross-entropy over the bins, sharpness of the sharp image."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfstereo.network.stereo_net import Prediction

COARSE_WEIGHT = 0.3
BINS_WEIGHT = 0.02


def mean_absolute(found: Tensor, wanted: Tensor, valid: Tensor) -> Tensor:
    """Return the mean of ``|found - wanted|`` over valid pixels.

    Examples
    --------
    >>> float(mean_absolute(torch.tensor([1.0, 5.0]), torch.tensor([0.5, 0.0]), torch.tensor([True, False])))
    0.5
    """
    error = (found - wanted).abs() * valid
    return error.sum() / valid.expand_as(error).sum().clamp(min=1)


def staged_loss(prediction: Prediction, wanted: Tensor, valid: Tensor, bin_of: Tensor) -> Tensor:
    """Supervise every stage of a network with the same truth.

    Parameters
    ----------
    prediction
        Maps and, where the network has bins, logits.
    wanted, valid
        ``(B, 1, H, W)``.
    bin_of
        ``(B, 1, H, W)`` position of the truth on the bin axis, a real number.
    """
    loss = mean_absolute(prediction.final, wanted, valid)
    for coarse in prediction.maps[:-1]:
        loss = loss + COARSE_WEIGHT * mean_absolute(coarse, wanted, valid)
    for logits in prediction.logits:
        loss = loss + BINS_WEIGHT * bin_cross_entropy(logits, bin_of[:, 0, 2::4, 2::4], valid[:, 0, 2::4, 2::4])
    return loss


def bin_cross_entropy(logits: Tensor, position: Tensor, valid: Tensor) -> Tensor:
    """Cross-entropy against a truth shared linearly between its two neighbouring bins.

    Parameters
    ----------
    logits
        ``(B, bins, h, w)``.
    position
        ``(B, h, w)`` on the bin axis; clipped to it.
    valid
        ``(B, h, w)`` bool.
    """
    scores = F.log_softmax(logits, dim=1)
    position = position.clamp(0, logits.shape[1] - 1)
    lower = position.floor().clamp(max=logits.shape[1] - 2)
    share = position - lower
    index = lower.long().unsqueeze(1)
    picked = scores.gather(1, index)[:, 0] * (1 - share) + scores.gather(1, index + 1)[:, 0] * share
    return -(picked * valid).sum() / valid.sum().clamp(min=1)


def image_loss(found: Tensor, wanted: Tensor, valid: Tensor) -> Tensor:
    """Mean absolute error of an image and of its differences between neighbouring pixels."""
    loss = mean_absolute(found, wanted, valid)
    for axis in (2, 3):
        both = valid.narrow(axis, 1, valid.shape[axis] - 1) & valid.narrow(axis, 0, valid.shape[axis] - 1)
        loss = loss + mean_absolute(torch.diff(found, dim=axis), torch.diff(wanted, dim=axis), both)
    return loss
