"""Where the batches of a run come from: a ring on the graphics card, a pool on disk, or pairs rendered as needed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

from lfstereo.errors import ConfigError
from lfstereo.progress import Progress, silent
from lfstereo.training.batches import Batch, PairBatches, PoolBatches, prefetched
from lfstereo.training.fronts import FrontBatches
from lfstereo.training.planes import PlaneBatches
from lfstereo.training.pool import open_pool
from lfstereo.training.recipe import Recipe
from lfstereo.training.ring import GRAIN, RingBatches, RingSize, SampleRing
from lfstereo.training.workers import Worker

Rings = dict[tuple[RingSize, int], SampleRing]
"""Rings that are filled already, for the stages that follow in the same process."""
_RANKS = 7919
_EYES_READ: dict[str, Literal[0, 1, 2]] = {"match": 0, "edof": 1, "focus": 1, "slices": 1}
"""Stages that need not read both stacks -> how many they need."""


def batches(
    recipe: Recipe, worker: Worker, rings: Rings, first: int, last: int, progress: Progress = silent
) -> Iterator[Batch]:
    """Yield the batches of steps ``first`` to ``last - 1`` for one process, on its device.

    Raises
    ------
    ConfigError
        If the stage needs a pool and none is named.
    """
    if takes_ring(recipe, worker):
        source = _ring_source(recipe, worker, rings, progress)
        for step in range(first, last):
            yield source(step)
        return
    shared = _processor_source(recipe)
    for batch in prefetched(lambda step: shared(step * worker.count + worker.rank), first, last):
        yield _moved(batch, worker)


def takes_ring(recipe: Recipe, worker: Worker) -> bool:
    """Whether samples are rendered where the network is trained."""
    if recipe.stage == "focus_planes":
        return False
    return recipe.source == "ring" or (recipe.source == "auto" and worker.device.type == "cuda")


def _ring_source(recipe: Recipe, worker: Worker, rings: Rings, progress: Progress) -> Callable[[int], Batch]:
    size = RingSize(
        recipe.ring, recipe.height, recipe.width, recipe.fresh, recipe.textures, recipe.scenes, recipe.atlas
    )
    seed = recipe.seed + _RANKS * worker.rank
    if (size, seed) not in rings:
        rings.clear()
        rings[size, seed] = SampleRing(size, seed, worker.device)
    grain = GRAIN if recipe.stage == "stereo" else 0.0
    return RingBatches(rings[size, seed], seed, recipe.batch, recipe.crop, grain, progress)


def _processor_source(recipe: Recipe) -> Callable[[int], Any]:
    if recipe.stage == "stereo" or (recipe.stage == "match" and not recipe.pool):
        return PairBatches(
            recipe.seed, recipe.batch, recipe.height, recipe.width, recipe.textures, recipe.scenes, recipe.atlas
        )
    if not recipe.pool:
        raise ConfigError(f"stage {recipe.stage}: no pool is named; render one with stage 'pool' and give its folder")
    pool = open_pool(Path(recipe.pool), recipe.pool_size, recipe.height, recipe.width, recipe.seed)
    if recipe.stage == "refine":
        return FrontBatches(pool, recipe)
    if recipe.stage == "focus_planes":
        return PlaneBatches(pool, recipe.seed, recipe.batch, recipe.crop or (recipe.height, recipe.width))
    return PoolBatches(pool, recipe.seed, recipe.batch, recipe.crop, _EYES_READ.get(recipe.stage, 2))


def _moved(batch: Batch, worker: Worker) -> Batch:
    if worker.device.type == "cpu":
        return batch
    fields = {f.name: getattr(batch, f.name).to(worker.device, non_blocking=True) for f in dataclasses.fields(batch)}
    return Batch(**fields)
