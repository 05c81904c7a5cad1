"""The truth against closed forms: disparity, occlusion band, photo-consistency; rooms stay in range."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.conventions import depth_from_disparity
from lfstereo.depth.pfm import read_pfm
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.primitives import PATCH
from lfstereo.simulate.rigs import SimulatedRig, build_rig
from lfstereo.simulate.room import room
from lfstereo.simulate.scene import Scene, Surface, even_light, primitive
from lfstereo.simulate.texture import MOTTLED
from lfstereo.simulate.truth import true_maps, write_truth

NEAR_M, FAR_M = 0.8, 1.0


def two_cards(rig: SimulatedRig) -> Scene:
    """A narrow card before a wall, both across the rectified view."""
    geometry = rectified_geometry(rig.stereo)
    camera_from_rectified = geometry.left.rectified_from_camera.T
    rows = []
    for z, half, seed in ((NEAR_M, (0.010, 0.5, 1.0), 1), (FAR_M, (2.0, 2.0, 1.0), 2)):
        middle = np.array([(geometry.size[1] / 2 - geometry.left.principal_px[0]) / geometry.focal_px * z, 0.0, z])
        surface = Surface(MOTTLED, ("#202020", "#f0f0f0", "#f0f0f0"), 0.02, 0.0, seed)
        rows.append(primitive(PATCH, middle, np.eye(3), half, surface))
    scene = Scene(np.stack(rows), even_light(), np.ones((1, 2, 2), np.float32))
    return scene.seen_from(camera_from_rectified, np.zeros(3))


def test_disparity_and_occlusion_of_two_cards(rig: SimulatedRig) -> None:
    geometry = rectified_geometry(rig.stereo)
    truth = true_maps(two_cards(rig), rig.stereo, 2)
    near, far = (geometry.focal_px * geometry.baseline_m / z - geometry.doffs_px for z in (NEAR_M, FAR_M))
    values = np.unique(truth.disparity.round(3))
    np.testing.assert_allclose(values, [far, near], atol=2e-3)
    back = depth_from_disparity(truth.disparity[40, 60], geometry.focal_px, geometry.baseline_m, geometry.doffs_px)
    assert back == pytest.approx(truth.depth_m[40, 60], rel=1e-5)
    # To the left of the near card the right camera does not see the wall, over the difference of the disparities.
    row = geometry.size[0] // 2
    first = int(np.argmax(truth.depth_m[row] < 0.9))
    hidden = np.flatnonzero(truth.occluded[row])
    assert hidden[-1] == first - 1
    expected = min(near - far, first)
    assert len(hidden) == pytest.approx(expected, abs=1.01) or not truth.valid[row, hidden[0] - 1]


def test_views_agree_where_both_see(rig: SimulatedRig) -> None:
    truth = true_maps(two_cards(rig), rig.stereo, 8)
    rows, columns = np.nonzero(truth.valid & ~truth.occluded)
    x = columns - truth.disparity[rows, columns]
    left = np.floor(x).astype(int).clip(0, truth.valid.shape[1] - 2)
    part = (x - left)[:, None]
    right = (1 - part) * truth.centre_right[rows, left] + part * truth.centre_right[rows, left + 1]
    difference = np.abs(truth.centre_left[rows, columns] - right)
    assert np.median(difference) < 0.005
    assert difference.mean() < 0.02


@pytest.mark.parametrize(("sensor", "seed"), [("small", 1), ("illum", 2)])
def test_room_fills_the_view_inside_the_working_range(sensor: str, seed: int) -> None:
    options = SimulateOptions(sensor=sensor, seed=seed)  # type: ignore[arg-type]
    rig = build_rig(options)
    scene = room(options, rig)
    truth = true_maps(scene, rig.stereo, 1)
    geometry = rectified_geometry(rig.stereo)
    assert np.isfinite(truth.disparity).all()
    assert truth.depth_m.min() > options.near_m
    assert truth.depth_m.max() < options.far_m
    assert truth.disparity.min() > 0
    assert truth.disparity.max() < geometry.disparity_max_px
    counts, _ = np.histogram(truth.disparity, 5, (0, geometry.disparity_max_px))
    assert np.all(counts > 0.005 * truth.disparity.size), "depth is layered, not two planes"
    assert truth.centre_left.max() < 1.3
    assert 0.1 < truth.centre_left.mean() < 0.5
    if sensor == "illum":
        assert truth.valid.mean() > 0.75
        assert 0.01 < truth.occluded.mean() < 0.2


@pytest.mark.parametrize(
    "values", [{"focal_length_m": 0.0095}, {"near_m": 0.8, "far_m": 1.0}, {"near_m": 1.0, "far_m": 3.0, "focus_m": 1.6}]
)
def test_room_fits_other_lenses_and_ranges(values: dict[str, float]) -> None:
    options = SimulateOptions(**values)  # type: ignore[arg-type]
    rig = build_rig(options)
    truth = true_maps(room(options, rig), rig.stereo, 1)
    assert options.near_m < truth.depth_m.min()
    assert truth.depth_m.max() < options.far_m


def test_room_follows_the_seed(rig: SimulatedRig) -> None:
    same = [room(SimulateOptions(sensor="small", seed=5), rig) for _ in range(2)]
    np.testing.assert_array_equal(same[0].primitives, same[1].primitives)
    np.testing.assert_array_equal(same[0].light_maps, same[1].light_maps)
    other = room(SimulateOptions(sensor="small", seed=6), rig)
    assert other.primitives.shape != same[0].primitives.shape or not np.allclose(other.primitives, same[0].primitives)


def test_written_truth_reads_back(rig: SimulatedRig, tmp_path) -> None:  # type: ignore[no-untyped-def]
    truth = true_maps(two_cards(rig), rig.stereo, 1)
    write_truth(tmp_path, truth)
    values, known = read_pfm(tmp_path / "disparity.pfm")
    np.testing.assert_array_equal(values, truth.disparity)
    assert known.all()
    names = {"disparity.pfm", "depth.tiff", "valid.png", "occlusion.png", "centre_left.png", "centre_right.png"}
    assert {p.name for p in tmp_path.iterdir()} == names
