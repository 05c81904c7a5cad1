"""The binocular focus volume: parts with known answers, and a planted disparity that needs no training to be found."""

import cv2
import numpy as np
import pytest
import torch

from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.appearance import appearance_vectors
from lfstereo.network.binocular_net import BinocularArchitecture, BinocularNet
from lfstereo.network.blocks import channels_last, fold_batch_norms
from lfstereo.network.card import ModelCard, Training
from lfstereo.network.census import census_vectors
from lfstereo.network.clues import focus_disparity
from lfstereo.network.descriptor_net import DescriptorNet, row_logits
from lfstereo.network.estimate import (
    Network,
    estimate_disparity,
    estimate_from_one_stack,
    estimate_from_pictures,
    slice_limits,
)
from lfstereo.network.photometry import fitted_light
from lfstereo.network.refine_net import CLUES, OFFERS, RefineNet, take_over
from lfstereo.network.slice_scores import SliceScores
from lfstereo.network.weights import load_model, save_model

SMALL = BinocularArchitecture(slice_width=8, descriptor_width=8, refine_width=8)
SHIFT = 9


def card(module: BinocularNet) -> ModelCard:
    return ModelCard("small", 1, "BSD-3-Clause", "", (), (), module.architecture, Training())


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(3)
    module = BinocularNet(SMALL).eval()
    fold_batch_norms(module)
    channels_last(module)
    return Network(module.requires_grad_(False), card(module), "cpu")


def texture(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    return rng.uniform(0.05, 1.0, (height, width, 3)).astype(np.float32)


def shifted_pair() -> tuple[np.ndarray, np.ndarray]:
    wide = texture(np.random.default_rng(4), 40, 80 + SHIFT)
    return wide[:, :80], wide[:, SHIFT:]


def stack_of(picture: np.ndarray, disparities: np.ndarray) -> FocalStack:
    return FocalStack(np.repeat(picture[None], len(disparities), 0), disparities.astype(np.float32), 0.1, "planted")


def test_untrained_descriptors_find_a_planted_disparity(network: Network) -> None:
    left, right = (torch.from_numpy(p).permute(2, 0, 1)[None, None] for p in shifted_pair())
    pad = (0, 16, 0, 24)
    left, right = (torch.nn.functional.pad(t[0], pad, mode="reflect")[None] for t in (left, right))
    front = network.module.front(left, right, torch.tensor([20.0]))  # type: ignore[union-attr,operator]
    best = front.offers[0, 0, :40, SHIFT:70]
    assert float((best - SHIFT).abs().median()) < 0.1


def test_census_says_what_outshines_what() -> None:
    picture = torch.rand(1, 3, 12, 16, generator=torch.Generator().manual_seed(0))
    vectors = census_vectors(picture)
    assert tuple(vectors.shape) == (1, 24, 12, 16)
    assert float((vectors * vectors).sum(1).median()) > 0.95  # differences far above the noise: nearly of length 1
    darker = census_vectors(0.5 * picture + 0.1)
    assert float((vectors * darker).sum(1).median()) > 0.9
    assert float((vectors * census_vectors(1 - picture)).sum(1).max()) < 0
    assert not census_vectors(torch.full((1, 3, 8, 8), 0.3)).any()


def test_appearance_is_brightness_and_bounded_slopes() -> None:
    ramp = torch.arange(8.0).expand(1, 3, 6, 8) * torch.tensor([0.001, 0.002, 0.1]).view(1, 3, 1, 1)
    looks = appearance_vectors(ramp, 2.0)
    assert torch.allclose(looks[:, :3], 2 * ramp)
    inside = looks[0, 3:, 1:-1, 1:-1].flatten(1)
    wanted = 2 * torch.tensor([0.008, 0.016, 0.06, 0, 0, 0]).view(6, 1)  # Sobel: eight times the step; at most 0.06
    assert torch.allclose(inside, wanted.expand_as(inside), atol=1e-6)
    assert torch.allclose(appearance_vectors(ramp.mT, 2.0)[0, 6:, 1:-1, 1:-1].flatten(1), inside[:3], atol=1e-6)


def test_exposure_of_one_picture_is_found_from_the_other() -> None:
    draw = torch.Generator().manual_seed(0)
    given = torch.rand(3, 4000, generator=draw)
    gains, offsets = torch.tensor([0.7, 1.0, 1.6]), torch.tensor([0.1, 0.0, -0.2])
    wanted = gains[:, None] * given + offsets[:, None]
    wanted[:, :800] = torch.rand(3, 800, generator=draw)  # wrong matches
    counted = torch.arange(4000) < 3500
    gain, offset = fitted_light(wanted, given, counted)
    assert gain.tolist() == pytest.approx(gains.tolist(), abs=0.01)
    assert offset.tolist() == pytest.approx(offsets.tolist(), abs=0.01)


@pytest.mark.parametrize("share", [0.01, 1.0])
def test_exposure_stays_where_nothing_tells_it(share: float) -> None:
    plain = torch.full((3, 1000), 0.4)
    wanted = plain if share == 1.0 else 9 * torch.rand(3, 1000, generator=torch.Generator().manual_seed(0))
    gain, offset = fitted_light(wanted, plain, torch.arange(1000) < 1000 * share)
    assert gain.tolist() == [1.0] * 3 and offset.tolist() == pytest.approx([0.0] * 3, abs=1e-6)


def test_another_exposure_of_the_right_eye_changes_nothing(network: Network) -> None:
    wide = cv2.GaussianBlur(texture(np.random.default_rng(5), 64, 128 + SHIFT), (0, 0), 1.5)
    left, right = (
        torch.from_numpy(np.ascontiguousarray(p)).permute(2, 0, 1)[None, None] for p in (wide[:, :128], wide[:, SHIFT:])
    )
    foci = torch.tensor([20.0])
    plain = network.module.front(left, right, foci)  # type: ignore[union-attr,operator]
    darker = network.module.front(left, 0.6 * right + 0.05, foci)  # type: ignore[union-attr,operator]
    assert float((darker.offers[:, 0] - plain.offers[:, 0]).abs().median()) < 0.05
    assert float((darker.clues - plain.clues).abs().mean()) < 0.01


def test_row_logits_are_products_at_each_shift() -> None:
    rng = torch.Generator().manual_seed(0)
    left, right = (torch.randn(1, 4, 2, 7, generator=rng) for _ in range(2))
    logits = row_logits(left, right, torch.full((1, 1, 2, 7), 3.0), 3)
    assert float(logits[0, 2, 1, 5]) == pytest.approx(3 * float(left[0, :, 1, 5] @ right[0, :, 1, 3]), rel=1e-5)
    assert float(logits[0, 2, 0, 1]) < -1e3  # the right picture has no such pixel


def test_descriptors_have_unit_length() -> None:
    described, sharpness = DescriptorNet(8).eval()(torch.rand(1, 3, 16, 24))
    assert torch.allclose(described.norm(dim=1), torch.ones(1, 16, 24), atol=1e-5)
    assert bool((sharpness > 0).all())


@pytest.mark.parametrize("count", [1, 2, 5, 33])
def test_any_number_of_slices_is_scored(count: int) -> None:
    stack = torch.rand(1, count, 3, 32, 48)
    focused = SliceScores(8).eval()(stack)
    assert tuple(focused.scores.shape) == (1, count, 8, 12)
    low, high = stack.amin(1), stack.amax(1)
    assert bool(((focused.sharp >= low - 1e-5) & (focused.sharp <= high + 1e-5)).all())  # a weighted mean of slices
    if count == 1:
        assert torch.equal(focused.sharp, stack[:, 0])


def test_focus_disparity_reads_the_best_slice() -> None:
    scores = torch.full((1, 4, 2, 2), -20.0)
    scores[:, 1] = 20.0
    disparity, likely = focus_disparity(scores, torch.tensor([30.0, 20.0, 10.0, 0.0]))
    assert tuple(disparity.shape) == (1, 1, 8, 8)
    assert float((disparity - 20).abs().max()) < 1e-3 and float(likely.min()) > 0.999


def test_a_pixel_without_trust_takes_over_from_its_neighbours() -> None:
    value, trust = torch.tensor([[[[7.0, 100.0, 7.0]]]]), torch.tensor([[[[1.0, 0.0, 1.0]]]])
    even = torch.full((1, 9, 1, 3), 1 / 9)
    taken, weight = take_over(value, trust, even, 1)
    assert taken.flatten().tolist() == pytest.approx([7.0, 7.0, 7.0])
    assert weight.flatten().tolist() == pytest.approx([1 / 9, 2 / 9, 1 / 9])


def test_untrained_refinement_stays_near_the_best_offer() -> None:
    torch.manual_seed(0)
    clues, offers = torch.zeros(1, CLUES, 32, 64), torch.full((1, OFFERS, 32, 64), 40.0)
    with torch.inference_mode():
        refined = RefineNet(8).eval()(clues, offers)
    assert float((refined.disparity - 40).abs().max()) <= 2.0
    assert all(torch.allclose(stage, offers[:, :1], atol=1e-3) for stage in refined.stages)


def test_two_stacks_of_any_spacing(network: Network) -> None:
    left, right = shifted_pair()
    uneven = np.array([24.0, 20.0, 13.0, 9.0, 1.0])
    found = estimate_disparity(stack_of(left, uneven), stack_of(right, uneven), network)
    assert found.disparity.shape == (40, 80) and found.uncertainty_px is not None
    assert float(np.median(np.abs(found.disparity[:, SHIFT:70] - SHIFT))) < 2.5  # untrained corrections reach 2 px
    assert np.array_equal(found.valid, cv2.medianBlur(found.uncertainty_px, 5) <= 4.0)
    assert np.allclose(found.all_in_focus, np.clip(left, 0, None), atol=0.02)


def test_one_stack_alone_answers_in_its_own_units(network: Network) -> None:
    left, _ = shifted_pair()
    found = estimate_from_one_stack(stack_of(left, np.linspace(0.4, -0.2, 7)), network)
    assert found.disparity.shape == (40, 80)
    assert float(found.disparity.min()) > -0.25 and float(found.disparity.max()) < 0.45


def test_two_pictures_alone(network: Network) -> None:
    left, right = shifted_pair()
    found = estimate_from_pictures(left, right, 20.0, network)
    assert float(np.median(np.abs(found.disparity[:, SHIFT:70] - SHIFT))) < 2.5


def test_what_cannot_be_used_is_refused(network: Network) -> None:
    left, right = shifted_pair()
    few = np.linspace(20, 0, 4)
    with pytest.raises(ShapeError, match="4 slices, expected 5 to 64"):
        estimate_disparity(stack_of(left, few), stack_of(right, few), network)
    with pytest.raises(ShapeError, match="4 slices, expected 5 to 64"):
        estimate_from_one_stack(stack_of(left, few), network)
    far = np.linspace(300, 0, 16)
    with pytest.raises(ConfigError, match="to 256"):
        estimate_disparity(stack_of(left, far), stack_of(right, far), network)
    with pytest.raises(ConfigError, match="near_px = 0"):
        estimate_from_pictures(left, right, 0.0, network)
    with pytest.raises(ShapeError, match="expected the same"):
        estimate_from_pictures(left, right[:, 1:], 20.0, network)
    published = Network(load_model_module(), network.card, "cpu")
    with pytest.raises(ConfigError, match="found one stack alone"):
        estimate_from_one_stack(stack_of(left, np.linspace(20, 0, 16)), published)
    assert slice_limits(network.module) == (5, 64) and slice_limits(published.module) == (16, 16)


def load_model_module():  # type: ignore[no-untyped-def]
    from lfstereo.network.bdff_net import Architecture, BdffNet

    return BdffNet(Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)).eval()


def test_a_model_on_disk_is_the_same_network(tmp_path, network: Network) -> None:  # type: ignore[no-untyped-def]
    module = BinocularNet(SMALL).eval()
    save_model(tmp_path / "small-v1", module, card(module))
    again, read = load_model(tmp_path / "small-v1")
    assert read.architecture == SMALL and isinstance(again, BinocularNet)
    for name, value in module.state_dict().items():
        assert torch.allclose(again.state_dict()[name].float(), value.float(), atol=1e-3, rtol=1e-3), name
