"""Training: losses with known values, steps that learn, a resumed run that ends at the same weights."""

import dataclasses
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from lfstereo.cli.main import main
from lfstereo.errors import AssetError, ConfigError
from lfstereo.network.bdff_net import Architecture, BdffNet, paper_architecture
from lfstereo.network.binocular_net import BinocularArchitecture
from lfstereo.network.focus_net import FocusNet
from lfstereo.network.stereo_net import Prediction
from lfstereo.network.weights import load_model
from lfstereo.training.batches import PairBatches, PoolBatches, prefetched
from lfstereo.training.checkpoint import Counters, read_weights
from lfstereo.training.curve import Curve, read_curve
from lfstereo.training.evaluate import evaluate, held_out
from lfstereo.training.evaluate import main as evaluate_main
from lfstereo.training.loop import one_cycle, train
from lfstereo.training.losses import bin_cross_entropy, image_loss, mean_absolute, staged_loss
from lfstereo.training.planes import PlaneBatches
from lfstereo.training.pool import Pool, fill_pool, open_pool
from lfstereo.training.publish import main as publish_main
from lfstereo.training.publish import measure, publish
from lfstereo.training.recipe import Recipe, read_recipe
from lfstereo.training.sources import Rings
from lfstereo.training.stages import LOSSES, PARTS, TRAINED
from lfstereo.training.workers import join_workers

FiveSteps = Callable[[torch.nn.Module, str, object], tuple[list[float], set[str]]]
SMALL = Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)
SIZE = {"height": 64, "width": 64, "textures": 4, "batch": 2, "threads": 1}


@pytest.fixture(scope="module")
def pool(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Pool]:
    folder = tmp_path_factory.mktemp("pool")
    opened = open_pool(folder, 3, 64, 64, 1)
    fill_pool(opened, 1, 4)
    return folder, opened


def test_losses_of_known_errors() -> None:
    wanted, valid = torch.zeros(1, 1, 8, 8), torch.ones(1, 1, 8, 8, dtype=torch.bool)
    half = torch.full((1, 1, 8, 8), 0.5)
    assert float(mean_absolute(half, wanted, valid)) == 0.5
    assert float(staged_loss(Prediction((half, half)), wanted, valid, wanted)) == pytest.approx(0.5 * 1.3)
    assert float(image_loss(half, wanted, valid)) == pytest.approx(0.5)  # a constant error has no differences


def test_cross_entropy_of_an_undecided_net_is_log_of_the_bins() -> None:
    position, valid = torch.full((1, 2, 2), 3.4), torch.ones(1, 2, 2, dtype=torch.bool)
    assert float(bin_cross_entropy(torch.zeros(1, 27, 2, 2), position, valid)) == pytest.approx(math.log(27), rel=1e-5)
    logits = torch.full((1, 27, 2, 2), -40.0)
    logits[:, 26] = 40.0
    assert float(bin_cross_entropy(logits, torch.full((1, 2, 2), 30.0), valid)) == pytest.approx(0.0, abs=1e-5)


def test_one_cycle_rises_then_falls() -> None:
    rates = [one_cycle(f) for f in np.linspace(0, 1, 51)]
    peak = int(np.argmax(rates))
    assert rates[peak] == pytest.approx(1.0, abs=0.01)
    assert all(np.diff(rates[:peak]) > 0) and all(np.diff(rates[peak:]) < 0)


def test_batches_depend_on_the_step_alone(pool: tuple[Path, Pool]) -> None:
    for source in (PairBatches(1, 2, 64, 64, 4), PoolBatches(pool[1], 1, 2)):
        first, again, other = source(3), source(3), source(4)
        assert torch.equal(first.left, again.left) and torch.equal(first.disparity, again.disparity)
        assert not torch.equal(first.left, other.left)
    cropped = PoolBatches(pool[1], 1, 2, (32, 48))(0)
    assert tuple(cropped.left_stack.shape) == (2, 16, 3, 32, 48)
    assert tuple(cropped.disparity.shape) == tuple(cropped.valid.shape) == (2, 1, 32, 48)


def test_mirrored_batches_stay_a_stereo_pair(pool: tuple[Path, Pool]) -> None:
    """Warping the right image by the disparity explains the left one better than leaving it does, mirrored or not."""
    from lfstereo.network.volume import warp_right

    for step in range(4):
        batch = PoolBatches(pool[1], 1, 2)(step)
        warped = warp_right(batch.right, batch.disparity * 100)
        seen = batch.valid & (torch.arange(64).view(1, 1, 1, 64) - batch.disparity * 100 >= 0)
        seen = seen & (warped.sum(1, keepdim=True) > 0)
        if seen.sum() > 500:
            assert mean_absolute(warped, batch.left, seen) < mean_absolute(batch.right, batch.left, seen)


def test_prefetching_passes_errors_on() -> None:
    def broken(step: int) -> None:
        raise ConfigError(f"step {step}")

    with pytest.raises(ConfigError, match="step 5"):
        list(prefetched(broken, 5, 7))  # type: ignore[arg-type]


@pytest.mark.parametrize("stage", sorted(set(LOSSES) - {"match", "slices", "refine"}))
def test_a_few_steps_reduce_the_loss(stage: str, pool: tuple[Path, Pool], five_steps: FiveSteps) -> None:
    torch.manual_seed(0)
    losses, changed = five_steps(BdffNet(SMALL), stage, PoolBatches(pool[1], 1, 2)(0))
    assert min(losses[1:]) < losses[0]
    assert changed == set(TRAINED[stage])


def test_a_resumed_run_ends_at_the_same_weights(tmp_path: Path) -> None:
    recipe = Recipe(stage="stereo", steps=4, **SIZE)
    train(recipe, SMALL, tmp_path / "whole")
    half = dataclasses.replace(recipe, steps=4)
    train(half, SMALL, tmp_path / "parts", stop_at=2)
    done = train(half, SMALL, tmp_path / "parts", resume=True)
    assert done.step == 4
    whole, parts = read_weights(tmp_path / "whole"), read_weights(tmp_path / "parts")
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


def test_a_run_ends_when_its_minutes_are_over(tmp_path: Path) -> None:
    done = train(Recipe(stage="stereo", steps=10000, **SIZE), SMALL, tmp_path, minutes=0.01)
    assert 0 < done.step < 10000


def test_resume_without_a_checkpoint(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="no such checkpoint"):
        train(Recipe(stage="stereo", **SIZE), SMALL, tmp_path, resume=True)


def test_stage_without_a_pool(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no pool is named"):
        train(Recipe(stage="edof", **SIZE), SMALL, tmp_path)


def test_empty_pool(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="0 samples are rendered"):
        PoolBatches(open_pool(tmp_path, 2, 64, 64, 1), 1, 2)(0)


def test_pool_of_another_size(pool: tuple[Path, Pool]) -> None:
    with pytest.raises(ConfigError, match="holds a pool of"):
        open_pool(pool[0], 4, 64, 64, 1)


def test_unknown_part_to_start_from(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected PART=FOLDER"):
        train(Recipe(stage="stereo", start_from=("head=there",), **SIZE), SMALL, tmp_path)


def test_all_shipped_recipes_can_be_read() -> None:
    from lfstereo.assets import asset_folder

    recipes = [
        *(asset_folder("models") / "recipes").glob("*.toml"),
        *(asset_folder("models") / "recipes" / "card").glob("*.toml"),
    ]
    assert len(recipes) == 13
    for path in recipes:
        recipe, architecture = read_recipe(path)
        assert recipe.stage in {"pool", *TRAINED}
        assert architecture == Architecture()
    published = sorted((asset_folder("models") / "recipes" / "paper").glob("*.toml"))
    assert [read_recipe(path)[1] for path in published] == [paper_architecture()] * 6
    binocular = sorted((asset_folder("models") / "recipes" / "binocular").rglob("*.toml"))
    assert {read_recipe(path)[1] for path in binocular} == {
        Architecture(),
        BinocularArchitecture(),
    }  # the pool has none
    assert [read_recipe(path)[0].stage for path in binocular if path.parent.name == "card"] == [
        "match",
        "slices",
        "refine",
    ]


def test_train_command_then_publish_then_evaluate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = 'stage = "stereo"\nsteps = 2\nbatch = 2\nheight = 64\nwidth = 64\ntextures = 4\nthreads = 1\n'
    (tmp_path / "tiny.toml").write_text(text)
    words = ["train", str(tmp_path / "tiny.toml"), "-o", str(tmp_path / "run")]
    assert main(words) == 0
    assert main(words) == 3
    assert "add --resume" in capsys.readouterr().err
    parts = [f"{part}={tmp_path / 'run'}" for part in PARTS]
    assert publish_main([*parts, "-o", str(tmp_path / "tiny-v1"), "--stages", str(tmp_path / "run")]) == 0
    _, card = load_model(tmp_path / "tiny-v1")
    assert card.name == "tiny" and card.training.stages[0].startswith("stereo: 2 steps")
    before = (tmp_path / "tiny-v1" / "weights.safetensors").read_bytes()
    measured = measure(tmp_path / "tiny-v1", 1, 64, 64)
    assert (tmp_path / "tiny-v1" / "weights.safetensors").read_bytes() == before
    assert any(metric.name.startswith("fused") and "tiny-v1 --count 1" in metric.command for metric in measured.metrics)
    assert evaluate_main([str(tmp_path / "tiny-v1"), "--count", "1", "--height", "64", "--width", "64"]) == 0
    assert "fused_visible" in capsys.readouterr().out


def test_publish_needs_every_part_and_a_version(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no run is given for edof"):
        publish({}, tmp_path / "x-v1", [], "none")
    with pytest.raises(ConfigError, match="ending in a version"):
        publish(dict.fromkeys(PARTS, tmp_path), tmp_path / "x", [], "none")


def test_evaluation_of_a_perfect_answer() -> None:
    samples = held_out(1, 64, 64, 0.1, 3)

    class Oracle(BdffNet):
        def forward(self, left, right, range_px=(0.0, 100.0)):  # type: ignore[no-untyped-def]
            found = super().forward(left, right, range_px)
            truth = torch.from_numpy(samples[0].disparity[0] / 100)[None, None]
            return dataclasses.replace(found, fused=truth)

    rows = {row.part: row for row in evaluate(Oracle(SMALL), samples)}
    assert rows["fused"].mae_px == pytest.approx(0.0, abs=1e-4)
    assert rows["fused"].bad == (0.0, 0.0, 0.0)
    assert rows["constant"].mae_px > 1


def test_planes_hold_one_disparity_and_are_sharpest_there(pool: tuple[Path, Pool]) -> None:
    source = PlaneBatches(pool[1], 1, 4, (32, 32))
    batch, again = source(3), source(3)
    assert torch.equal(batch.left_stack, again.left_stack)
    assert batch.left_stack.shape == (4, 16, 3, 32, 32) and batch.disparity.shape == (4, 1, 32, 32)
    for stack, disparity, sharp in zip(batch.left_stack, batch.disparity, batch.left, strict=True):
        assert disparity.unique().numel() == 1
        best = int((stack - sharp).abs().mean((1, 2, 3)).argmin())
        assert abs(best / 15 - (1 - float(disparity[0, 0, 0]))) <= 1 / 15  # noise decides between two slices


def test_planes_need_a_rendered_pool(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="0 samples are rendered"):
        PlaneBatches(open_pool(tmp_path, 2, 64, 64, 1), 1, 2, (32, 32))(0)


def test_branches_start_blind_to_what_all_slices_share() -> None:
    network = FocusNet(4)
    flat = torch.rand(1, 1, 3, 32, 32).expand(-1, 16, -1, -1, -1)
    for branch in network.branches:
        first = branch.get_submodule("0.conv")
        assert isinstance(first, torch.nn.Conv2d)
        shared = torch.nn.functional.conv2d(flat.flatten(1, 2), first.weight, stride=first.stride)
        assert float(shared.detach().abs().max()) < 1e-5


def test_the_curve_is_kept_and_cut_where_a_run_is_resumed(tmp_path: Path) -> None:
    curve = Curve(tmp_path / "curve.csv", 0)
    for step in (20, 40, 60):
        curve.add(Counters("edof", step, step / 10), 1e-3, 1 / step)
    Curve(tmp_path / "curve.csv", 40).add(Counters("edof", 60, 7.0), 5e-4, 0.01)
    rows = read_curve(tmp_path / "curve.csv")
    assert [row[1] for row in rows] == [20, 40, 60]
    assert rows[-1] == ("edof", 60, 7.0, 5e-4, 0.01)
    assert Curve(tmp_path / "curve.csv", 0) and read_curve(tmp_path / "curve.csv") == []


def test_checkpoints_come_in_small_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lfstereo.training.checkpoint.SHARD_BYTES", 20_000)
    train(Recipe(stage="stereo", steps=1, **SIZE), SMALL, tmp_path)
    files = sorted((tmp_path / "checkpoint").glob("weights*.safetensors"))
    largest = max(value.nbytes for value in read_weights(tmp_path).values())
    assert len(files) > 3 and max(path.stat().st_size for path in files) < max(20_000, largest) + 10_000
    assert train(Recipe(stage="stereo", steps=2, **SIZE), SMALL, tmp_path, resume=True).step == 2


def test_several_recipes_build_on_each_other(
    tmp_path: Path, pool: tuple[Path, Pool], capsys: pytest.CaptureFixture[str]
) -> None:
    base = "batch = 2\nheight = 64\nwidth = 64\ntextures = 4\npool_size = 3\nthreads = 1\nsteps = 2\n"
    small = "[architecture]\nfocus_width = 4\nedof_width = 4\ntail_width = 4\nstereo_width = 16\n"
    for stage in ("edof", "focus", "guided"):
        (tmp_path / f"{stage}.toml").write_text(f'stage = "{stage}"\n{base}{small}')
    recipes = [str(tmp_path / f"{stage}.toml") for stage in ("edof", "focus", "guided")]
    words = ["train", *recipes, "--pool", str(pool[0]), "-o", str(tmp_path / "runs")]
    assert main([*words, "--minutes", "1", "2"]) == 3
    assert "expected 1 or 3" in capsys.readouterr().err
    assert main([*words, "--minutes", "5"]) == 0
    edof, guided = read_weights(tmp_path / "runs" / "edof"), read_weights(tmp_path / "runs" / "guided")
    same = [name for name in edof if name.startswith("edof.")]
    assert same and all(torch.equal(edof[name], guided[name]) for name in same)


def test_a_ring_feeds_training_on_any_device(tmp_path: Path) -> None:
    recipe = Recipe(
        stage="edof", source="ring", ring=2, precision="bfloat16", steps=2, height=64, width=64, batch=2, textures=2
    )
    rings: Rings = {}
    assert train(recipe, SMALL, tmp_path / "a", rings=rings).step == 2
    (ring,) = rings.values()
    train(dataclasses.replace(recipe, stage="focus"), SMALL, tmp_path / "b", rings=rings)
    assert list(rings.values()) == [ring]


def test_no_graphics_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ConfigError, match="--device cpu"), join_workers("cuda"):
        pass


def test_two_processes_train_one_network(tmp_path: Path) -> None:
    """Under torchrun both see other batches, average their gradients and end with one checkpoint."""
    text = 'stage = "stereo"\nsteps = 2\nbatch = 2\nheight = 64\nwidth = 64\ntextures = 2\nthreads = 1\n'
    (tmp_path / "tiny.toml").write_text(text + "[architecture]\nstereo_width = 16\n")
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", "lfstereo"]
    words = ["train", str(tmp_path / "tiny.toml"), "-o", str(tmp_path / "run"), "--device", "cpu"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run([*launch, *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    both = read_weights(tmp_path / "run")
    train(read_recipe(tmp_path / "tiny.toml")[0], read_recipe(tmp_path / "tiny.toml")[1], tmp_path / "alone")
    alone = read_weights(tmp_path / "alone")
    assert any(not torch.equal(both[name], alone[name]) for name in both if name.startswith("stereo."))
