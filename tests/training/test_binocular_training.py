"""Training of the binocular focus volume: what counts, what varies, what is cached, and steps that learn."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from lfstereo.cli.main import main
from lfstereo.errors import ConfigError
from lfstereo.network.binocular_net import BinocularArchitecture, BinocularNet
from lfstereo.network.refine_net import CLUES, OFFERS
from lfstereo.network.weights import load_model
from lfstereo.training.batches import PoolBatches
from lfstereo.training.binocular_losses import seen_by_both, vary_slices
from lfstereo.training.evaluate import ABLATIONS, evaluate, held_out
from lfstereo.training.fronts import FrontBatches, fill_fronts
from lfstereo.training.loop import train
from lfstereo.training.pool import fill_pool, open_pool
from lfstereo.training.publish import main as publish_main
from lfstereo.training.recipe import Recipe
from lfstereo.training.stages import LOSSES, TRAINED, select_parts

FiveSteps = Callable[[torch.nn.Module, str, object], tuple[list[float], set[str]]]
SMALL = BinocularArchitecture(slice_width=8, descriptor_width=8, refine_width=8)
RECIPE = """
seed = 1
height = 64
width = 128
pool_size = 3
textures = 4
scenes = "rooms"
batch = 2
threads = 1
steps = 3
[architecture]
family = "binocular"
slice_width = 8
descriptor_width = 8
refine_width = 8
"""


def recipe(stage: str, **more: object) -> Recipe:
    return Recipe(stage=stage, seed=1, height=64, width=128, pool_size=3, textures=4, batch=2, threads=1, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def pool(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pool")
    fill_pool(open_pool(folder, 3, 64, 128, 1), 1, 4, kind="rooms")
    return folder


@pytest.fixture(scope="module")
def fronts(pool: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fronts")
    torch.manual_seed(0)
    fill_fronts(folder, recipe("fronts", pool=str(pool)), BinocularNet(SMALL).eval())
    return folder


def test_what_a_nearer_thing_hides_is_not_seen_by_both() -> None:
    disparity = torch.zeros(1, 1, 8)
    disparity[..., 4:6] = 2.0  # in the right picture these cover columns 2 and 3
    assert seen_by_both(disparity)[0, 0].tolist() == [True, True, False, False, True, True, True, True]
    assert not bool(seen_by_both(torch.full((1, 1, 4), 4.0)).any())  # all beyond the left border


def test_chosen_slices_keep_their_places() -> None:
    stack = torch.arange(16.0).view(1, 16, 1, 1, 1)
    counts = set()
    for seed in range(60):
        chosen, first, last = vary_slices(stack, torch.Generator().manual_seed(seed))
        values = chosen.flatten()
        assert values.tolist() == pytest.approx(np.linspace(first, last, len(values)).tolist())
        counts.add(len(values))
    assert {8, 16, 31} < counts


@pytest.mark.parametrize("stage", ["match", "slices", "refine"])
def test_a_few_steps_reduce_the_loss(stage: str, pool: Path, fronts: Path, five_steps: FiveSteps) -> None:
    torch.manual_seed(0)
    opened = open_pool(pool, 3, 64, 128, 1)
    source = FrontBatches(opened, recipe(stage, fronts=str(fronts))) if stage == "refine" else PoolBatches(opened, 1, 2)
    losses, changed = five_steps(BinocularNet(SMALL), stage, source(0))
    assert min(losses[1:]) < losses[0]
    assert changed == set(TRAINED[stage])


def test_refinement_learns_from_stacks_too(pool: Path) -> None:
    """On a graphics card nothing is cached: the loss makes its own fronts, of the same numbers each time."""
    torch.manual_seed(0)
    network = BinocularNet(SMALL)
    select_parts(network, "refine")
    batch = PoolBatches(open_pool(pool, 3, 64, 128, 1), 1, 2)(0)
    first, again = (LOSSES["refine"](network, batch) for _ in range(2))
    assert torch.isfinite(first) and torch.equal(first, again)


def test_fronts_are_cached_whole_and_cropped_alike(pool: Path, fronts: Path) -> None:
    opened = open_pool(pool, 3, 64, 128, 1)
    source = FrontBatches(opened, recipe("refine", fronts=str(fronts), crop=(32, 96)))
    assert source.ready.tolist() == [1, 1, 1]
    first, again, other = source(3), source(3), source(4)
    assert torch.equal(first.clues, again.clues) and not torch.equal(first.clues, other.clues)
    assert tuple(first.clues.shape) == (2, CLUES, 32, 96) and tuple(first.offers.shape) == (2, OFFERS, 32, 96)
    assert float(first.disparity.max()) <= 1.02 and float(first.offers.max()) > 1.02  # hundreds of px, and px


def test_what_is_missing_is_named(pool: Path, tmp_path: Path) -> None:
    opened = open_pool(pool, 3, 64, 128, 1)
    with pytest.raises(ConfigError, match="no fronts are named"):
        FrontBatches(opened, recipe("refine"))
    with pytest.raises(ConfigError, match="0 samples are ready"):
        FrontBatches(opened, recipe("refine", fronts=str(tmp_path / "empty")))(0)
    with pytest.raises(ConfigError, match="no pool is named"):
        fill_fronts(tmp_path, recipe("fronts"), BinocularNet(SMALL).eval())
    train(recipe("fronts", pool=str(pool)), SMALL, tmp_path / "fronts")
    with pytest.raises(ConfigError, match="name another folder"):
        FrontBatches(open_pool(tmp_path / "other", 3, 64, 64, 1), recipe("refine", fronts=str(tmp_path / "fronts")))


def test_recipes_from_a_pool_to_a_model(pool: Path, tmp_path: Path) -> None:
    """The four recipes of the family in one command, published, loaded and judged with both cues and either."""
    paths = []
    for stage in ("match", "slices", "fronts", "refine"):
        paths.append(tmp_path / f"{stage}.toml")
        text = f'stage = "{stage}"\npool = "{pool}"\n'
        paths[-1].write_text(text + RECIPE)
    words = ["train", *map(str, paths), "-o", str(tmp_path / "runs"), "--device", "cpu"]
    words += ["--fronts", str(tmp_path / "runs" / "fronts")]
    assert main(words) == 0
    parts = {"descriptors": "match", "slices": "slices", "refine": "refine"}
    sources = [f"{part}={tmp_path / 'runs' / run}" for part, run in parts.items()]
    stages = [str(tmp_path / "runs" / run) for run in parts.values()]
    model = tmp_path / "mine-v1"
    assert publish_main([*sources, "-o", str(model), "--recipe", str(paths[0]), "--stages", *stages]) == 0
    network, card = load_model(model)
    assert isinstance(network, BinocularNet) and card.training.stages[0].startswith("match: 3 steps")
    rows = evaluate(network, held_out(1, 64, 128, 0.2, 5))
    assert {row.part for row in rows} > set(ABLATIONS)
