"""A pool cut from a data set on disk: the same pictures and disparities, encoded as the networks expect them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.focus.stack import FocalStack
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stack_dataset import DualStack, open_dataset, write_dual_stack
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training.dataset_pool import fill_pool_from_dataset, main, right_truth
from lfstereo.training.pool import DISPARITY_STEPS_PER_PX, open_pool

ROWS, COLUMNS, HEIGHT, WIDTH, SEED = 40, 70, 32, 48, 1
DISPARITY_PX = {"near_wall": 60.0, "far_wall": 20.0}
CODES = 2.0
"""Of 255: what two roundings to 8 bits and their two curves may differ by."""


def wall(name: str, slices: int = 16) -> DualStack:
    """A wall of one disparity; slice k is as bright as its number tells."""
    rng = np.random.default_rng(len(name))
    left = rng.uniform(0.2, 0.9, (ROWS, COLUMNS, 3)).astype(np.float32)
    disparity = np.full((ROWS, COLUMNS), DISPARITY_PX[name], np.float32)
    known = np.ones(disparity.shape, bool)
    known[:, :3] = False
    stack = left * np.linspace(0.5, 1.0, slices, dtype=np.float32)[:, None, None, None]
    foci = np.linspace(100.0, 0.0, slices, dtype=np.float32)
    stacks = [FocalStack(slices_, foci, 0.1, name) for slices_ in (stack, stack[:, :, ::-1].copy())]
    return DualStack(name, *stacks, left, left[:, ::-1].copy(), disparity, known, disparity)


def dataset(root: Path, options: PhotographOptions = PhotographOptions()) -> Path:
    open_dataset(root, options, VirtualDslrOptions(noise=False))
    for name in DISPARITY_PX:
        write_dual_stack(root, "train", wall(name, options.slices), noisy=False)
    return root


def test_samples_are_cut_from_every_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "pool"
    sizes = ["--count", "4", "--height", str(HEIGHT), "--width", str(WIDTH)]
    assert main([str(dataset(tmp_path / "data")), "-o", str(folder), *sizes]) == 0
    assert f"lfstereo train RECIPE --pool {folder}" in capsys.readouterr().out
    pool = open_pool(folder, 4, HEIGHT, WIDTH, SEED)
    assert pool.ready.all()
    found = pool.disparity[:, 0, 0, -1] / DISPARITY_STEPS_PER_PX
    assert sorted(found.tolist()) == [20.0, 20.0, 60.0, 60.0]
    assert pool.aperture_ratio == pytest.approx(0.1)
    for stack, sharp in zip(pool.stacks, pool.sharp, strict=True):
        # The last slice is the sharp picture itself, the first has half its light.
        assert np.abs(stack[:, -1].astype(float) - sharp).max() <= CODES
        darker = (sharp[0].astype(float) / 255) * 0.5 ** (1 / 2.2) * 255
        below_white = sharp[0] < 250
        assert np.abs(stack[0, 0] - darker)[below_white].max() <= 2 * CODES
    again = pool.stacks.copy()
    fill_pool_from_dataset(pool, tmp_path / "data", SEED)
    np.testing.assert_array_equal(pool.stacks, again)


def test_right_truth_is_what_the_left_view_confirms() -> None:
    scene = wall("far_wall")
    confirmed = right_truth(scene.disparity, scene.known, scene.right_disparity)
    assert confirmed[:, : COLUMNS - 20].all(), "what the left view sees too"
    assert not confirmed[:, COLUMNS - 20 :].any(), "what lies beside the left view"
    moved = dataclasses.replace(scene, right_disparity=scene.right_disparity + 5)
    assert not right_truth(moved.disparity, moved.known, moved.right_disparity).any()


def test_refuses_other_slices_and_small_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pool = open_pool(tmp_path / "pool", 1, HEIGHT, WIDTH, SEED)
    with pytest.raises(ConfigError, match="8 slices focused at 100 to 0 px, expected 16"):
        fill_pool_from_dataset(pool, dataset(tmp_path / "few", PhotographOptions(slices=8)), SEED)
    sizes = ["--count", "1", "--height", "48", "--width", "48"]
    assert main([str(dataset(tmp_path / "data")), "-o", str(tmp_path / "large"), *sizes]) == 3
    assert "70 x 40 px, expected at least the sample's 48 x 48" in capsys.readouterr().err
