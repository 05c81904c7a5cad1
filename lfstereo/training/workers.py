"""Where a training run computes: one process, or several under torchrun that average their gradients."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass

import torch
import torch.distributed as dist

from lfstereo.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Worker:
    """One process of a run."""

    device: torch.device
    rank: int = 0
    count: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process writes checkpoints and curves."""
        return self.rank == 0

    def agree(self, value: float) -> float:
        """Return the leader's value in every process."""
        if self.count == 1:
            return value
        shared = torch.tensor([value], dtype=torch.float64, device=self.device)
        dist.broadcast(shared, 0)
        return float(shared)


@contextlib.contextmanager
def join_workers(device: str = "auto") -> Iterator[Worker]:
    """Choose the device; under torchrun also join the other processes for the time of the ``with`` block.

    Parameters
    ----------
    device
        ``auto`` (a graphics card where there is one), ``cpu`` or ``cuda``.

    Raises
    ------
    ConfigError
        If a graphics card is asked for and there is none.
    """
    if device == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device cuda: torch finds no usable graphics card; use --device cpu")
    kind = ("cuda" if torch.cuda.is_available() else "cpu") if device == "auto" else device
    count = int(os.environ.get("WORLD_SIZE", "1"))
    local = int(os.environ.get("LOCAL_RANK", "0"))
    place = torch.device(kind, local) if kind == "cuda" else torch.device("cpu")
    if kind == "cuda":
        torch.cuda.set_device(place)
        torch.backends.cudnn.benchmark = True
        torch.set_float32_matmul_precision("high")
    if count == 1:
        yield Worker(place)
        return
    dist.init_process_group("nccl" if kind == "cuda" else "gloo")
    try:
        yield Worker(place, dist.get_rank(), count)
    finally:
        dist.destroy_process_group()
