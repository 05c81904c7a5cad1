"""Checkpoints of a training run: weights and optimiser state as safetensors, counters as JSON; never a pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from lfstereo.errors import AssetError
from lfstereo.outputs import atomic_folder

FOLDER = "checkpoint"
WEIGHTS, OPTIMISER = "weights", "optimiser"
SHARD_BYTES = 15 * 2**20
"""No file of a checkpoint is larger, so that it passes where files are limited to 16 MiB."""


@dataclass(frozen=True, slots=True)
class Counters:
    """How far a run has come."""

    stage: str
    step: int
    elapsed_s: float
    """Time spent in training steps, over all resumed parts of the run."""


def save_checkpoint(output: Path, network: nn.Module, optimiser: torch.optim.Optimizer, counters: Counters) -> None:
    """Replace the checkpoint in a run's folder, whole or not at all."""
    with atomic_folder(output / FOLDER, force=True) as folder:
        _save_shards(network.state_dict(), folder, WEIGHTS)
        moments: dict[str, Tensor] = {}
        for index, state in optimiser.state_dict()["state"].items():
            moments.update({f"{index}.{name}": value for name, value in state.items()})
        _save_shards(moments, folder, OPTIMISER)
        (folder / "counters.json").write_text(json.dumps(asdict(counters)))


def load_checkpoint(output: Path, network: nn.Module, optimiser: torch.optim.Optimizer) -> Counters:
    """Put a run back to where its checkpoint left it.

    Raises
    ------
    AssetError
        If there is no checkpoint, or it belongs to another architecture.
    """
    folder = output / FOLDER
    network.load_state_dict(read_weights(output), strict=True)
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in _load_shards(folder, OPTIMISER).items():
        index, name = key.split(".", 1)
        state.setdefault(int(index), {})[name] = value
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": state, "param_groups": groups})
    return Counters(**json.loads((folder / "counters.json").read_text()))


def read_weights(output: Path) -> dict[str, Tensor]:
    """Return the weights of a run's checkpoint.

    Raises
    ------
    AssetError
        If there is none.
    """
    folder = output / FOLDER
    if not (weights := _load_shards(folder, WEIGHTS)):
        raise AssetError(f"{folder}: no such checkpoint; train that stage first, or start without --resume")
    return weights


def _save_shards(tensors: Mapping[str, Tensor], folder: Path, stem: str) -> None:
    """Write tensors into files of at most 15 MiB each, but for a single larger tensor."""
    shards: list[dict[str, Tensor]] = [{}]
    size = 0
    for name, tensor in tensors.items():
        tensor = tensor.detach().cpu().contiguous()
        if shards[-1] and size + tensor.nbytes > SHARD_BYTES:
            shards.append({})
            size = 0
        shards[-1][name] = tensor
        size += tensor.nbytes
    for number, shard in enumerate(shards):
        save_file(shard, folder / f"{stem}{f'-{number}' if number else ''}.safetensors")


def _load_shards(folder: Path, stem: str) -> dict[str, Tensor]:
    return {
        name: tensor for path in sorted(folder.glob(f"{stem}*.safetensors")) for name, tensor in load_file(path).items()
    }
