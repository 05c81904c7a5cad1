"""The training loop: one stage for a number of steps or minutes, resumable to the same weights.

References
----------
Kingma, Ba, "Adam" (2015), and Loshchilov, Hutter, "Decoupled weight decay regularization" (2019): AdamW.
Smith, Topin, "Super-convergence" (2018): the one-cycle schedule.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from lfstereo.errors import ConfigError
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.blocks import channels_last
from lfstereo.network.families import AnyArchitecture, AnyNetwork, build
from lfstereo.progress import Progress, silent
from lfstereo.training.batches import Batch
from lfstereo.training.checkpoint import Counters, load_checkpoint, read_weights, save_checkpoint
from lfstereo.training.curve import Curve
from lfstereo.training.fronts import fill_fronts
from lfstereo.training.pool import fill_pool, open_pool
from lfstereo.training.recipe import Recipe
from lfstereo.training.sources import Rings, batches
from lfstereo.training.stages import LOSSES, select_parts
from lfstereo.training.workers import Worker

WARM_UP = 0.08
CLIP_NORM = 1.0
_LOG_EVERY = 20
CURVE = "curve.csv"


def one_cycle(fraction: float) -> float:
    """Return the learning rate as a share of the highest one.

    Examples
    --------
    >>> one_cycle(0.0), one_cycle(0.08), round(one_cycle(1.0), 6)
    (0.04, 1.0, 0.001)
    """
    if fraction < WARM_UP:
        return 0.04 + 0.96 * fraction / WARM_UP
    falling = min((fraction - WARM_UP) / (1 - WARM_UP), 1.0)
    return 0.001 + 0.999 * 0.5 * (1 + math.cos(math.pi * falling))


def train(
    recipe: Recipe,
    architecture: AnyArchitecture,
    output: Path,
    minutes: float | None = None,
    resume: bool = False,
    progress: Progress = silent,
    stop_at: int | None = None,
    worker: Worker = Worker(torch.device("cpu")),
    rings: Rings | None = None,
) -> Counters:
    """Train one stage and leave a checkpoint and the curve of its loss.

    Parameters
    ----------
    recipe, architecture
        What to train.
    output
        The run's folder, outside the repository.
    minutes
        Training time after which the run ends, over all resumed parts; the learning rate falls accordingly.
    resume
        Go on from the folder's checkpoint.
    progress
        Told how much of the run is done, in thousandths.
    stop_at
        Leave off after this step, to go on later.
    worker
        Device, and this process among several.
    rings
        Filled rings of earlier stages; the one used here is put in.

    Raises
    ------
    ConfigError
        If the recipe names an unknown part, or needs a pool and names none.
    AssetError
        If a checkpoint that is needed is missing.
    """
    torch.set_num_threads(recipe.threads)
    if recipe.stage == "pool":
        pool = open_pool(output, recipe.pool_size, recipe.height, recipe.width, recipe.seed)
        fill_pool(pool, recipe.seed, recipe.textures, progress, recipe.scenes, recipe.atlas)
        return Counters("pool", recipe.pool_size, 0.0)
    torch.manual_seed(recipe.seed)
    network = build(architecture)
    _start_from(network, recipe.start_from)
    if recipe.stage == "fronts":
        assert isinstance(network, BinocularNet)
        fill_fronts(output, recipe, network.eval(), progress)
        return Counters("fronts", recipe.pool_size, 0.0)
    network.to(worker.device)
    channels_last(network)
    parameters = select_parts(network, recipe.stage)
    optimiser = torch.optim.AdamW(parameters, recipe.rate, weight_decay=recipe.weight_decay)
    counters = load_checkpoint(output, network, optimiser) if resume else Counters(recipe.stage, 0, 0.0)
    if resume:
        channels_last(network)
    run = _Run(recipe, network, optimiser, output, worker, counters)
    source = batches(
        recipe, worker, {} if rings is None else rings, counters.step, min(recipe.steps, stop_at or recipe.steps)
    )
    return run.follow(source, 60 * minutes if minutes else math.inf, progress)


class StageLoss(nn.Module):
    """The loss of a stage as a module, so that several processes can average its gradients."""

    def __init__(self, network: AnyNetwork, stage: str, mixed: bool) -> None:
        super().__init__()
        self.network, self.stage, self.mixed = network, stage, mixed

    def forward(self, batch: Batch) -> Tensor:
        """Return the loss of a batch; in bfloat16 where that is exact enough, if ``mixed``."""
        with torch.autocast(batch.disparity.device.type, torch.bfloat16, enabled=self.mixed):
            return LOSSES[self.stage](self.network, batch)


class _Run:
    """One stage under way."""

    def __init__(
        self,
        recipe: Recipe,
        network: AnyNetwork,
        optimiser: torch.optim.AdamW,
        output: Path,
        worker: Worker,
        counters: Counters,
    ) -> None:
        self.recipe, self.network, self.optimiser = recipe, network, optimiser
        self.output, self.worker, self.counters = output, worker, counters
        mixed = recipe.precision == "bfloat16" or (recipe.precision == "auto" and worker.device.type == "cuda")
        loss: nn.Module = StageLoss(network, recipe.stage, mixed)
        self.loss = DistributedDataParallel(loss) if worker.count > 1 else loss
        self.curve = Curve(output / CURVE, counters.step)

    def follow(self, source: Iterator[Batch], budget_s: float, progress: Progress) -> Counters:
        """Take steps until the batches or the time end."""
        before, started = self.counters, time.monotonic()
        saved = started
        recent: list[Tensor] = []
        for batch in source:
            elapsed = self.worker.agree(self.counters.elapsed_s)
            step = self.counters.step
            fraction = max(step / self.recipe.steps, elapsed / budget_s)
            if fraction >= 1:
                break
            recent.append(self._step(batch, self.recipe.rate * one_cycle(fraction)))
            self.counters = Counters(self.recipe.stage, step + 1, before.elapsed_s + time.monotonic() - started)
            progress(int(1000 * fraction), 1000)
            if not self.worker.leads:
                continue
            if (step + 1) % _LOG_EVERY == 0:
                rate = self.optimiser.param_groups[0]["lr"]
                self.curve.add(self.counters, rate, float(torch.stack(recent).mean()))
                recent.clear()
            if time.monotonic() - saved > self.recipe.save_every:
                save_checkpoint(self.output, self.network, self.optimiser, self.counters)
                saved = time.monotonic()
        if self.worker.leads:
            save_checkpoint(self.output, self.network, self.optimiser, self.counters)
        return self.counters

    def _step(self, batch: Batch, rate: float) -> Tensor:
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.optimiser.zero_grad(set_to_none=True)
        loss: Tensor = self.loss(batch)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_([p for g in self.optimiser.param_groups for p in g["params"]], CLIP_NORM)
        self.optimiser.step()
        return loss.detach()


def _start_from(network: AnyNetwork, sources: tuple[str, ...]) -> None:
    state, parts = network.state_dict(), [name for name, _ in network.named_children()]
    for source in sources:
        part, _, folder = source.partition("=")
        if part not in parts or not folder:
            raise ConfigError(f"start_from: found {source!r}, expected PART=FOLDER with a part of {', '.join(parts)}")
        weights = read_weights(Path(folder))
        state.update({name: value for name, value in weights.items() if name.startswith(part + ".")})
    network.load_state_dict(state, strict=True)
