"""Finer pictures from views that differ by parts of a pixel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.focus.superresolve import superresolve
from lfstereo.lightfield.field import LightField

ALL_VIEWS = RefocusOptions(aperture="all")
OMEGA = 4.0  # rad per px, beyond the pi that one view can hold


def fine_wave(slope: float, size: tuple[int, int] = (30, 40)) -> LightField:
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float64)
    views = np.empty((5, 5, *size, 3), np.float32)
    for t in range(5):
        for s in range(5):
            views[t, s] = pattern(x + slope * (s - 2), y + slope * (t - 2))[..., None]
    return LightField(views, None, None, "", "test")


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 + 0.3 * np.cos(OMEGA * x + 0.5 * y)


def wanted(factor: int, size: tuple[int, int] = (30, 40)) -> np.ndarray:
    y, x = np.mgrid[: size[0] * factor, : size[1] * factor]
    return pattern((x + 0.5) / factor - 0.5, (y + 0.5) / factor - 0.5)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("factor", [2, 3])
def test_shows_what_no_view_can(factor: int, weighted: bool) -> None:
    field = fine_wave(0.4)
    if weighted:
        weight = np.full(field.views.shape[:4], 180, np.uint8)
        views = field.views.copy()
        views[0, 0], weight[0, 0] = 50.0, 0
        field = LightField(views, weight, None, "", "test")
    found = superresolve(field, 0.4, factor, ALL_VIEWS)[..., 0]
    plain = cv2.resize(
        refocus(fine_wave(0.4), [0.4], ALL_VIEWS)[0, ..., 0], found.shape[::-1], interpolation=cv2.INTER_CUBIC
    )
    inner = np.s_[6:-6, 6:-6]
    error, of_plain = (np.sqrt(np.mean((p - wanted(factor))[inner] ** 2)) for p in (found, plain))
    assert error < 0.5 * of_plain
    assert np.corrcoef(found[inner].ravel(), wanted(factor)[inner].ravel())[0, 1] > 0.9


def test_without_fractions_it_is_the_interpolated_picture() -> None:
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.random((20, 24, 3), np.float32), (0, 0), 1.5)
    field = LightField(np.broadcast_to(picture, (3, 3, 20, 24, 3)).copy(), None, None, "", "test")
    found = superresolve(field, 0.0, 2, ALL_VIEWS)
    cubic = cv2.resize(picture, (48, 40), interpolation=cv2.INTER_CUBIC)
    assert np.abs(found - cubic).max() < 0.08
    np.testing.assert_allclose(superresolve(field, 0.0, 1, ALL_VIEWS), picture, atol=1e-5)


def test_a_white_scene_stays_white() -> None:
    field = LightField(np.full((3, 3, 10, 12, 3), 0.7, np.float32), None, None, "", "test")
    np.testing.assert_allclose(superresolve(field, 0.37, 3), 0.7, atol=1e-5)


def test_refuses_what_cannot_be() -> None:
    field = fine_wave(0.4)
    with pytest.raises(ConfigError, match="factor = 0"):
        superresolve(field, 0.4, 0)
    with pytest.raises(ConfigError, match="expected the mean without tilt"):
        superresolve(field, 0.4, 2, RefocusOptions(reduction="median"))
