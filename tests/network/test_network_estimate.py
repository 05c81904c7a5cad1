"""From stacks to a disparity map: checks, encoding, padding, ranges."""

import dataclasses

import numpy as np
import pytest
import torch

from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.blocks import fold_batch_norms
from lfstereo.network.card import ModelCard, Training
from lfstereo.network.encoding import decode, encode, exposure_of
from lfstereo.network.estimate import Network, estimate_disparity, load_network

ROUND_TRIP = 1e-5  # linear light


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    module = BdffNet(Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)).eval()
    fold_batch_norms(module)
    card = ModelCard("tiny", 1, "BSD-3-Clause", "", (), (), module.architecture, Training())
    return Network(module, card, "cpu")


def stack(height: int = 50, width: int = 70, near: float = 92.0, far: float = 0.0, slices: int = 16) -> FocalStack:
    pixels = np.random.default_rng(4).random((slices, height, width, 3), dtype=np.float32) * 0.2
    return FocalStack(pixels, np.linspace(near, far, slices, dtype=np.float32), 0.1, "test")


def test_map_has_the_size_of_the_stack(network: Network) -> None:
    steps: list[tuple[int, int]] = []
    found = estimate_disparity(stack(), stack(), network, lambda done, total: steps.append((done, total)))
    assert found.disparity.shape == found.valid.shape == (50, 70)
    assert found.all_in_focus.shape == (50, 70, 3)
    assert found.disparity.dtype == found.all_in_focus.dtype == np.float32
    assert np.isfinite(found.disparity).all() and found.disparity.min() >= 0
    assert found.valid.all()
    assert steps[-1] == (3, 3)


def test_exposure_of_the_pair_does_not_matter(network: Network) -> None:
    plain, bright = stack(), dataclasses.replace(stack(), slices=stack().slices * 4)
    a, b = estimate_disparity(plain, plain, network), estimate_disparity(bright, bright, network)
    np.testing.assert_allclose(a.disparity, b.disparity, atol=0.05)  # px
    np.testing.assert_allclose(4 * a.all_in_focus, b.all_in_focus, atol=1e-3)


def test_encoding_round_trip_below_the_white_point() -> None:
    linear = np.linspace(0, 0.8, 60, dtype=np.float32).reshape(4, 5, 3)
    np.testing.assert_allclose(decode(encode(linear, 0.9), 0.9), linear, atol=ROUND_TRIP)


def test_exposure_ignores_black_margins() -> None:
    image = np.full((20, 20, 3), 0.5, np.float32)
    image[:, :15] = 0
    assert exposure_of(image) == pytest.approx(0.5)
    assert exposure_of(np.zeros((4, 4, 3), np.float32)) == 1.0


@pytest.mark.parametrize(
    ("right", "error", "message"),
    [
        (stack(height=52), ShapeError, "expected the same"),
        (stack(near=90.0), ShapeError, "focus disparities differ by up to 2.00 px"),
    ],
)
def test_stacks_that_do_not_agree(network: Network, right: FocalStack, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        estimate_disparity(stack(), right, network)


def test_wrong_number_of_slices(network: Network) -> None:
    with pytest.raises(ShapeError, match="12 slices, expected 16"):
        estimate_disparity(stack(slices=12), stack(slices=12), network)


def test_uneven_slices(network: Network) -> None:
    uneven = dataclasses.replace(stack(), disparities_px=np.float32(92) * np.linspace(1, 0, 16, dtype=np.float32) ** 2)
    with pytest.raises(ShapeError, match="use even steps"):
        estimate_disparity(uneven, uneven, network)


@pytest.mark.parametrize(("near", "far"), [(120.0, 0.0), (90.0, -8.0)])
def test_range_beyond_the_search(network: Network, near: float, far: float) -> None:
    beyond = stack(near=near, far=far)
    with pytest.raises(ConfigError, match="expected within -1 to 104"):
        estimate_disparity(beyond, beyond, network)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device here")
def test_cuda_without_a_device() -> None:
    with pytest.raises(ConfigError, match="no CUDA device"):
        load_network(device="cuda")
