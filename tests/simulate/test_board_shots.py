"""Calibration boards: poses inside both views, pattern at the stated corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.simulate.boards import BoardPose, board_scene, draw_poses
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.pinhole import Pinhole, render
from lfstereo.simulate.rigs import SimulatedRig, build_rig


@pytest.mark.parametrize("sensor", ["small", "illum"])
def test_poses_are_seen_whole_by_both_cameras(sensor: str) -> None:
    options = SimulateOptions(sensor=sensor, boards=8)  # type: ignore[arg-type]
    rig = build_rig(options)
    poses = draw_poses(options, rig)
    assert len(poses) == 8
    assert poses == draw_poses(options, rig)
    for pose in poses:
        left = pose.points()
        right = left @ rig.stereo.right_from_left.T + rig.stereo.translation_m
        for points, camera in ((left, rig.stereo.left), (right, rig.stereo.right)):
            xy = points[:, :2] / points[:, 2:] * camera.focal_px + camera.principal_px
            assert np.all((xy > 40) & (xy < np.asarray(camera.sensor_px) - 40))
    depths = [p.translation_m[2] for p in poses]
    assert max(depths) - min(depths) > 0.15


def test_corner_points_lie_where_the_squares_meet(rig: SimulatedRig, options: SimulateOptions) -> None:
    pose = BoardPose((5, 4), 0.004, (0.2, -0.1, 0.15), (-0.008, -0.006, 0.8))
    scene = board_scene(pose, options, rig)
    corner = pose.points()[7]
    axes = (pose.points()[8] - corner, pose.points()[12] - corner)
    for sign_x, sign_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        place = corner + 0.2 * (sign_x * axes[0] + sign_y * axes[1])
        view = Pinhole(1000.0, (-1000 * place[0] / place[2], -1000 * place[1] / place[2]), (1, 1))
        white = render(scene, view, 1)[0, 0, 0] > 0.5
        # Corner 7 is in row 1, column 2: an odd sum turns the colours over against the first corner's.
        assert white == ((sign_x == sign_y) == ((1 + 2) % 2 == 1))


def test_first_square_is_black(rig: SimulatedRig, options: SimulateOptions) -> None:
    pose = BoardPose((5, 4), 0.004, (0.0, 0.0, 0.0), (-0.008, -0.006, 0.8))
    place = np.asarray(pose.translation_m) - [0.002, 0.002, 0.0]
    view = Pinhole(1000.0, (-1000 * place[0] / place[2], -1000 * place[1] / place[2]), (1, 1))
    assert render(board_scene(pose, options, rig), view, 1).max() < 0.05


def test_board_that_does_not_fit_is_refused(rig: SimulatedRig, options: SimulateOptions) -> None:
    with pytest.raises(ConfigError, match=r"5 x 4 corners, 50 mm apart, does not fit .* smaller board_square_m"):
        draw_poses(replace(options, boards=1, board_corners=(5, 4), board_square_m=0.05), rig)


def test_board_that_looks_the_same_upside_down_is_refused(rig: SimulatedRig, options: SimulateOptions) -> None:
    with pytest.raises(ConfigError, match=r"corners = 5 x 3, expected one number odd and one even"):
        draw_poses(replace(options, boards=1, board_corners=(5, 3)), rig)
