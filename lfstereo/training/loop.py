"""The training loop: one stage for a number of steps or minutes, resumable to the same weights.

References
----------
Kingma, Ba, "Adam" (2015), and Loshchilov, Hutter, "Decoupled weight decay regularization" (2019): AdamW.
Smith, Topin, "Super-convergence" (2018): the one-cycle schedule.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import torch

from lfstereo.errors import ConfigError
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.blocks import channels_last
from lfstereo.progress import Progress, silent
from lfstereo.training.batches import Batch, PairBatches, PoolBatches, prefetched
from lfstereo.training.checkpoint import Counters, load_checkpoint, read_weights, save_checkpoint
from lfstereo.training.pool import fill_pool, open_pool
from lfstereo.training.recipe import Recipe
from lfstereo.training.stages import LOSSES, PARTS, select_parts

WARM_UP = 0.08
CLIP_NORM = 1.0
_LOG_EVERY = 20


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
    architecture: Architecture,
    output: Path,
    minutes: float | None = None,
    resume: bool = False,
    progress: Progress = silent,
    stop_at: int | None = None,
) -> Counters:
    """Train one stage and leave a checkpoint.

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
        fill_pool(pool, recipe.seed, recipe.textures, progress)
        return Counters("pool", recipe.pool_size, 0.0)
    torch.manual_seed(recipe.seed)
    network = BdffNet(architecture)
    _start_from(network, recipe.start_from)
    channels_last(network)
    parameters = select_parts(network, recipe.stage)
    optimiser = torch.optim.AdamW(parameters, recipe.rate, weight_decay=recipe.weight_decay)
    counters = load_checkpoint(output, network, optimiser) if resume else Counters(recipe.stage, 0, 0.0)
    if resume:
        channels_last(network)
    return _run(recipe, network, optimiser, counters, output, minutes, progress, stop_at)


def _run(
    recipe: Recipe,
    network: BdffNet,
    optimiser: torch.optim.AdamW,
    counters: Counters,
    output: Path,
    minutes: float | None,
    progress: Progress,
    stop_at: int | None,
) -> Counters:
    loss_of = LOSSES[recipe.stage]
    step, elapsed, budget = counters.step, counters.elapsed_s, 60 * minutes if minutes else math.inf
    started = saved = time.monotonic()
    recent: list[float] = []
    for batch in prefetched(_batches(recipe), step, min(recipe.steps, stop_at or recipe.steps)):
        fraction = max(step / recipe.steps, elapsed / budget)
        if fraction >= 1:
            break
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * one_cycle(fraction)
        recent.append(_step(network, optimiser, loss_of, batch))
        step += 1
        now = time.monotonic()
        elapsed = counters.elapsed_s + now - started
        if step % _LOG_EVERY == 0:
            print(f"{recipe.stage} step {step} {elapsed:.0f} s loss {sum(recent) / len(recent):.5f}", file=sys.stderr)
            recent.clear()
        progress(int(1000 * fraction), 1000)
        if now - saved > recipe.save_every:
            save_checkpoint(output, network, optimiser, Counters(recipe.stage, step, elapsed))
            saved = now
    done = Counters(recipe.stage, step, elapsed)
    save_checkpoint(output, network, optimiser, done)
    return done


def _step(
    network: BdffNet,
    optimiser: torch.optim.AdamW,
    loss_of: Callable[[BdffNet, Batch], torch.Tensor],
    batch: Batch,
) -> float:
    optimiser.zero_grad(set_to_none=True)
    loss = loss_of(network, batch)
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_([p for g in optimiser.param_groups for p in g["params"]], CLIP_NORM)
    optimiser.step()
    return float(loss.detach())


def _batches(recipe: Recipe) -> Callable[[int], Batch]:
    if recipe.stage == "stereo":
        return PairBatches(recipe.seed, recipe.batch, recipe.height, recipe.width, recipe.textures)
    if not recipe.pool:
        raise ConfigError(f"stage {recipe.stage}: no pool is named; render one with stage 'pool' and give its folder")
    pool = open_pool(Path(recipe.pool), recipe.pool_size, recipe.height, recipe.width, recipe.seed)
    return PoolBatches(pool, recipe.seed, recipe.batch, recipe.crop)


def _start_from(network: BdffNet, sources: tuple[str, ...]) -> None:
    state = network.state_dict()
    for source in sources:
        part, _, folder = source.partition("=")
        if part not in PARTS or not folder:
            raise ConfigError(f"start_from: found {source!r}, expected PART=FOLDER with a part of {', '.join(PARTS)}")
        weights = read_weights(Path(folder))
        state.update({name: value for name, value in weights.items() if name.startswith(part + ".")})
    network.load_state_dict(state, strict=True)
