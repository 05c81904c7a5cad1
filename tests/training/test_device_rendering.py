"""Scenes rendered in torch are those that numba renders, and a ring of them depends on the seed and the step alone."""

import subprocess
import sys

import numpy as np
import pytest
import torch

from lfstereo.training.device_samples import device_stack_sample, draw_faults, shear_mean
from lfstereo.training.device_tracing import Frame, render_views
from lfstereo.training.ring import RingBatches, RingSize, SampleRing
from lfstereo.training.samples import SLICE_DISPARITIES, pupil_points
from lfstereo.training.scenes import random_scene, render
from lfstereo.training.textures import texture_bank
from lfstereo.training.tracing import shear_add

HEIGHT, WIDTH = 48, 64
COLOUR = 1e-3  # linear, of textures in 0 to 1
EDGE_SHARE = 2e-3  # pixels whose ray passes an edge so closely that rounding decides
RING = RingSize(count=3, height=HEIGHT, width=WIDTH, fresh=0.5, textures=3)


@pytest.fixture(scope="module")
def bank() -> np.ndarray:
    return texture_bank(5, 6)


@pytest.mark.parametrize("seed", range(5))
def test_views_are_those_of_the_compiled_renderer(bank: np.ndarray, seed: int) -> None:
    scene = random_scene(np.random.default_rng(seed), bank, HEIGHT, WIDTH)
    eyes = np.float32([[0, 0], [0.1, -0.05], [1.05, 0.07]])
    images, disparities = render_views(
        scene.layers, torch.from_numpy(bank), eyes, Frame(HEIGHT, WIDTH, margin=6, shift_y=0.3), samples=2
    )
    for k, eye in enumerate(eyes):
        view = render(scene, float(eye[0]), float(eye[1]), margin=6, shift_y=0.3, samples=2)
        assert (np.abs(images[k].numpy() - view.image).max(-1) > COLOUR).mean() < EDGE_SHARE
        assert (np.abs(disparities[k].numpy() - view.disparity) > 1e-3).mean() < EDGE_SHARE


def test_sheared_mean_is_that_of_the_compiled_sum() -> None:
    rng, margin, points = np.random.default_rng(1), 17, pupil_points(5) * np.float32(0.15)
    views = rng.random((5, 20 + 2 * margin, 30 + 2 * margin, 3), dtype=np.float32)
    total = np.zeros((16, 20, 30, 3), np.float32)
    for (x, y), view in zip(points, views, strict=True):
        shear_add(view, SLICE_DISPARITIES * x, SLICE_DISPARITIES * y, margin, total)
    found = shear_mean(torch.from_numpy(views).movedim(-1, 1), points, SLICE_DISPARITIES, margin)
    np.testing.assert_allclose(found.movedim(1, -1).numpy(), total / 5, atol=2e-5)


def test_a_sample_is_seeded_in_range_and_sharp_at_its_disparity(bank: np.ndarray) -> None:
    textures = torch.from_numpy(bank)
    first, again = (device_stack_sample((1, 2), textures, bank, HEIGHT, WIDTH) for _ in range(2))
    assert torch.equal(first.stacks, again.stacks) and torch.equal(first.disparity, again.disparity)
    assert first.stacks.shape == (2, 16, 3, HEIGHT, WIDTH) and first.sharp.shape == (2, 3, HEIGHT, WIDTH)
    assert first.stacks.min() >= 0 and first.stacks.max() <= 1
    nearest = (torch.from_numpy(SLICE_DISPARITIES)[:, None, None] - first.disparity[0]).abs().argmin(0)
    in_focus = first.stacks[0].gather(0, nearest[None, None].expand(1, 3, -1, -1))[0]
    error = ((in_focus - first.sharp[0]).abs().mean(0) * first.valid[0]).mean()
    blurred = ((first.stacks[0].mean(0) - first.sharp[0]).abs().mean(0) * first.valid[0]).mean()
    assert error < blurred


def test_faults_lie_in_their_ranges() -> None:
    for seed in range(20):
        faults = draw_faults(np.random.default_rng(seed), HEIGHT, WIDTH)
        assert 0.05 <= faults.aperture_ratio <= 0.4 and abs(faults.shift_y[1]) <= 0.5
        assert 20 <= faults.peak <= 3000 and faults.margins.shape == (2, HEIGHT, WIDTH)


def test_a_ring_taken_up_later_holds_the_same_samples() -> None:
    whole, late = (SampleRing(RING, 4, torch.device("cpu")) for _ in range(2))
    for step in (0, 2, 3, 4):
        whole.advance(step)
    late.advance(4)
    assert set(late.held) == {2, 3, 4}
    assert torch.equal(whole.stacks, late.stacks) and torch.equal(whole.disparity, late.disparity)
    a, b = (RingBatches(ring, 4, 2, (32, 40), grain=0.02)(4) for ring in (whole, late))
    assert torch.equal(a.left, b.left) and torch.equal(a.left_stack, b.left_stack)
    assert a.left_stack.shape == (2, 16, 3, 32, 40) and a.disparity.shape == a.valid.shape == (2, 1, 32, 40)
    assert not torch.equal(a.left, RingBatches(whole, 4, 2, (32, 40))(4).left)  # grain is noise


def test_training_needs_no_compiler_and_no_file_formats() -> None:
    """On a rented graphics card there is torch, numpy, scipy and OpenCV, nothing else of what lfstereo uses."""
    text = (
        "import sys\n"
        "for name in ('numba', 'h5py', 'tqdm', 'rawpy', 'tifffile', 'imageio', 'colour', 'svgwrite'):\n"
        "    sys.modules[name] = None\n"
        "import lfstereo.cli.train, lfstereo.training.loop, lfstereo.training.publish, lfstereo.training.ring\n"
        "from lfstereo.progress import progress_bar\n"
        "with progress_bar('x') as progress: progress(1, 1)\n"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
