"""Losses of the three trained parts of the binocular focus volume."""

from __future__ import annotations

import torch
from torch import Tensor

from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.descriptor_net import row_logits
from lfstereo.training.batches import Batch
from lfstereo.training.fronts import CHANCES, CUES, FrontBatch
from lfstereo.training.losses import bin_cross_entropy, image_loss
from lfstereo.training.samples import SLICE_DISPARITIES

MATCH_ROWS = 24
"""Rows of every picture on which the match is judged."""
MATCH_BINS = 104
_GRAIN = 0.03
"""Largest standard deviation of the noise added to the pictures that are matched."""
_IMAGE_WEIGHT = 10.0
_MIXED_WEIGHT = 0.2
_TAKEN_WEIGHT = 0.4
_ERROR_WEIGHT = 0.2


def match_loss(network: BinocularNet, batch: Batch) -> Tensor:
    """Cross-entropy of the true disparity among all, on some rows, where both eyes see the place."""
    draw = _generator(batch)
    rows = torch.randperm(batch.left.shape[2], generator=draw)[:MATCH_ROWS].to(batch.left.device)
    pictures = torch.cat((batch.left, batch.right))
    grain = _GRAIN * torch.rand(len(pictures), 1, 1, 1, generator=draw)
    noise = grain * torch.randn(pictures.shape, generator=draw)
    described, sharpness = network.descriptors((pictures + noise.to(pictures.device)).clamp(0, 1))
    left, right = described.index_select(2, rows).chunk(2)
    logits = row_logits(left, right, sharpness.chunk(2)[0].index_select(2, rows), MATCH_BINS)
    wanted = batch.disparity[:, 0].index_select(1, rows) * DISPARITY_RANGE_PX
    counted = batch.valid[:, 0].index_select(1, rows) & seen_by_both(wanted) & (wanted < MATCH_BINS - 1)
    return bin_cross_entropy(logits, wanted, counted)


def seen_by_both(disparity: Tensor) -> Tensor:
    """Tell which pixels of the left rows the right eye sees too.

    Parameters
    ----------
    disparity
        ``(B, h, W)`` px.

    Returns
    -------
    Tensor
        ``(B, h, W)`` bool: the match lies in the picture and nothing nearer by more than 1 px lies on it.
    """
    width = disparity.shape[2]
    x = torch.arange(width, device=disparity.device, dtype=disparity.dtype)
    match = x - disparity
    column = match.round().long().clamp(0, width - 1)
    nearest = torch.zeros_like(disparity).scatter_reduce(2, column, disparity, "amax")
    return (match >= 0) & (disparity >= nearest.gather(2, column) - 1)


def slices_loss(network: BinocularNet, batch: Batch) -> Tensor:
    """Cross-entropy over the slices and error of the sharp image, with another choice of slices for every batch."""
    count = batch.left_stack.shape[1]
    stack, first, last = vary_slices(batch.left_stack, _generator(batch))
    focused = network.slices(stack)
    index = (1 - batch.disparity) * (count - 1)
    position = (index - first) / (last - first) * (stack.shape[1] - 1)
    loss = bin_cross_entropy(focused.scores, position[:, 0, 2::4, 2::4], batch.valid[:, 0, 2::4, 2::4])
    covered = batch.valid & (index > first - 0.5) & (index < last + 0.5)
    return loss + _IMAGE_WEIGHT * image_loss(focused.sharp, batch.left, covered)


def vary_slices(stack: Tensor, draw: torch.Generator) -> tuple[Tensor, int, int]:
    """Choose slices: all, every second, a part of the range, or all and those half-way between.

    Returns
    -------
    tuple
        The stack and the indices of its first and last slice among those given.
    """
    count = stack.shape[1]
    kind = float(torch.rand(1, generator=draw))
    if kind < 0.5:
        return stack, 0, count - 1
    if kind < 0.65:
        chosen = stack[:, ::2]
        return chosen, 0, 2 * (chosen.shape[1] - 1)
    if kind < 0.85:
        length = int(torch.randint(count // 2, count, (1,), generator=draw))
        first = int(torch.randint(0, count - length + 1, (1,), generator=draw))
        return stack[:, first : first + length], first, first + length - 1
    between = (stack[:, 1:] + stack[:, :-1]) / 2
    both = torch.stack((stack[:, :-1], between), dim=2).flatten(1, 2)
    return torch.cat((both, stack[:, -1:]), dim=1), 0, count - 1


def refine_loss(network: BinocularNet, batch: FrontBatch | Batch) -> Tensor:
    """Error of the disparity, plain and bounded, of its earlier stages, and of the error that is foretold.

    Stacks are scored, matched and aggregated here; fronts that were made before only need to be refined.
    """
    if isinstance(batch, Batch):
        batch = _fronts_of(network, batch)
    refined = network.refine(batch.clues, batch.offers)
    wanted = batch.disparity * DISPARITY_RANGE_PX
    error = (refined.disparity - wanted).abs()
    loss = _robust(error)
    for stage, weight in zip(refined.stages, (_MIXED_WEIGHT, _TAKEN_WEIGHT), strict=True):
        loss = loss + weight * _robust((stage - wanted).abs())
    foretold = error.detach().clamp(max=50) * torch.exp(-refined.log_error) + refined.log_error
    total: Tensor = (loss + _ERROR_WEIGHT * foretold) * batch.valid
    return total.sum() / batch.valid.sum().clamp(min=1)


def _fronts_of(network: BinocularNet, batch: Batch) -> FrontBatch:
    """Make the fronts of a batch of stacks, some of them with one cue alone."""
    draw = _generator(batch)
    foci = torch.from_numpy(SLICE_DISPARITIES).to(batch.disparity.device)
    fronts = []
    for index in range(len(batch.disparity)):
        cue = CUES[int(torch.multinomial(torch.tensor(CHANCES), 1, generator=draw))]
        right = None if cue == "focus" else batch.right_stack[index : index + 1]
        fronts.append(network.front(batch.left_stack[index : index + 1], right, foci, cue != "stereo"))
    clues, offers = (torch.cat([getattr(front, name) for front in fronts]) for name in ("clues", "offers"))
    return FrontBatch(clues, offers, batch.disparity, batch.valid)


def _robust(error: Tensor) -> Tensor:
    """Absolute error, which cares for the large ones, and a bounded one, which cares for being right within a px."""
    return 0.5 * error.clamp(max=30) + 1.5 * (error / (error + 1))


def _generator(batch: Batch) -> torch.Generator:
    """Random numbers that depend on the batch alone, so that a resumed run draws the same."""
    return torch.Generator().manual_seed(int(batch.disparity.double().sum().item() * 1000) % 2**31)
