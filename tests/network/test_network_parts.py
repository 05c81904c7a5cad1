"""The five networks: receptive field, shapes, what an untrained one already knows."""

import pytest
import torch

from lfstereo.network.bdff_net import FOCUS_FLOOR, Architecture, BdffNet, focus_prior, paper_architecture, to_range
from lfstereo.network.edof_net import RECEPTIVE_FIELD_PX, EdofNet
from lfstereo.network.focus_net import FocusNet
from lfstereo.network.stereo_net import BINS, SEARCH_PX, Prediction, StereoNet, convex_upsample
from lfstereo.network.volume import (
    group_correlation,
    likeness,
    likeness_volume,
    mode_mean,
    resample_bins,
    soft_argmax,
    warp_right,
    window_vectors,
)
from lfstereo.network.volume_net import FocusVolumeNet

SMALL = {"focus_width": 4, "edof_width": 4, "tail_width": 4, "stereo_width": 16}


def test_edof_receptive_field_is_exactly_41() -> None:
    torch.manual_seed(0)
    network = EdofNet(6, 4).eval()
    torch.nn.init.normal_(network.body[-1].weight)
    stack = torch.rand(1, 4, 3, 61, 61, dtype=torch.float32, requires_grad=True)
    network(stack)[0, :, 30, 30].sum().backward()
    reached = torch.nonzero(stack.grad.abs().sum((0, 1, 2)))
    assert RECEPTIVE_FIELD_PX == 41
    assert reached.min(0).values.tolist() == [30 - 20, 30 - 20]
    assert reached.max(0).values.tolist() == [30 + 20, 30 + 20]


def test_untrained_edof_is_the_mean_slice() -> None:
    stack = torch.rand(1, 4, 3, 16, 16)
    with torch.inference_mode():
        assert torch.allclose(EdofNet(4, 4).eval()(stack), stack.mean(1), atol=0.05)


@pytest.mark.parametrize("fusion", ["concat", "correlation"])
def test_stereo_net_predicts_at_every_stage(fusion: str) -> None:
    left = torch.rand(2, 3, 64, 128)
    prediction = StereoNet(16, fusion)(left, left)
    assert all(tuple(m.shape) == (2, 1, 64, 128) for m in prediction.maps)
    assert len(prediction.maps) >= 2
    assert all(tuple(scores.shape) == (2, BINS, 16, 32) for scores in prediction.logits)
    assert len(prediction.logits) == (3 if fusion == "correlation" else 0)


@pytest.mark.parametrize("network", [FocusNet(4), FocusVolumeNet(4)])
def test_focus_nets_return_a_map_of_the_picture(network: torch.nn.Module) -> None:
    with torch.inference_mode():
        final = network.eval()(torch.rand(1, 16, 3, 64, 64)).final
    assert tuple(final.shape) == (1, 1, 64, 64)


@pytest.mark.parametrize(
    "architecture",
    [
        Architecture(**SMALL),
        Architecture(**SMALL, focus="branches", stereo="concat", residual=False, fusion_guide=False),
    ],
)
def test_bdff_net_joins_all_parts(architecture: Architecture) -> None:
    network = BdffNet(architecture).eval()
    stack = torch.rand(1, 16, 3, 64, 64)
    with torch.inference_mode():
        found = network(stack, stack, (0.0, 100.0))
    assert tuple(found.edof_left.shape) == (1, 3, 64, 64)
    for part in (found.focus, found.guided, found.stereo.final, found.fused):
        assert tuple(part.shape) == (1, 1, 64, 64)


def test_paper_architecture_has_the_published_convolutions() -> None:
    network = BdffNet(paper_architecture())
    count = {
        name: sum(isinstance(m, torch.nn.Conv2d) for m in getattr(network, name).modules())
        for name in ("edof", "guided", "fusion")
    }
    assert count == {"edof": 20, "guided": 10, "fusion": 10}
    assert network.fusion.body[0].conv.in_channels == 2


def test_group_correlation_peaks_at_the_shift() -> None:
    generator = torch.Generator().manual_seed(2)
    left = torch.randn(1, 8, 6, 40, generator=generator)
    right = torch.roll(left, -5, dims=3)
    volume = group_correlation(left, right, 9, 2)
    assert tuple(volume.shape) == (1, 2, 9, 6, 40)
    assert torch.allclose(volume[0, :, 5, :, 5:], torch.ones(2, 6, 35), atol=1e-5)
    assert volume.mean((0, 1, 3, 4)).argmax() == 5
    assert (volume[..., 8, :, :8] == 0).all()


def test_group_correlation_of_an_image_narrower_than_the_search() -> None:
    volume = group_correlation(torch.ones(1, 2, 4, 4), torch.ones(1, 2, 4, 4), 6, 1)
    assert (volume[:, :, 4:] == 0).all()


def test_likeness_of_the_same_an_inverted_and_a_plain_picture() -> None:
    image = torch.rand(1, 3, 16, 20, generator=torch.Generator().manual_seed(5))
    assert float(likeness(image, image, 5).min()) > 0.98
    assert float(likeness(image, 1 - image, 5).max()) < -0.98
    assert torch.allclose(likeness(image, 0.5 + 0.3 * image, 5), torch.ones(1), atol=0.1)
    assert float(likeness(image, torch.full_like(image, 0.4), 5).abs().max()) < 1e-2


def test_window_vectors_multiply_to_the_likeness() -> None:
    generator = torch.Generator().manual_seed(6)
    left, right = (torch.rand(1, 3, 12, 14, generator=generator) for _ in range(2))
    product = (window_vectors(left, 1) * window_vectors(right, 1)).sum(-1)
    assert torch.allclose(product, likeness(left, right, 5)[:, 0], atol=1e-5)


def test_likeness_volume_peaks_at_the_shift() -> None:
    left = torch.rand(1, 3, 16, 60, generator=torch.Generator().manual_seed(7))
    volume = likeness_volume(left, torch.roll(left, -9, dims=3), 8, (1, 3))
    assert tuple(volume.shape) == (1, 4, 8, 8, 30)
    inner = volume[0, ..., 8:-4].mean((2, 3))  # groups: dilation 1 even, odd shifts; dilation 3 even, odd shifts
    assert inner[1].argmax() == inner[3].argmax() == 4
    assert inner[1, 4] > 0.9 > inner[0].max()
    assert (volume[..., 7, :, :7] == 0).all()


def test_untrained_stereo_net_matches_already() -> None:
    torch.manual_seed(0)
    left = torch.nn.functional.interpolate(torch.rand(1, 3, 64, 128), scale_factor=2, mode="bilinear")
    with torch.inference_mode():
        first = StereoNet(16).eval()(left, torch.roll(left, -40, dims=3)).maps[0]
    assert abs(float(first[0, 0, 16:-16, 120:-16].median()) - 0.40) < 0.12


def test_warp_right_moves_by_the_disparity() -> None:
    right = torch.arange(8.0).view(1, 1, 1, 8).expand(1, 1, 3, 8)
    warped = warp_right(right, torch.full((1, 1, 3, 8), 2.0))
    assert torch.allclose(warped[0, 0, 1], torch.tensor([0.0, 0, 0, 1, 2, 3, 4, 5]), atol=1e-5)


def test_soft_argmax_of_a_sure_bin() -> None:
    logits = torch.full((1, BINS, 1, 1), -50.0)
    logits[0, 10] = 50.0
    assert float(soft_argmax(logits, torch.arange(BINS) * 4.0)) == pytest.approx(40.0)
    assert SEARCH_PX == 104.0


def test_convex_upsample_keeps_a_constant() -> None:
    up = convex_upsample(torch.full((1, 1, 3, 4), 0.7), torch.randn(1, 36, 3, 4))
    assert tuple(up.shape) == (1, 1, 6, 8)
    assert torch.allclose(up, torch.full_like(up, 0.7), atol=1e-6)


def test_focus_fraction_to_disparity() -> None:
    assert float(to_range(torch.tensor(0.5), (20.0, 60.0))) == pytest.approx(0.4)


def test_focus_prior_peaks_at_the_slice_that_focus_chose() -> None:
    logits = torch.full((1, 16, 2, 2), -20.0)
    logits[:, 5] = 20.0  # of 16 slices from 100 to 0 px: 66.7 px
    prior = focus_prior(Prediction((), (logits,)), (0.0, 100.0))
    assert tuple(prior.shape) == (1, BINS, 2, 2)
    assert int(prior[0, :, 0, 0].argmax()) == 17  # 68 px, the bin nearest to 66.7
    assert float(prior.exp().min()) == pytest.approx(FOCUS_FLOOR, rel=1e-3)
    assert focus_prior(Prediction(()), (0.0, 100.0)) is None


def test_prior_decides_between_two_equal_matches() -> None:
    """On vertical stripes every period is a match; the prior picks the one it knows."""
    x = torch.arange(256.0)
    stripes = (0.5 + 0.4 * torch.sin(2 * torch.pi * x / 20)).expand(1, 3, 64, 256)
    prior = torch.full((1, BINS, 16, 64), -30.0)
    prior[:, 9:12] = 0.0  # 36 to 44 px
    torch.manual_seed(0)
    network = StereoNet(16).eval()
    for head in network.body.aggregate.heads:
        torch.nn.init.zeros_(head.weight)  # the hourglasses, untrained, only add noise
    with torch.inference_mode():
        found = network(stripes, stripes, prior)
    assert abs(100 * float(found.joint[0, 0, 16:-16, 130:-30].median()) - 40.0) < 6.0


def test_resample_bins_keeps_a_certain_slice() -> None:
    share = torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1)
    assert resample_bins(share, 100.0, 0.0, torch.tensor([50.0, 75.0, 100.0, 104.0])).flatten().tolist() == [
        1,
        0.5,
        0,
        0,
    ]


def test_mode_mean_does_not_lie_between_two_objects() -> None:
    logits = torch.full((1, BINS, 1, 1), -20.0)
    logits[0, 5], logits[0, 20] = 3.0, 2.9
    assert float(mode_mean(logits, torch.arange(float(BINS)))) == pytest.approx(5.0, abs=1e-3)
    assert 9 < float(soft_argmax(logits, torch.arange(float(BINS)))) < 16
