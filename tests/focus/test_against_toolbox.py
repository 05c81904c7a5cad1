"""Refocusing and filters against what the Light Field Toolbox v0.5.3 computed on the same light field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.filters import FilterOptions, filter_views
from lfstereo.focus.lftoolbox import ShiftSumOptions, refocus_as_lftoolbox, slopes_by_rule
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField

TOLERANCE = 2e-4  # linear RGB; weights are rounded to 8 bits here
EQUAL = 1e-5  # linear RGB; both in single precision
FILTERED = 1e-4  # linear RGB, where the filter leaves 1 % of the weight or more
BORDER_PX = 8  # the toolbox repeats the edge, here what lies outside a view has no weight
SLOPE = 0.25  # the toolbox's, of all references but the four sums


@pytest.fixture(scope="module")
def decoded(real_data: Path) -> np.ndarray:
    codes = np.load(real_data / "lftoolbox_reference" / "crop600" / "decoded.npz")["LF"]
    return codes.astype(np.float32) / 65535


@pytest.fixture(scope="module")
def reference(real_data: Path) -> dict[str, np.ndarray]:
    with np.load(real_data / "lftoolbox_reference" / "crop600" / "filters.npz") as file:
        return dict(file)


def test_own_refocus_follows_the_slope_rule(decoded: np.ndarray, reference: dict[str, np.ndarray]) -> None:
    weight = np.rint(decoded[..., 3] * 255).astype(np.uint8)
    field = LightField(np.ascontiguousarray(decoded[..., :3]), weight, None, "", "toolbox")
    slopes = slopes_by_rule(reference["slopes"].ravel(), "lftoolbox", 15)
    found = refocus(field, slopes, RefocusOptions(aperture="all"))
    inner = slice(BORDER_PX, -BORDER_PX)
    for k, picture in enumerate(found):
        expected = reference[f"sum{k + 1}"][..., :3]
        np.testing.assert_allclose(picture[inner, inner], expected[inner, inner], atol=TOLERANCE)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_equals_shift_sum(k: int, decoded: np.ndarray, reference: dict[str, np.ndarray]) -> None:
    found = refocus_as_lftoolbox(decoded[..., :3], decoded[..., 3], float(reference["slopes"].ravel()[k - 1]))
    np.testing.assert_allclose(found.picture, reference[f"sum{k}"][..., :3], atol=EQUAL)
    np.testing.assert_allclose(found.weight, reference[f"sum{k}"][..., 3], rtol=EQUAL, atol=1e-4)


@pytest.mark.parametrize(
    "name, options",
    [
        ("med", ShiftSumOptions(reduction="median")),
        ("mx", ShiftSumOptions(reduction="max")),
        ("up2", ShiftSumOptions(upsample=2)),
        ("mask", ShiftSumOptions(mask=True)),
        ("cub", ShiftSumOptions(interpolation="cubic")),
    ],
)
def test_equals_shift_sum_with_options(
    name: str, options: ShiftSumOptions, decoded: np.ndarray, reference: dict[str, np.ndarray]
) -> None:
    found = refocus_as_lftoolbox(decoded[..., :3], decoded[..., 3], SLOPE, options)
    np.testing.assert_allclose(found.picture, reference[name][..., :3], atol=EQUAL)


def test_equals_shift_sum_without_weights(decoded: np.ndarray, reference: dict[str, np.ndarray]) -> None:
    found = refocus_as_lftoolbox(np.repeat(decoded[..., 1:2], 3, axis=-1), None, SLOPE)
    np.testing.assert_allclose(found.picture[..., 0], reference["mono"][..., 0], atol=EQUAL)


@pytest.mark.parametrize(
    "name, options",
    [
        ("plane", FilterOptions(kind="plane", near=-SLOPE, margin_px=0)),
        ("line2", FilterOptions(kind="line", near=-SLOPE, margin_px=0)),
        ("hfan", FilterOptions(kind="hyperfan", near=0.25, far=-0.5, margin_px=0)),
    ],
)
def test_equals_frequency_filters(
    name: str, options: FilterOptions, decoded: np.ndarray, reference: dict[str, np.ndarray]
) -> None:
    views, weight = filter_views(np.ascontiguousarray(decoded[..., :3]), decoded[..., 3], options)
    difference = np.abs(views[7, 7] - reference[name])
    left = weight[7, 7]
    assert difference[left > 0.01 * left.max()].max() < FILTERED
    # A colour is a quotient by the weight: what single precision leaves of both grows as the weight fades.
    assert (difference * left[..., None]).max() < EQUAL
