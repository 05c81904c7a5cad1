"""The range of slopes found in light fields whose slopes are known."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.depth.pfm import read_pfm
from lfstereo.errors import ConfigError, QualityError, ShapeError
from lfstereo.focus.slope_map import FocusRangeOptions, estimate_slopes, find_focus_range
from lfstereo.lightfield.encoding import srgb_to_linear
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import read_light_field

TWO_PLANES = 0.03  # px per view
HCI_LIMITS = 0.25  # px per view, of a range of 5.6
HCI_MEDIAN = 0.05  # px per view
MULTIVIEW_LIMITS = 0.4  # px per view, of ranges of 2 to 5


def two_planes(near: float, far: float, grid: tuple[int, int]) -> LightField:
    """A near left half before a far wall, both of smooth random texture."""
    rng = np.random.default_rng(0)
    textures = [cv2.GaussianBlur(rng.random((120, 180), np.float32), (0, 0), 1.5) for _ in range(2)]
    textures = [(t - t.min()) / (t.max() - t.min()) for t in textures]
    y, x = np.mgrid[:80, :120].astype(np.float32)
    views = np.empty((*grid, 80, 120, 3), np.float32)
    for t in range(grid[0]):
        for s in range(grid[1]):
            right, down = np.float32(s - grid[1] // 2), np.float32(t - grid[0] // 2)
            front, wall = (
                cv2.remap(texture, x + slope * right + 30, y + slope * down + 20, cv2.INTER_CUBIC)
                for texture, slope in zip(textures, (near, far), strict=True)
            )
            views[t, s] = np.where(x + near * right < 60, front, wall)[..., None]
    return LightField(views, None, None, "", "two planes")


@pytest.mark.parametrize(
    "near, far, grid", [(0.35, -0.25, (7, 7)), (1.6, 0.4, (5, 5)), (3.2, -2.4, (1, 5)), (0.2, -0.3, (9, 1))]
)
def test_finds_both_planes(near: float, far: float, grid: tuple[int, int]) -> None:
    field = two_planes(near, far, grid)
    found = find_focus_range(field, FocusRangeOptions(share=0.05))
    assert found.near == pytest.approx(near, abs=TWO_PLANES)
    assert found.far == pytest.approx(far, abs=TWO_PLANES)
    assert found.certain_share > 0.2


def test_says_how_uncertain_a_slope_is() -> None:
    field = two_planes(0.35, -0.25, (7, 7))
    noisy = field.views + 0.02 * np.random.default_rng(1).standard_normal(field.views.shape).astype(np.float32)
    sharp, dull = estimate_slopes(field), estimate_slopes(LightField(noisy, None, None, "", "noisy"))
    assert np.median(dull.uncertainty) > 2 * np.median(sharp.uncertainty)


def test_slopes_of_a_rendered_light_field(real_data: Path) -> None:
    folder = real_data / "lf" / "hci_antinous"
    truth, _ = read_pfm(folder / "gt_disp_lowres.pfm")
    field = read_light_field(folder)
    assert truth.shape == field.views.shape[2:4]
    found = find_focus_range(field)
    far, near = np.quantile(truth, [0.005, 0.995])
    assert found.near == pytest.approx(near, abs=HCI_LIMITS)
    assert found.far == pytest.approx(far, abs=HCI_LIMITS)
    slopes = estimate_slopes(field)
    assert np.median(np.abs(slopes.slope - truth)[slopes.certain]) < HCI_MEDIAN


@pytest.mark.parametrize("name", ["Venus", "bull"])
def test_slopes_of_photographs_in_a_row(name: str, real_data: Path) -> None:
    folder = real_data / "stereo" / "mb2001_multiview" / name
    pictures = [cv2.imread(str(folder / f"im{i}.ppm"))[..., ::-1] for i in range(5)]
    views = srgb_to_linear(np.stack(pictures)[None])  # view 2, whose truth is known, in the middle
    truth = cv2.imread(str(folder / "disp2.pgm"), cv2.IMREAD_GRAYSCALE).astype(np.float32) / 8 / 4
    found = find_focus_range(LightField(views, None, None, "", name))
    far, near = np.quantile(truth[truth > 0], [0.005, 0.995])
    assert found.near == pytest.approx(near, abs=MULTIVIEW_LIMITS)
    assert found.far == pytest.approx(far, abs=MULTIVIEW_LIMITS)


def test_refuses_what_has_no_slope() -> None:
    flat = LightField(np.full((3, 3, 40, 40, 3), 0.5, np.float32), None, None, "", "flat")
    with pytest.raises(QualityError, match=r"flat: found \d+ pixels with a sure slope"):
        find_focus_range(flat)
    with pytest.raises(ShapeError, match="found a single view"):
        find_focus_range(LightField(np.zeros((1, 1, 40, 40, 3), np.float32), None, None, "", "one"))


@pytest.mark.parametrize(
    "options", [FocusRangeOptions(search=0.0), FocusRangeOptions(window_px=-1.0), FocusRangeOptions(share=0.6)]
)
def test_refuses_impossible_options(options: FocusRangeOptions) -> None:
    with pytest.raises(ConfigError, match=r"(search|window_px|share) = "):
        find_focus_range(two_planes(0.3, -0.3, (1, 3)), options)
