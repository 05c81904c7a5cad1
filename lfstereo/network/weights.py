"""Weights on disk: safetensors beside a card, verified before they are parsed, loaded strictly.

Stored as float16, computed with as float32.
"""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load as parse
from safetensors.torch import save as serialise
from torch import Tensor

from lfstereo.errors import AssetError
from lfstereo.network.card import ModelCard, read_card, write_card
from lfstereo.network.families import AnyNetwork, build
from lfstereo.network.shipped import CARD, WEIGHTS
from lfstereo.outputs import atomic_folder

_COUNTER = "num_batches_tracked"


def save_model(folder: Path, network: AnyNetwork, card: ModelCard, force: bool = False) -> ModelCard:
    """Write a model's folder and return the card with the sha256 filled in.

    Raises
    ------
    AssetError
        If a weight is not finite as float16.
    OutputError
        If the folder exists and ``force`` is not set.
    """
    halves: dict[str, Tensor] = {}
    for name, value in network.state_dict().items():
        if name.endswith(_COUNTER):
            continue
        halves[name] = value.detach().cpu().to(torch.float16).contiguous()
        if not torch.isfinite(halves[name]).all():
            raise AssetError(f"{folder}: weight {name} is not finite as float16; train again with a lower rate")
    payload = serialise(halves)
    card = dataclasses.replace(card, sha256=hashlib.sha256(payload).hexdigest())
    with atomic_folder(folder, force) as scratch:
        (scratch / WEIGHTS).write_bytes(payload)
        (scratch / CARD).write_text(write_card(card), "utf-8")
    return card


def load_model(folder: Path) -> tuple[AnyNetwork, ModelCard]:
    """Build the network that a card describes and give it its weights; eval mode, float32, on the processor.

    Raises
    ------
    AssetError
        If a file is missing, the sha256 differs, or the weights do not fit the architecture.
    """
    card = read_card(folder / CARD)
    path = folder / WEIGHTS
    if not path.is_file():
        raise AssetError(f"{path}: no such file; take the model from a fresh copy")
    payload = path.read_bytes()
    found = hashlib.sha256(payload).hexdigest()
    if found != card.sha256:
        raise AssetError(
            f"{path}: sha256 is {found[:12]}…, expected {card.sha256[:12]}… from the card; "
            "the file is damaged or from another version, take it from a fresh copy"
        )
    state = parse_weights(payload, path)
    network = build(card.architecture)
    _fill(network, state, path)
    return network.eval(), card


def parse_weights(payload: bytes, path: Path) -> dict[str, Tensor]:
    """Return the weights of a safetensors file by name, as float32.

    Raises
    ------
    AssetError
        If it is none, or holds something else than real numbers.
    """
    try:
        state = parse(payload)
    except (SafetensorError, KeyError, RuntimeError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise AssetError(f"{path}: not a safetensors file ({reason}); take it from a fresh copy") from error
    odd = next((name for name, value in state.items() if not value.is_floating_point()), None)
    if odd is not None:
        raise AssetError(f"{path}: weight {odd[:60]!r} holds no real numbers; take it from a fresh copy")
    return {name: value.float() for name, value in state.items()}


def _fill(network: AnyNetwork, state: dict[str, Tensor], path: Path) -> None:
    wanted = network.state_dict()
    counters = {name: value for name, value in wanted.items() if name.endswith(_COUNTER)}
    names = set(wanted) - set(counters)
    if odd := sorted(names ^ set(state)):
        verb = "is missing" if odd[0] in names else "is unknown"
        raise AssetError(
            f"{path}: weight {odd[0][:60]!r} {verb} ({len(odd)} such in all); card and weights do not belong together"
        )
    for name in sorted(names):
        if state[name].shape != wanted[name].shape:
            raise AssetError(
                f"{path}: weight {name} has shape {tuple(state[name].shape)}, expected {tuple(wanted[name].shape)} "
                "from the card; card and weights do not belong together"
            )
    network.load_state_dict(state | counters, strict=True)
