"""Shift-and-add by convolutions gives what the compiled loops give."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField
from lfstereo.network.refocus_device import refocus_on_device

TOLERANCE = 2e-5  # linear RGB, values of order 1
SLOPES = np.array([1.3, 0.25, 0.0, -0.5, -2.0])


@pytest.mark.parametrize("device", ["cpu", "cuda"])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("weighted", [False, True])
def test_equals_the_compiled_loops(device: str, interpolation: str, weighted: bool) -> None:
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("no graphics card")
    rng = np.random.default_rng(0)
    views = rng.random((4, 7, 23, 29, 3), dtype=np.float32)
    weight = rng.integers(1, 256, views.shape[:4], dtype=np.uint8) if weighted else None
    if weight is not None:
        views[0, 0, 0, 0], weight[0, 0, 0, 0] = np.nan, 0
    field = LightField(views, weight, None, "", "test")
    options = RefocusOptions(interpolation=interpolation)  # type: ignore[arg-type]
    found = refocus_on_device(field, SLOPES, options, device)
    inner = np.s_[:, 8:-8, 8:-8] if interpolation == "cubic" else np.s_[:]
    np.testing.assert_allclose(found[inner], refocus(field, SLOPES, options)[inner], atol=TOLERANCE)


def test_without_weight_it_shows_the_centre_view() -> None:
    views = np.random.default_rng(1).random((3, 3, 6, 7, 3), dtype=np.float32)
    field = LightField(views, np.zeros(views.shape[:4], np.uint8), None, "", "test")
    np.testing.assert_allclose(refocus_on_device(field, np.array([0.3]), device="cpu")[0], views[1, 1], atol=TOLERANCE)


def test_refuses_what_it_cannot_do(monkeypatch: pytest.MonkeyPatch) -> None:
    field = LightField(np.zeros((1, 1, 4, 4, 3), np.float32), None, None, "", "test")
    with pytest.raises(ConfigError, match="expected the mean of linear or cubic shifts alone"):
        refocus_on_device(field, np.array([0.0]), RefocusOptions(reduction="median"), "cpu")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ConfigError, match="found no graphics card"):
        refocus_on_device(field, np.array([0.0]), device="cuda")
