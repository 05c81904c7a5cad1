"""One eye's picture in the light of the other: what gain and offset of each colour make matched pixels agree."""

from __future__ import annotations

import torch
from torch import Tensor

_ROUNDS = 4
_LARGEST_GAIN = 4.0
_FEWEST_SHARE = 0.02
_TRUST_IN_NONE = 1e-4
"""Variance (display-referred) at which a colour says as much of its gain as is assumed before: none."""
_CUT = 1.5
_LEAST_RESIDUAL = 1e-3


def fitted_light(wanted: Tensor, given: Tensor, counted: Tensor) -> tuple[Tensor, Tensor]:
    """Fit ``wanted = gain * given + offset`` robustly, every colour by itself.

    Parameters
    ----------
    wanted, given
        ``(C, N)``.
    counted
        ``(N,)`` bool: which pixels are matched.

    Returns
    -------
    tuple
        ``(C,)`` gain and offset; 1 and 0 for all where too few pixels are matched or a gain could not be.

    References
    ----------
    Holland, Welsch, "Robust regression using iteratively reweighted least-squares" (1977): Cauchy's weights.
    """
    gain, offset = wanted.new_ones(len(wanted)), wanted.new_zeros(len(wanted))
    if counted.sum() < _FEWEST_SHARE * counted.numel():
        return gain, offset
    x, y = given[:, counted], wanted[:, counted]
    weight = torch.ones_like(x)
    for _ in range(_ROUNDS):
        total = weight.sum(1, keepdim=True)
        mean_x, mean_y = (weight * x).sum(1, keepdim=True) / total, (weight * y).sum(1, keepdim=True) / total
        shared = (weight * (x - mean_x) * (y - mean_y)).sum(1, keepdim=True) / total
        own = (weight * (x - mean_x).square()).sum(1, keepdim=True) / total
        slope = (shared + _TRUST_IN_NONE) / (own + _TRUST_IN_NONE)
        level = mean_y - slope * mean_x
        residual = (y - slope * x - level).abs()
        scale = _CUT * residual.median(1, keepdim=True).values + _LEAST_RESIDUAL
        weight = 1 / (1 + (residual / scale).square())
    if (slope > _LARGEST_GAIN).any() or (slope < 1 / _LARGEST_GAIN).any():
        return gain, offset
    return slope[:, 0], level[:, 0]
