"""The loops of :mod:`lfstereo.network.semiglobal` in torch, for graphics cards and where nothing is compiled.

The same energies, paths and read-out, to rounding; ``tests/network/test_semiglobal.py`` compares the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from lfstereo.network.penalties import Penalties

_FAR = 1e9


@dataclass(frozen=True, slots=True)
class Matched:
    """What is compared of the two eyes, left and right each ``(C, H, W)``."""

    described: tuple[Tensor, Tensor]
    """Descriptors, whose product says how well two pixels match."""
    looks: tuple[Tensor, Tensor] | None = None
    """Appearance, whose absolute difference counts against it."""


def volume_energy(
    matched: Matched | None,
    scores: Tensor | None,
    foci: Tensor,
    bins: int,
    weights: Penalties,
) -> Tensor:
    """Return the energy ``(H, W, D)`` of one pair.

    Parameters
    ----------
    matched
        What the eyes compare; ``None`` without the stereo cue.
    scores
        ``(K, H / 4, W / 4)`` of the slices; ``None`` without the focus cue.
    foci
        ``(K,)`` disparities of the slices, falling.
    bins
        Disparities, from 0.
    weights
        Of the cues.
    """
    total: Tensor | None = None
    if matched is not None:
        total = _match_energy(matched, bins, weights)
    if scores is not None:
        focus = _focus_energy(scores, foci, bins, weights, focus_slack(matched, weights))
        total = focus if total is None else total + focus
    assert total is not None
    return total


def focus_slack(matched: Matched | None, weights: Penalties) -> float:
    """Return what a slice's score may lack for nothing: nothing where focus is all there is."""
    return 0.0 if matched is None else weights.focus_slack


def _match_energy(matched: Matched, bins: int, weights: Penalties) -> Tensor:
    left, right = matched.described
    _, height, width = left.shape
    products = left.new_full((height, width, bins), -_FAR)
    for d in range(min(bins, width)):
        products[:, d:, d] = (left[:, :, d:] * right[:, :, : width - d]).sum(0)
        if matched.looks is not None:
            look, other = matched.looks
            differing = (look[:, :, d:] - other[:, :, : width - d]).abs().sum(0)
            products[:, d:, d] -= F.avg_pool2d(differing[None], 3, 1, 1, count_include_pad=False)[0]
    lacking = products.amax(2, keepdim=True) - products
    return torch.where(products > -_FAR, lacking.clamp(max=weights.match_ceiling), weights.unseen)


def _focus_energy(scores: Tensor, foci: Tensor, bins: int, weights: Penalties, slack: float) -> Tensor:
    fine = F.interpolate(scores[None], scale_factor=4, mode="bilinear", align_corners=False)[0].permute(1, 2, 0)
    values = torch.arange(bins, device=foci.device, dtype=foci.dtype)
    lower = (torch.searchsorted(-foci, -values, right=False) - 1).clamp(0, len(foci) - 2)
    share = ((foci[lower] - values) / (foci[lower] - foci[lower + 1])).clamp(0, 1)
    between = fine[..., lower] * (1 - share) + fine[..., lower + 1] * share
    lacking = fine.amax(2, keepdim=True) - between - slack
    return weights.focus_weight * lacking.clamp(0, weights.focus_ceiling)


def aggregate(energy: Tensor, guide: Tensor, weights: Penalties) -> Tensor:
    """Sum the energies along eight paths, ``(H, W, D)``; ``guide`` is the brightness ``(H, W)``."""
    both = torch.stack((energy, energy.flip(0, 1)))
    guides = torch.stack((guide, guide.flip(0, 1)))
    total = _along(both.transpose(1, 2), guides.transpose(1, 2), 0, weights).transpose(1, 2)
    for shift in (-1, 0, 1):
        total = total + _along(both, guides, shift, weights)
    return total[0] + total[1].flip(0, 1)


def _along(energy: Tensor, guide: Tensor, shift: int, weights: Penalties) -> Tensor:
    """Follow paths from the first row ``(B, H, W, D)`` to the last, each row ``shift`` columns off the one before."""
    rows = [energy[:, 0]]
    for y in range(1, energy.shape[1]):
        before, level = _moved(rows[-1], shift), _moved(guide[:, y - 1, :, None], shift)[..., 0]
        jump = (weights.large / (1 + (guide[:, y] - level).abs() / weights.edge)).clamp(min=weights.small)
        lowest = before.amin(2, keepdim=True)
        padded = F.pad(before, (1, 1), value=_FAR)
        beside = torch.minimum(padded[..., :-2], padded[..., 2:]) + weights.small
        best = torch.minimum(torch.minimum(before, beside), lowest + jump[..., None])
        follow = energy[:, y] + best - lowest
        if shift:
            edge = 0 if shift < 0 else -1
            follow[:, edge] = energy[:, y, edge]
        rows.append(follow)
    return torch.stack(rows, dim=1)


def _moved(row: Tensor, shift: int) -> Tensor:
    """Row ``(B, W, D)`` whose column x holds column ``x + shift``; 0 where there is none."""
    if shift == 0:
        return row
    pad = (0, 0, 1, 0) if shift < 0 else (0, 0, 0, 1)
    wide = F.pad(row, pad)
    return wide[:, :-1] if shift < 0 else wide[:, 1:]


def read_out(sums: Tensor, energy: Tensor) -> Tensor:
    """Return the six readings ``(6, H, W)`` of :func:`lfstereo.network.semiglobal.read_out`."""
    height, width, bins = sums.shape
    best, at = sums.min(2)
    index = torch.arange(bins, device=sums.device)
    elsewhere = torch.where((index - at[..., None]).abs() >= 2, sums, _FAR)
    second_best, second = elsewhere.min(2)
    inside = (at > 0) & (at < bins - 1)
    middle = at.clamp(1, bins - 2)[..., None]
    below, above = (sums.gather(2, middle + k)[..., 0] - best for k in (-1, 1))
    fraction = torch.where(inside, 0.5 * (below - above) / (below + above).clamp(min=1e-6), 0.0)
    cost = energy.gather(2, at[..., None])[..., 0]
    x = torch.arange(width, device=sums.device)
    source = x[:, None] + index
    across = sums.gather(1, source.clamp(max=width - 1).expand(height, -1, -1))
    other = torch.where(source < width, across, _FAR).argmin(2)
    match = x - at
    difference = (other.gather(1, match.clamp(min=0)) - at).abs()
    left_right = torch.where(match >= 0, difference, -1)
    near = (sums < best[..., None] + 8.0).sum(2) / bins
    return torch.stack((at + fraction, second, (second_best - best) / 8, cost, left_right, near)).to(sums.dtype)
