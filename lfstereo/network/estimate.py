"""Two focal stacks to a disparity map with a trained network."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import torch
from torch import Tensor

from lfstereo.arrays import Float32, Rgb
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.depth.disparity import DisparityMap
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.binocular_net import FARTHEST_SEARCH_PX, FOCUS_BINS, MULTIPLE, SLICES, BinocularNet, Front
from lfstereo.network.blocks import channels_last, fold_batch_norms
from lfstereo.network.card import ModelCard
from lfstereo.network.encoding import decode, encode, exposure_of
from lfstereo.network.families import AnyNetwork
from lfstereo.network.refine_net import Refined
from lfstereo.network.shipped import DEFAULT_MODEL, find_model
from lfstereo.network.stereo_net import SEARCH_PX
from lfstereo.network.weights import load_model
from lfstereo.progress import Progress, silent

LOWEST_PX = -1.0
"""Smallest focus disparity (px) that a stack may have: stereo finds nothing below 0."""
UNSURE_PX = 4.0
"""Expected error (px), the median of 5 x 5 px, above which a pixel is not valid."""


@dataclass(frozen=True, slots=True)
class Network:
    """A network ready for use: batch normalisation folded, weights in place."""

    module: AnyNetwork
    card: ModelCard
    device: str


def load_network(name: str | Path = DEFAULT_MODEL, device: Literal["auto", "cpu", "cuda"] = "auto") -> Network:
    """Load a shipped model by name, or any model folder by path.

    Parameters
    ----------
    name
        Such as ``"binocular-v3"``.
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
        Told the steps: encoded, disparity found, done.

    Returns
    -------
    DisparityMap
        ``disparity`` in px, >= 0, of the left stack's size; ``valid`` false where the network expects an error above
        :data:`UNSURE_PX`, if it tells (only the rectification knows the field of view); ``all_in_focus`` the network's
        sharp left image in the linear light of the input.

    Raises
    ------
    ShapeError
        If the stacks do not agree, or have a number of slices that the network cannot use.
    ConfigError
        If the stacks' disparities leave the range the network can find.
    """
    check_stacks(left, right, network)
    exposure = exposure_of(left.slices, right.slices)
    inputs = [encoded_stack(stack, exposure, network) for stack in (left, right)]
    progress(1, 3)
    foci = torch.from_numpy(np.asarray(left.disparities_px, np.float32)).to(network.device)
    size = left.slices.shape[1:3]
    with torch.inference_mode():
        if isinstance(network.module, BinocularNet):
            refined, front = network.module(inputs[0], inputs[1], foci)
            progress(2, 3)
            return binocular_map(refined, front, size, exposure)
        found = network.module(inputs[0], inputs[1], (float(foci[-1]), float(foci[0])))
    progress(2, 3)
    disparity = np.maximum(cropped(found.fused, size)[0] * np.float32(DISPARITY_RANGE_PX), 0)
    sharp = np.moveaxis(cropped(found.edof_left, size), 0, -1)
    progress(3, 3)
    return DisparityMap(
        disparity=np.ascontiguousarray(disparity, np.float32),
        valid=np.ones(size, bool),
        all_in_focus=np.ascontiguousarray(decode(np.clip(sharp, 0, 1), exposure)),
    )


def estimate_from_one_stack(stack: FocalStack, network: Network) -> DisparityMap:
    """Estimate disparity from one eye's focal stack alone: depth from focus by a network.

    Parameters
    ----------
    stack
        Its focus disparities set the unit of the answer, whatever they are (px, or slices). Valid is where the network
        expects an error of a slice or less, or of :data:`UNSURE_PX` of 96 steps where slices are denser.
    network
        Of the binocular family.

    Raises
    ------
    ConfigError
        If the network needs two stacks.
    ShapeError
        If the number of slices is not one that it can use.
    """
    module = _binocular(network, "one stack alone")
    _check_count(len(stack.disparities_px), module, stack.source)
    exposure = exposure_of(stack.slices)
    own = np.asarray(stack.disparities_px, np.float32)
    per_bin = float(own[0] - own[-1]) / (FOCUS_BINS - 1)
    foci = torch.from_numpy((own - own[-1]) / np.float32(per_bin)).to(network.device)
    with torch.inference_mode():
        refined, front = module(encoded_stack(stack, exposure, network), None, foci)
    slice_px = (FOCUS_BINS - 1) / (len(own) - 1)
    found = binocular_map(refined, front, stack.slices.shape[1:3], exposure, max(UNSURE_PX, slice_px))
    assert found.uncertainty_px is not None
    return DisparityMap(
        disparity=found.disparity * np.float32(per_bin) + own[-1],
        valid=found.valid,
        all_in_focus=found.all_in_focus,
        uncertainty_px=found.uncertainty_px * np.float32(per_bin),
    )


def estimate_from_pictures(left: Rgb, right: Rgb, near_px: float, network: Network) -> DisparityMap:
    """Estimate disparity from two rectified pictures, sharp everywhere: plain stereo by the same network.

    Parameters
    ----------
    left, right
        ``(V, U, 3)`` linear RGB.
    near_px
        Largest disparity to look for.
    network
        Of the binocular family.

    Raises
    ------
    ConfigError
        If the network needs stacks, or ``near_px`` is beyond what it can find.
    ShapeError
        If the pictures differ in size.
    """
    module = _binocular(network, "two pictures")
    if left.shape != right.shape:
        raise ShapeError(f"pictures of shape {left.shape} and {right.shape}, expected the same; rectify them")
    if not 0 < near_px <= FARTHEST_SEARCH_PX:
        raise ConfigError(f"near_px = {near_px}, expected above 0 and at most {FARTHEST_SEARCH_PX:.0f}")
    exposure = exposure_of(left, right)
    inputs = [network_input(encode(picture[None], exposure), MULTIPLE).to(network.device) for picture in (left, right)]
    with torch.inference_mode():
        refined, front = module(inputs[0], inputs[1], torch.tensor([near_px], device=network.device))
    return binocular_map(refined, front, left.shape[:2], exposure)


def binocular_map(
    refined: Refined, front: Front, size: tuple[int, int], exposure: float, unsure_px: float = UNSURE_PX
) -> DisparityMap:
    """Cut what the binocular network found to the picture's size, and say where it expects ``unsure_px`` or less."""
    error = np.ascontiguousarray(np.exp(cropped(refined.log_error, size)[0]), np.float32)
    sharp = np.moveaxis(cropped(front.sharp, size), 0, -1)
    return DisparityMap(
        disparity=np.maximum(cropped(refined.disparity, size)[0], 0),
        valid=cv2.medianBlur(error, 5) <= unsure_px,
        all_in_focus=np.ascontiguousarray(decode(np.clip(sharp, 0, 1), exposure)),
        uncertainty_px=error,
    )


def _binocular(network: Network, given: str) -> BinocularNet:
    if not isinstance(network.module, BinocularNet):
        raise ConfigError(
            f"{network.card.name}: needs two focal stacks, found {given}; use a model of the binocular family"
        )
    return network.module


def check_stacks(left: FocalStack, right: FocalStack, network: Network) -> None:
    """Refuse stacks that the network cannot use.

    Raises
    ------
    ShapeError
        For different sizes or focus disparities, a number of slices or a spacing that the network cannot use.
    ConfigError
        For disparities outside the range it can find.
    """
    where = f"{left.source}, {right.source}"
    if left.slices.shape != right.slices.shape:
        raise ShapeError(f"{where}: stacks of shape {left.slices.shape} and {right.slices.shape}, expected the same")
    _check_count(len(left.disparities_px), network.module, where)
    if not np.allclose(left.disparities_px, right.disparities_px, atol=0.01):
        worst = float(np.abs(left.disparities_px - right.disparities_px).max())
        raise ShapeError(f"{where}: focus disparities differ by up to {worst:.2f} px; refocus both at the same ones")
    any_spacing = isinstance(network.module, BinocularNet)
    steps = np.diff(left.disparities_px)
    if not any_spacing and np.ptp(steps) > 0.02 * np.abs(steps).max():
        raise ShapeError(
            f"{where}: focus disparities are spaced {-steps.max():.2f} to {-steps.min():.2f} px; use even steps"
        )
    far, near = float(left.disparities_px[-1]), float(left.disparities_px[0])
    farthest = FARTHEST_SEARCH_PX if any_spacing else SEARCH_PX
    if near > farthest or far < LOWEST_PX:
        raise ConfigError(
            f"{where}: focus disparities from {far:.1f} to {near:.1f} px, "
            f"expected within {LOWEST_PX:.0f} to {farthest:.0f}; "
            "rectify with another disparity offset, or at a lower resolution"
        )


def _check_count(found: int, module: AnyNetwork, where: str) -> None:
    fewest, most = slice_limits(module)
    if not fewest <= found <= most:
        wanted = f"{fewest}" if fewest == most else f"{fewest} to {most}"
        raise ShapeError(f"{where}: {found} slices, expected {wanted}; refocus the light fields at as many disparities")


def slice_limits(module: AnyNetwork) -> tuple[int, int]:
    """Return the smallest and the largest number of slices that a network takes."""
    if isinstance(module, BinocularNet):
        return SLICES
    return module.architecture.slices, module.architecture.slices


def encoded_stack(stack: FocalStack, exposure: float, network: Network) -> Tensor:
    """Return a stack as the network takes it, ``(1, K, 3, H, W)``, on its device."""
    multiple = MULTIPLE if isinstance(network.module, BinocularNet) else network.module.architecture.multiple
    return network_input(encode(stack.slices, exposure), multiple).to(network.device)


def network_input(display: Float32, multiple: int) -> Tensor:
    """Return ``(1, K, 3, H, W)`` of ``(K, V, U, 3)``, extended by reflection to the right and below to multiples."""
    _, height, width, _ = display.shape
    below, beside = -height % multiple, -width % multiple
    padded = np.pad(display, ((0, 0), (0, below), (0, beside), (0, 0)), mode="symmetric")
    return torch.from_numpy(padded).permute(0, 3, 1, 2)[None]


def cropped(maps: Tensor, size: tuple[int, int]) -> Float32:
    """Return the maps of the first sample, ``(C, height, width)``, without what was added at the borders."""
    return np.asarray(maps[0, :, : size[0], : size[1]].float().cpu().numpy(), np.float32)
