"""The rig: corners projected by the plenoptic camera give the rig they were projected with."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lfstereo.errors import RigError
from lfstereo.rig.bundle import RigOptions, RigSolution, ShotPair, solve_rig
from lfstereo.rig.intrinsics import plenoptic_rays, project
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig, write_rig
from lfstereo.rig.sightings import Sightings
from lfstereo.rig.start import start_poses, start_pupil
from lfstereo.rig.target import Target
from lfstereo.rig.thin_lens import ThinLens
from lfstereo.rig.trust import check_baseline

TARGET = Target("checkerboard", (13, 8), 0.020)
LEFT = PlenopticCamera("L", (7728, 5368), (14657.0, 14660.0), (3880.0, 2667.0), 0.85, 7.47e-4)
RIGHT = PlenopticCamera("R", (7728, 5368), (14672.0, 14669.0), (3845.0, 2693.0), 0.87, 7.53e-4)
RIG = StereoRig(LEFT, RIGHT, (0.0042, 0.1092, 0.0042), (-0.0948, -0.0006, 0.0057), 0.6, 1.2, 12.4)
NOISE_PX = 0.35
"""Of a corner, sensor px: 0.03 px of a view."""
BASELINE_TOLERANCE = 0.002
ROTATION_TOLERANCE_RAD = math.radians(0.02)
OFFSETS = np.stack(np.meshgrid(np.linspace(-4.4, 4.4, 3), np.linspace(-4.4, 4.4, 3)), axis=-1).reshape(-1, 2)


def parameters(camera: PlenopticCamera) -> np.ndarray:
    lens = [1 / camera.focus_distance_m, camera.pupil_m_per_px]
    return np.array([*camera.focal_px, *camera.principal_px, *lens, *camera.distortion])


def sightings(camera: PlenopticCamera, points: np.ndarray, rng: np.random.Generator, name: str) -> Sightings:
    rays, _ = plenoptic_rays(parameters(camera))
    corner = np.tile(np.arange(len(points)), len(OFFSETS))
    offset = np.repeat(OFFSETS, len(points), axis=0)
    place = project(rays, offset, points[corner], np.zeros((len(corner), 2)), stigmatic=True).place
    inside = np.all((place > 0) & (place < camera.sensor_px), axis=1)
    return Sightings(
        name, camera.serial, corner, offset, place + rng.normal(0, NOISE_PX, place.shape), inside.astype(np.float64)
    )


def poses(count: int, rng: np.random.Generator, tilt: float = 0.5, near: float = 0.6, far: float = 1.1) -> list:
    found = []
    for n in range(count):
        rotation = Rotation.from_rotvec(rng.uniform(-tilt, tilt, 3) * [1, 1, 0.3]).as_matrix()
        z = near + (far - near) * ((0.5 + 0.618 * n) % 1)
        centre = [z * rng.uniform(-0.09, 0.09) + 0.0475, z * rng.uniform(-0.07, 0.07), z]
        found.append((rotation, centre - rotation @ TARGET.points.mean(axis=0)))
    return found


def shots(rig: StereoRig, boards: list, rng: np.random.Generator) -> list[ShotPair]:
    pairs = []
    for n, (rotation, translation) in enumerate(boards):
        left = TARGET.points @ rotation.T + translation
        right = left @ rig.right_from_left.T + rig.translation_m
        both = (sightings(rig.left, left, rng, f"{n:02d}_left"), sightings(rig.right, right, rng, f"{n:02d}_right"))
        pairs.append(ShotPair(f"{n:02d}", *both))
    return pairs


@functools.cache
def simulated(seed: int, bent: bool) -> tuple[StereoRig, tuple[ShotPair, ...]]:
    rng = np.random.default_rng(seed)
    bend = (-0.12, 0.2, 0.0, 0.01, -0.005) if bent else (0.0,) * 5
    rig = dataclasses.replace(RIG, left=dataclasses.replace(LEFT, distortion=bend))
    return rig, tuple(shots(rig, poses(10, rng), rng))


def solved(pairs: list[ShotPair] | tuple[ShotPair, ...], options: RigOptions = RigOptions()) -> RigSolution:
    return solve_rig(pairs, TARGET.points, (LEFT.sensor_px, RIGHT.sensor_px), 12.4, options)


@pytest.mark.parametrize(("seed", "bent"), [(0, False), (1, True)])
def test_the_rig_is_found(seed: int, bent: bool, tmp_path: Path) -> None:
    rig, pairs = simulated(seed, bent)
    found = solved(pairs)
    assert found.rejected == ()
    assert found.sigma_px == pytest.approx(NOISE_PX, rel=0.05)
    assert found.rig.baseline_m == pytest.approx(rig.baseline_m, rel=BASELINE_TOLERANCE)
    turn = Rotation.from_matrix(found.rig.right_from_left @ rig.right_from_left.T).magnitude()
    assert turn < ROTATION_TOLERANCE_RAD
    assert abs(found.rig.baseline_m - rig.baseline_m) < 4 * found.baseline_sd_m
    for side in ("left", "right"):
        camera, truth = getattr(found.rig, side), getattr(rig, side)
        assert camera.serial == truth.serial
        assert camera.focal_px == pytest.approx(truth.focal_px, rel=0.003)
        assert camera.focus_distance_m == pytest.approx(truth.focus_distance_m, rel=0.005)
        assert camera.pupil_m_per_px == pytest.approx(truth.pupil_m_per_px, rel=0.005)
    write_rig(tmp_path / "rig.toml", found.rig)
    assert read_rig(tmp_path / "rig.toml") == found.rig


def test_shots_that_contradict_are_rejected_by_name() -> None:
    _, pairs = simulated(0, False)
    spoilt = list(pairs)
    spoilt[3] = dataclasses.replace(spoilt[3], right=dataclasses.replace(pairs[4].right, source="moved"))
    found = solved(spoilt)
    assert found.rejected == ("03",)
    assert found.rig.baseline_m == pytest.approx(RIG.baseline_m, rel=BASELINE_TOLERANCE)


def test_the_order_of_the_shots_does_not_matter() -> None:
    _, pairs = simulated(0, False)
    assert solved(pairs).rig == solved(pairs[::-1]).rig


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ({"count": 3}, "3 of 3 shots usable.*photograph the target about 15 times"),
        ({"count": 6, "tilt": 0.02}, "all boards are parallel.*tilted by 20 to 30 degrees"),
        ({"count": 6, "near": 0.85, "far": 0.87}, "0.8. to 0.8. m away.*near and far end"),
    ],
)
def test_refuses_sets_that_do_not_determine_the_rig(pose: dict, message: str) -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(RigError, match=message):
        solved(shots(RIG, poses(rng=rng, **pose), rng))


def test_refuses_boards_in_one_part_of_the_frame_unless_told_otherwise() -> None:
    rng = np.random.default_rng(6)
    far = [(r, np.asarray(t) * [0.2, 0.2, 2.5]) for r, t in poses(6, rng)]
    pairs = shots(RIG, far, rng)
    with pytest.raises(RigError, match="frame's width, expected 40% or more; photograph the board near the left"):
        solved(pairs)
    assert solved(pairs, RigOptions(any_set=True)).rig.baseline_m > 0


def test_refuses_an_uncertain_baseline() -> None:
    with pytest.raises(RigError, match=r"baseline is 95\.0 mm with a standard deviation of 3\.00 mm, expected 2%"):
        check_baseline(0.095, 0.003)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"offset": 0.0}, "each shot has one view only"),
        ({"place": -1.0}, "do not move between the views"),
    ],
)
def test_refuses_views_that_do_not_tell_depth(change: dict, message: str) -> None:
    _, pairs = simulated(0, False)
    lefts = [pair.left for pair in pairs[:3]]
    lefts = [dataclasses.replace(s, **{name: getattr(s, name) * by for name, by in change.items()}) for s in lefts]
    depths = [np.full(len(TARGET.points), z) for z in (0.9, 0.6, 1.1)]
    with pytest.raises(RigError, match=message):
        start_pupil(lefts, depths, 14660.0)


def test_refuses_corners_that_no_board_explains() -> None:
    _, pairs = simulated(0, False)
    nowhere = dataclasses.replace(pairs[0].left, place=pairs[0].left.place * np.nan)
    with pytest.raises(RigError, match=r"00_left: no pose of the board explains its corners; drop this shot"):
        start_poses(nowhere, TARGET.points, 14660.0, np.zeros(2))


def lens_like(camera: PlenopticCamera, stretch: float = 1.0) -> ThinLens:
    """Return what the metadata of a camera would say, its lenslets' distance stretched."""
    return ThinLens(0.02, 0.02, 1.4e-6 * 0.02 / camera.pupil_m_per_px * stretch, 0.02, 1.4e-6)


def test_a_calibration_within_its_bounds_is_what_it_is_without() -> None:
    rng = np.random.default_rng(2)
    pairs = shots(RIG, poses(8, rng), rng)
    shown = (pairs, TARGET.points, (LEFT.sensor_px, RIGHT.sensor_px), 12.4)
    bound = solve_rig(*shown, lenses=(lens_like(LEFT), lens_like(RIGHT)))
    free = solve_rig(*shown)
    assert bound.rig.baseline_m == pytest.approx(free.rig.baseline_m, rel=1e-4)
    assert bound.rig.left.focal_px == pytest.approx(free.rig.left.focal_px, rel=1e-4)


def test_a_board_of_other_squares_is_refused() -> None:
    rng = np.random.default_rng(2)
    pairs = shots(RIG, poses(8, rng), rng)
    shown = (pairs, 2 * TARGET.points, (LEFT.sensor_px, RIGHT.sensor_px), 12.4)
    lenses = (lens_like(LEFT), lens_like(RIGHT))
    with pytest.raises(RigError, match=r"the left camera's pupil comes out at .* measure square_m on the print"):
        solve_rig(*shown, lenses=lenses)
    accepted = solve_rig(*shown, RigOptions(any_lens=True), lenses=lenses)
    assert accepted.rig.baseline_m == pytest.approx(2 * RIG.baseline_m, rel=0.005)


def test_ordinary_stereo_pairs_agree_with_the_published_rig(real_data: Path) -> None:
    target = Target("checkerboard", (9, 6), 0.030)
    pairs = []
    for number in range(1, 15):
        seen = [pinhole_shot(real_data / f"calib/opencv_bouguet_jpg14/{s}{number:02d}.jpg") for s in ("left", "right")]
        if all(seen):
            pairs.append(ShotPair(f"{number:02d}", seen[0], seen[1]))
    found = solve_rig(pairs, target.points, ((640, 480), (640, 480)), 1.0)
    # Bouguet, "Camera calibration toolbox for Matlab", fifth example: after global optimisation.
    miss = np.abs(np.subtract(found.rig.translation_m, (-0.09980198, 0.00112443, 0.00005041)))
    assert np.all(miss < (0.142e-3, 0.114e-3, 0.498e-3)), miss
    turn = np.abs(np.subtract(found.rig.rotation_rad, (0.00669, 0.00452, -0.00350)))
    assert np.all(turn < (0.00270, 0.00308, 0.00029)), turn
    assert found.sigma_px < 0.25


def pinhole_shot(path: Path) -> Sightings | None:
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    found, corners = cv2.findChessboardCorners(picture, (9, 6))
    if not found:
        return None
    fine = cv2.cornerSubPix(picture, corners.reshape(-1, 1, 2), (5, 5), (-1, -1), (3, 60, 1e-4)).reshape(-1, 2)
    return Sightings(str(path), "", np.arange(54), np.zeros((54, 2)), fine.astype(np.float64), np.ones(54))
