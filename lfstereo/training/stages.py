"""What each training stage trains and on what loss."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from lfstereo.network.bdff_net import BdffNet
from lfstereo.network.families import AnyNetwork
from lfstereo.network.stereo_net import BIN_PX, Prediction
from lfstereo.training.batches import Batch
from lfstereo.training.binocular_losses import match_loss, refine_loss, slices_loss
from lfstereo.training.losses import image_loss, mean_absolute, staged_loss

PARTS = ("edof", "focus", "guided", "stereo", "fusion")
"""Parts of the published networks."""

TRAINED: dict[str, tuple[str, ...]] = {
    "stereo": ("stereo",),
    "edof": ("edof",),
    "focus_planes": ("focus",),
    "focus": ("focus",),
    "guided": ("guided",),
    "stereo_stacks": ("stereo",),
    "fusion": ("fusion",),
    "joint": PARTS,
    "match": ("descriptors",),
    "slices": ("slices",),
    "refine": ("refine",),
}
"""Stage -> parts whose weights it changes; all others are frozen."""


def select_parts(network: AnyNetwork, stage: str) -> list[torch.nn.Parameter]:
    """Put the trained parts into training mode, freeze the others, return the parameters to be trained."""
    chosen: list[torch.nn.Parameter] = []
    for name, part in network.named_children():
        trained = name in TRAINED[stage]
        part.train(trained)
        part.requires_grad_(trained)
        if trained:
            chosen.extend(part.parameters())
    return chosen


def _stereo(network: BdffNet, batch: Batch) -> Tensor:
    return _stereo_loss(network.stereo(batch.left, batch.right), batch)


def _stereo_loss(prediction: Prediction, batch: Batch) -> Tensor:
    return staged_loss(prediction, batch.disparity, batch.valid, batch.disparity * (100.0 / BIN_PX))


def _edof(network: BdffNet, batch: Batch) -> Tensor:
    return image_loss(network.edof(batch.left_stack), batch.left, batch.valid)


def _focus_loss(prediction: Prediction, batch: Batch) -> Tensor:
    slices = batch.left_stack.shape[1]
    return staged_loss(prediction, batch.disparity, batch.valid, (1 - batch.disparity) * (slices - 1))


def _focus(network: BdffNet, batch: Batch) -> Tensor:
    return _focus_loss(network.focus(batch.left_stack), batch)


def _guided(network: BdffNet, batch: Batch) -> Tensor:
    with torch.no_grad():
        edof, focus = network.edof(batch.left_stack), network.focus(batch.left_stack).final
    return mean_absolute(network.guided(focus, edof - 0.5), batch.disparity, batch.valid)


def _stereo_stacks(network: BdffNet, batch: Batch) -> Tensor:
    with torch.no_grad():
        left, right = network.edof(batch.left_stack), network.edof(batch.right_stack)
    return _stereo_loss(network.stereo(left, right), batch)


def _fusion(network: BdffNet, batch: Batch) -> Tensor:
    return mean_absolute(network(batch.left_stack, batch.right_stack).fused, batch.disparity, batch.valid)


def _joint(network: BdffNet, batch: Batch) -> Tensor:
    found = network(batch.left_stack, batch.right_stack)
    loss = mean_absolute(found.fused, batch.disparity, batch.valid) + 0.5 * _stereo_loss(found.stereo, batch)
    loss = loss + 0.3 * mean_absolute(found.guided, batch.disparity, batch.valid)
    return loss + 0.3 * image_loss(found.edof_left, batch.left, batch.valid)


LOSSES: dict[str, Callable[[Any, Any], Tensor]] = {
    "stereo": _stereo,
    "edof": _edof,
    "focus_planes": _focus,
    "focus": _focus,
    "guided": _guided,
    "stereo_stacks": _stereo_stacks,
    "fusion": _fusion,
    "joint": _joint,
    "match": match_loss,
    "slices": slices_loss,
    "refine": refine_loss,
}
"""Stage -> loss of one batch."""
