"""Stated standard deviations: closed forms, and errors of simulated calibrations whose corners err together."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.rig.bundle import RigSolution, solve_rig
from lfstereo.rig.uncertainty import ShotEquations, jackknife_covariance, without_pose
from lfstereo.simulate.boards import board_target
from lfstereo.simulate.corners import CornerErrors, corner_session
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig

ALIKE = CornerErrors(smooth_px=0.2, view_px=0.1)
FOCAL_TOLERANCE = 1e-6
ROTATION_TOLERANCE_RAD = math.radians(1e-4)


def test_the_jackknife_of_a_mean_is_its_textbook_variance() -> None:
    seen = np.array([1.0, 3.0, 4.0, 8.0])
    shots = [ShotEquations(np.eye(1), np.array([seen.mean() - value])) for value in seen]
    found = jackknife_covariance(shots, np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(found, [[np.var(seen, ddof=1) / 4]])


def test_without_measurements_the_expectation_is_what_is_known() -> None:
    shots = [ShotEquations(np.diag([0.0, 2.0]), np.zeros(2)) for _ in range(3)]
    found = jackknife_covariance(shots, np.array([25.0, 0.0]), np.array([25.0, 0.0]))
    np.testing.assert_allclose(found, [[1 / 25, 0], [0, 0]], atol=1e-15)


def test_a_shot_without_its_pose_moves_the_rest_as_the_whole_system_does() -> None:
    rng = np.random.default_rng(0)
    jacobian, residual = rng.normal(size=(30, 9)), rng.normal(size=30)
    normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
    reduced = without_pose(normal, gradient, 3)
    whole = np.linalg.solve(normal, gradient)
    np.testing.assert_allclose(np.linalg.solve(reduced.normal, reduced.gradient), whole[:3], rtol=1e-10)


def calibrated(seed: int, errors: CornerErrors) -> tuple[SimulatedRig, RigSolution]:
    options = SimulateOptions(seed=seed, boards=12, board_corners=(8, 5), board_square_m=0.025, distortion_k1=-0.1)
    rig, pairs = corner_session(options, errors)
    sizes = (rig.left.sensor_px, rig.right.sensor_px)
    return rig, solve_rig(pairs, board_target(options).points, sizes, rig.stereo.pixel_px)


def errors_in_sd(rig: SimulatedRig, found: RigSolution) -> np.ndarray:
    turn = Rotation.from_matrix(found.rig.right_from_left @ rig.stereo.right_from_left.T).as_rotvec()
    focal = [getattr(found.rig, side).focal_px[0] / getattr(rig, side).focal_px - 1 for side in ("left", "right")]
    baseline = (found.rig.baseline_m - rig.stereo.baseline_m) / found.baseline_sd_m
    return np.array([baseline, *(turn / found.rotation_sd_rad), *(np.array(focal) / found.focal_sd)])


def test_without_noise_a_bent_lens_is_found_exactly() -> None:
    rig, found = calibrated(7, CornerErrors(view_px=1e-4))
    for side in ("left", "right"):
        assert abs(getattr(found.rig, side).focal_px[0] / getattr(rig, side).focal_px - 1) < FOCAL_TOLERANCE
    turn = Rotation.from_matrix(found.rig.right_from_left @ rig.stereo.right_from_left.T)
    assert turn.magnitude() < ROTATION_TOLERANCE_RAD


def test_the_standard_deviations_cover_errors_that_neighbouring_corners_share() -> None:
    misses = np.array([errors_in_sd(*calibrated(seed, ALIKE)) for seed in range(1, 5)])
    # Corners taken as independent give an rms of 4, parts of the board one of 2.
    assert 0.5 < np.sqrt(np.mean(misses**2)) < 1.5
    assert np.abs(misses).max() < 4
