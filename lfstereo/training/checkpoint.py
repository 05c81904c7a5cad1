"""Checkpoints of a training run: weights and optimiser state as safetensors, counters as JSON; never a pickle."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from lfstereo.errors import AssetError
from lfstereo.outputs import atomic_folder

FOLDER = "checkpoint"


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
        save_file({k: v.contiguous() for k, v in network.state_dict().items()}, folder / "weights.safetensors")
        moments: dict[str, Tensor] = {}
        for index, state in optimiser.state_dict()["state"].items():
            moments.update({f"{index}.{name}": value.contiguous() for name, value in state.items()})
        save_file(moments, folder / "optimiser.safetensors")
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
    for key, value in load_file(folder / "optimiser.safetensors").items():
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
    path = output / FOLDER / "weights.safetensors"
    if not path.is_file():
        raise AssetError(f"{path}: no such checkpoint; train that stage first, or start without --resume")
    return dict(load_file(path))
