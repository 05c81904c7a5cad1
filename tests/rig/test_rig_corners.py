"""Corners of painted boards: found in every view, where the painting has them."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.errors import TargetNotFoundError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig.corners import CornerOptions, find_board, find_corners
from lfstereo.rig.sightings import Sightings, merge_views, usable
from lfstereo.rig.target import Target
from lfstereo.rig.target_print import lay_out

CHECKERBOARD = Target("checkerboard", (7, 6), 0.010)
CHARUCO = Target("charuco", (6, 3), 0.018)
SIZE = (150, 210)
VIEWS = 7
SLOPE_PX = 0.35
PLACE_TOLERANCE_PX = 0.05
"""Of one corner in one view, checkerboard with squares of about 13 px."""
CHARUCO_TOLERANCE_PX = 0.12
"""Likewise of a charuco board with squares of about 23 px, its markers 3 px from the corners."""
TURN = np.array([[1.25, 0.17, 30.0], [-0.14, 1.3, 24.0], [0.0004, 0.0002, 1.0]])
"""Homography from board mm, printed page, to px of the centre view."""


def painted(target: Target, homography: np.ndarray, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Return a board in perspective, antialiased, ``(H, W)`` 0..1."""
    sheet, px_per_mm, fine = lay_out(target), 8, 4
    page = np.full([round(sheet.height_mm * px_per_mm), round(sheet.width_mm * px_per_mm)], 0.9, np.float32)
    for (x, y, w, h), black in sheet.boxes[: -12 if target.kind == "charuco" else None]:
        ends = [round(v * px_per_mm) for v in (y, y + h, x, x + w)]
        page[ends[0] : ends[1], ends[2] : ends[3]] = 0.06 if black else 0.9
    page_from_px = np.array([[1 / px_per_mm, 0, 0.5 / px_per_mm], [0, 1 / px_per_mm, 0.5 / px_per_mm], [0, 0, 1]])
    enlarge = np.array([[fine, 0, (fine - 1) / 2], [0, fine, (fine - 1) / 2], [0, 0, 1.0]])
    large = cv2.warpPerspective(
        page, enlarge @ homography @ page_from_px, (size[1] * fine, size[0] * fine), borderValue=0.4
    )
    return cv2.resize(large, size[::-1], interpolation=cv2.INTER_AREA)


def expected_px(target: Target, homography: np.ndarray) -> np.ndarray:
    page = target.points[:, :2] * 1e3 + 8.0 + target.square_m * 1e3
    mapped = np.column_stack([page, np.ones(len(page))]) @ homography.T
    return mapped[:, :2] / mapped[:, 2:]


def light_field(target: Target, noise: float = 0.004, turn: np.ndarray = TURN) -> LightField:
    rng = np.random.default_rng(0)
    views = np.empty((VIEWS, VIEWS, *SIZE, 3), np.float32)
    for t, s in np.ndindex(VIEWS, VIEWS):
        shift = np.eye(3)
        shift[:2, 2] = -SLOPE_PX * (s - VIEWS // 2), -SLOPE_PX * (t - VIEWS // 2)
        views[t, s] = painted(target, shift @ turn)[..., None] + rng.normal(0, noise, (*SIZE, 3))
    weight = np.full(views.shape[:4], 255, np.uint8)
    weight[0, 0] = weight[0, -1] = 20
    return LightField(np.maximum(views, 0), weight, None, "B1", "painted")


def missed_px(seen: Sightings, target: Target, turn: np.ndarray = TURN) -> np.ndarray:
    return seen.place - (expected_px(target, turn)[seen.corner] - SLOPE_PX * seen.offset)


@pytest.mark.parametrize(
    ("target", "tolerance_px"), [(CHECKERBOARD, PLACE_TOLERANCE_PX), (CHARUCO, CHARUCO_TOLERANCE_PX)]
)
def test_corners_are_found_in_every_view_with_weight(target: Target, tolerance_px: float) -> None:
    seen = find_corners(light_field(target), target)
    assert (seen.serial, seen.source) == ("B1", "painted")
    assert len(np.unique(seen.offset, axis=0)) == VIEWS**2 - 2
    assert len(seen.corner) > 0.97 * (VIEWS**2 - 2) * len(target.points)
    miss = missed_px(seen, target)
    assert np.sqrt(np.mean(miss**2)) < tolerance_px
    assert np.abs(miss.mean(axis=0)).max() < 0.2 * tolerance_px
    np.testing.assert_array_equal(seen.weight, 1.0)


def test_a_board_upside_down_is_counted_from_its_own_first_corner() -> None:
    half_turn = np.array([[-1.0, 0, SIZE[1] - 1], [0, -1.0, SIZE[0] - 1], [0, 0, 1]]) @ TURN
    picture = np.rint(painted(CHECKERBOARD, half_turn) * 255).astype(np.uint8)
    _, place = find_board(picture, CHECKERBOARD, "turned")
    np.testing.assert_allclose(place, expected_px(CHECKERBOARD, half_turn), atol=0.2)


def test_a_charuco_board_cut_off_by_the_border_is_found_in_part() -> None:
    moved = np.array([[1.0, 0, -70], [0, 1, 0], [0, 0, 1]]) @ TURN
    seen = find_corners(light_field(CHARUCO, turn=moved), CHARUCO)
    assert 8 <= len(np.unique(seen.corner)) < 18
    assert np.sqrt(np.mean(missed_px(seen, CHARUCO, moved) ** 2)) < CHARUCO_TOLERANCE_PX


def test_places_are_in_sensor_px_where_the_sampling_is_known() -> None:
    plain = find_corners(light_field(CHECKERBOARD), CHECKERBOARD)
    sampling = ViewSampling((6.0, 5.0), (12.0, 12.5), 0.01, 0.9)
    sampled = find_corners(dataclasses.replace(light_field(CHECKERBOARD), sampling=sampling), CHECKERBOARD)
    np.testing.assert_allclose(sampled.offset, plain.offset * 0.9)
    x, y = (plain.place * [12.0, 12.5]).T
    c, s = np.cos(0.01), np.sin(0.01)
    np.testing.assert_allclose(sampled.place, np.stack([6 + c * x - s * y, 5 + s * x + c * y], axis=1))


def test_merged_views_keep_the_paths_of_the_corners() -> None:
    seen = find_corners(light_field(CHECKERBOARD), CHECKERBOARD, CornerOptions(agree_px=0.3))
    merged = merge_views(seen, 3)
    assert len(merged.corner) < len(seen.corner) / 5
    assert merged.weight.sum() == pytest.approx(seen.weight.sum())
    assert np.abs(missed_px(merged, CHECKERBOARD)).max() < 2 * PLACE_TOLERANCE_PX
    corner, place = merged.centre_view()
    np.testing.assert_allclose(place, expected_px(CHECKERBOARD, TURN)[corner], atol=2 * PLACE_TOLERANCE_PX)
    assert usable(merged)


def test_real_checkerboards_of_a_first_generation_camera(real_data: Path) -> None:
    folder = real_data / "raw/jaramillo_f01/CalSamples"
    published = json.loads((folder / "CalInfo.json").read_text())["EstCamIntrinsicsH"]
    target = Target("checkerboard", (22, 19), 0.004)
    pictures = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(folder.glob("raw?*__Decoded_Thumb.png"))]
    assert len(pictures) == 9
    places = [find_board(picture, target, "thumb")[1].astype(np.float32) for picture in pictures]
    points = [target.points.astype(np.float32)] * len(places)
    rms, matrix, *_ = cv2.calibrateCamera(points, places, (379, 379), None, None)
    assert rms < 0.2  # px
    for axis in (0, 1):  # the published camera also uses the other views
        assert matrix[axis, axis] == pytest.approx(1 / published[axis + 2][axis + 2], rel=0.03)


def test_says_that_there_is_no_board() -> None:
    empty = LightField(np.full((3, 3, 60, 80, 3), 0.5, np.float32), None, None, "", "grey.h5")
    for target, how in ((CHECKERBOARD, "whole"), (CHARUCO, "with 8 corners or more")):
        with pytest.raises(TargetNotFoundError, match=rf"grey\.h5: found no {target.kind} of .* expected it {how}"):
            find_corners(empty, target)
