"""Two focal stacks to a disparity map with a trained network."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from lfstereo.arrays import Float32
from lfstereo.depth.disparity import DisparityMap
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.bdff_net import BdffNet
from lfstereo.network.blocks import channels_last, fold_batch_norms
from lfstereo.network.card import ModelCard
from lfstereo.network.encoding import decode, encode, exposure_of
from lfstereo.network.shipped import DEFAULT_MODEL, find_model
from lfstereo.network.stereo_net import SEARCH_PX
from lfstereo.network.weights import load_model
from lfstereo.progress import Progress, silent

LOWEST_PX = -1.0
"""Smallest focus disparity (px) that a stack may have: stereo finds nothing below 0."""


@dataclass(frozen=True, slots=True)
class Network:
    """A network ready for use: batch normalisation folded, weights in place."""

    module: BdffNet
    card: ModelCard
    device: str


def load_network(name: str | Path = DEFAULT_MODEL, device: Literal["auto", "cpu", "cuda"] = "auto") -> Network:
    """Load a shipped model by name, or any model folder by path.

    Parameters
    ----------
    name
        Such as ``"bdffnet-r16-v1"``.
    device
        ``"auto"`` takes CUDA where there is any.

    Raises
    ------
    AssetError
        If the model cannot be found, is damaged, or card and weights do not belong together.
    ConfigError
        If CUDA is asked for and there is none.
    """
    if device == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device: 'cuda' was asked for, but torch finds no CUDA device; use 'auto' or 'cpu'")
    place = "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"
    module, card = load_model(find_model(name))
    fold_batch_norms(module)
    channels_last(module)
    return Network(module.to(place).requires_grad_(False), card, place)


def estimate_disparity(
    left: FocalStack, right: FocalStack, network: Network, progress: Progress = silent
) -> DisparityMap:
    """Estimate the disparity of the left view from a rectified pair of focal stacks.

    Parameters
    ----------
    left, right
        Stacks of the same size and focus disparities; linear RGB. Both are brought to one exposure.
    network
        From :func:`load_network`.
    progress
        Told the steps: encoded, sharp images made, done.

    Returns
    -------
    DisparityMap
        ``disparity`` in px, >= 0, of the left stack's size; ``valid`` true everywhere (only the rectification knows
        the field of view); ``all_in_focus`` EDoF-Net's left image in the linear light of the input.

    Raises
    ------
    ShapeError
        If the stacks do not agree, or have not as many slices as the network was made for.
    ConfigError
        If the stacks' disparities leave the range the network can find, -1 to 104 px.
    """
    check_stacks(left, right, network.module.architecture.slices)
    exposure = exposure_of(left.slices, right.slices)
    height, width = left.slices.shape[1:3]
    multiple = network.module.architecture.multiple
    inputs = [network_input(encode(stack.slices, exposure), multiple).to(network.device) for stack in (left, right)]
    progress(1, 3)
    far, near = float(left.disparities_px[-1]), float(left.disparities_px[0])
    with torch.inference_mode():
        found = network.module(inputs[0], inputs[1], (far, near))
    progress(2, 3)
    disparity = np.maximum(_to_array(found.fused)[0, :height, :width] * np.float32(100.0), 0)
    sharp = np.moveaxis(_to_array(found.edof_left)[:, :height, :width], 0, -1)
    progress(3, 3)
    return DisparityMap(
        disparity=np.ascontiguousarray(disparity, np.float32),
        valid=np.ones((height, width), bool),
        all_in_focus=np.ascontiguousarray(decode(np.clip(sharp, 0, 1), exposure)),
    )


def check_stacks(left: FocalStack, right: FocalStack, slices: int) -> None:
    """Refuse stacks that the network cannot use.

    Raises
    ------
    ShapeError
        For different sizes or focus disparities, a number of slices other than ``slices``, or uneven spacing.
    ConfigError
        For a range outside -1 to 104 px.
    """
    where = f"{left.source}, {right.source}"
    if left.slices.shape != right.slices.shape:
        raise ShapeError(f"{where}: stacks of shape {left.slices.shape} and {right.slices.shape}, expected the same")
    if len(left.disparities_px) != slices:
        raise ShapeError(
            f"{where}: {len(left.disparities_px)} slices, expected {slices}; "
            f"refocus the light fields at {slices} disparities"
        )
    if not np.allclose(left.disparities_px, right.disparities_px, atol=0.01):
        worst = float(np.abs(left.disparities_px - right.disparities_px).max())
        raise ShapeError(f"{where}: focus disparities differ by up to {worst:.2f} px; refocus both at the same ones")
    steps = np.diff(left.disparities_px)
    if np.ptp(steps) > 0.02 * np.abs(steps).max():
        raise ShapeError(
            f"{where}: focus disparities are spaced {-steps.max():.2f} to {-steps.min():.2f} px; use even steps"
        )
    far, near = float(left.disparities_px[-1]), float(left.disparities_px[0])
    if near > SEARCH_PX or far < LOWEST_PX:
        raise ConfigError(
            f"{where}: focus disparities from {far:.1f} to {near:.1f} px, "
            f"expected within {LOWEST_PX:.0f} to {SEARCH_PX:.0f}; "
            "rectify with another disparity offset, or at a lower resolution"
        )


def network_input(display: Float32, multiple: int) -> Tensor:
    """Return ``(1, K, 3, H, W)`` of ``(K, V, U, 3)``, extended by reflection to the right and below to multiples."""
    _, height, width, _ = display.shape
    below, beside = -height % multiple, -width % multiple
    padded = np.pad(display, ((0, 0), (0, below), (0, beside), (0, 0)), mode="symmetric")
    return torch.from_numpy(padded).permute(0, 3, 1, 2)[None]


def _to_array(tensor: Tensor) -> Float32:
    return np.asarray(tensor[0].float().cpu().numpy(), np.float32)
