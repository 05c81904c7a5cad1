"""Filters of light fields on waves of one slope."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.fft

from lfstereo.errors import ConfigError
from lfstereo.focus.filters import FilterOptions, filter_light_field, filter_views, frequency_response
from lfstereo.lightfield.field import LightField

SIZE = (9, 9, 20, 25)
MARGIN_FREE = {"margin_px": 0}


def wave(slope: float, cycles: int) -> np.ndarray:
    """Views of a wave of whole periods across the picture and, for whole ``slope * cycles * 9 / 25``, across views."""
    s = np.arange(9)[:, None] - 4
    u = np.arange(25)[None, :]
    row = 0.5 + 0.4 * np.cos(2 * np.pi * cycles / 25 * (u + slope * s))
    return np.broadcast_to(row[None, :, None, :, None], (*SIZE, 3)).astype(np.float32).copy()


def contrast(views: np.ndarray) -> float:
    return float(views[4, 4, :, :, 0].std() * np.sqrt(2) / 0.4)


@pytest.mark.parametrize("kind", ["line", "plane", "dual-fan", "hypercone", "hyperfan"])
def test_lets_its_slope_through(kind: str) -> None:
    slope = 25 / 9 / 5  # five periods across the picture are one across the views
    options = FilterOptions(kind=kind, near=slope, far=0.0, **MARGIN_FREE)  # type: ignore[arg-type]
    found, _ = filter_views(wave(slope, 5), None, options)
    assert contrast(found) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("kind", ["line", "plane", "dual-fan", "hyperfan"])
def test_stops_what_lies_elsewhere(kind: str) -> None:
    slope = 25 / 9 / 5
    options = FilterOptions(kind=kind, near=-0.3, far=-0.6, **MARGIN_FREE)  # type: ignore[arg-type]
    found, _ = filter_views(wave(slope, 5), None, options)
    assert contrast(found) < 0.01


@pytest.mark.parametrize("rolloff", ["gaussian", "butterworth"])
def test_half_the_power_at_the_bandwidth(rolloff: str) -> None:
    options = FilterOptions(kind="plane", near=0.0, bandwidth=1 / 9, rolloff=rolloff, **MARGIN_FREE)  # type: ignore[arg-type]
    response = frequency_response(SIZE, options)
    assert response[0, 0, 3, 4] == pytest.approx(1.0)
    assert response[0, 1, 3, 4] == pytest.approx(np.sqrt(0.5), abs=1e-6)


def test_a_swept_hyperfan_lies_in_the_dual_fan_and_a_hyperfan_in_both() -> None:
    fan, cone, both, swept = (
        frequency_response(SIZE, FilterOptions(kind=kind, near=0.4, far=-0.2, swept=swept, **MARGIN_FREE))  # type: ignore[arg-type]
        for kind, swept in (("dual-fan", False), ("hypercone", False), ("hyperfan", False), ("hyperfan", True))
    )
    np.testing.assert_allclose(both, fan * cone, atol=1e-6)
    assert np.all(swept <= fan + 1e-6)


@pytest.mark.parametrize("size", [(9, 9, 20, 25), (4, 6, 8, 10)])
def test_response_is_that_of_a_real_filter(size: tuple[int, int, int, int]) -> None:
    """The same at opposite frequencies, so that what comes back is real."""
    response = frequency_response(size, FilterOptions(kind="hyperfan", near=0.4, far=-0.2))
    kernel = scipy.fft.irfftn(response, size)
    np.testing.assert_allclose(scipy.fft.rfftn(kernel), response, atol=1e-5)


def test_noise_beside_the_scene_is_taken_away() -> None:
    slope = 25 / 9 / 5
    clean = wave(slope, 5)
    noise = 0.05 * np.random.default_rng(0).standard_normal(clean.shape).astype(np.float32)
    field = LightField(clean + noise, None, None, "", "test")
    found = filter_light_field(field, FilterOptions(kind="hyperfan", near=0.7, far=0.4, margin_px=0))
    inner = np.s_[4, 4, 3:-3, 3:-3]
    assert (found.views - clean)[inner].std() < 0.25 * noise[inner].std()
    assert found.weight is not None and found.weight.max() == 255


def test_a_white_scene_stays_white() -> None:
    weight = np.full(SIZE, 200, np.uint8)
    field = LightField(np.full((*SIZE, 3), 0.7, np.float32), weight, None, "", "test")
    found = filter_light_field(field, FilterOptions(kind="plane", near=0.2, margin_views=2))
    np.testing.assert_allclose(found.views, 0.7, atol=1e-3)


@pytest.mark.parametrize(
    "options, message",
    [
        (FilterOptions(near=0.1, far=0.2), "fall from near to far"),
        (FilterOptions(kind="plane", near=np.nan), "fall from near to far"),
        (FilterOptions(bandwidth=0.0), "bandwidth = 0"),
        (FilterOptions(order=0), "order = 0: expected 1"),
        (FilterOptions(margin_px=-1), "margin_px = -1"),
    ],
)
def test_refuses_impossible_filters(options: FilterOptions, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        filter_views(np.zeros((*SIZE, 3), np.float32), None, options)
