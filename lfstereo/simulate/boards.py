"""Calibration shots: a checkerboard held in front of the rig in random poses that both cameras see whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.errors import ConfigError
from lfstereo.rig.target import Target
from lfstereo.simulate import texture as paint
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.primitives import PATCH
from lfstereo.simulate.rigs import SimulatedRig
from lfstereo.simulate.scene import Scene, Surface, even_light, primitive
from lfstereo.simulate.truth import on_sensor

_DEFAULTS: dict[str, tuple[tuple[int, int], float]] = {"illum": ((19, 14), 0.010), "small": ((7, 6), 0.0035)}
_TRIES = 4000
_TILT_RAD = np.radians([28.0, 28.0, 12.0])
_MARGIN_PX = 45.0
"""Board and margin stay this far inside the sensor, three lenslets."""


@dataclass(frozen=True, slots=True)
class BoardPose:
    """A checkerboard in left camera axes."""

    corners: tuple[int, int]
    """Inner corners across and down."""
    square_m: float
    rotation_rad: tuple[float, float, float]
    """Rotation vector of ``left_from_board``; board x runs along the rows of corners, y down, z away."""
    translation_m: tuple[float, float, float]
    """Where the first (top left) inner corner is."""

    def points(self) -> Float64:
        """Return the inner corners row by row in left camera axes, ``(N, 3)`` m."""
        across, down = self.corners
        grid = np.array([[i, j, 0.0] for j in range(down) for i in range(across)]) * self.square_m
        points: Float64 = grid @ Rotation.from_rotvec(self.rotation_rad).as_matrix().T + self.translation_m
        return points


def board_target(options: SimulateOptions) -> Target:
    """Return the board of the calibration shots.

    Raises
    ------
    ConfigError
        If the options describe a board that cannot be told from itself upside down.
    """
    corners, square = _DEFAULTS[options.sensor]
    return Target("checkerboard", options.board_corners or corners, options.board_square_m or square)


def draw_poses(options: SimulateOptions, rig: SimulatedRig) -> list[BoardPose]:
    """Draw board poses spread over the working range, whole in the view of both cameras.

    Raises
    ------
    ConfigError
        If the board cannot be used, or does not fit into the common field of view.
    """
    target = board_target(options)
    rng = np.random.default_rng([options.seed, 0xB0A2])
    depths = options.near_m + (options.far_m - options.near_m) * (0.04 + 0.84 * _spread(options.boards))
    return [_draw(rng, float(z), target.corners, target.square_m, options, rig) for z in depths]


def board_scene(pose: BoardPose, options: SimulateOptions, rig: SimulatedRig) -> Scene:
    """Return the board before a plain wall, in left camera axes; the lower right corner has its square black."""
    across, down = pose.corners
    half = ((across + 3) * pose.square_m / 2, (down + 3) * pose.square_m / 2, 1.0)
    axes = Rotation.from_rotvec(pose.rotation_rad).as_matrix().T
    middle = np.array([(across - 1) / 2, (down - 1) / 2, 0.0]) * pose.square_m
    surface = Surface(paint.BOARD, ("#f0f0ec", "#181818", "#181818"), pose.square_m, 0.0)
    board = primitive(PATCH, np.asarray(pose.translation_m) + middle @ axes, axes, half, surface)
    wall = Surface(paint.MOTTLED, ("#7d8a86", "#98a098", "#a8a090"), 0.08, 0.3, 7)
    far = options.far_m
    wall_axes = rig.left_from_bar[:, :3].T
    place = rig.left_from_bar @ np.array([0.0, 0.0, 0.99 * far, 1.0])
    background = primitive(PATCH, place, wall_axes, (far, far, 1.0), wall)
    return Scene(np.stack([background, board]), even_light(), np.ones((1, 2, 2), np.float32))


def _spread(count: int) -> Float64:
    """Return numbers in 0..1 that fill the range evenly from the start (golden ratio)."""
    spread: Float64 = np.mod(0.5 + 0.6180339887 * np.arange(count, dtype=np.float64), 1.0)
    return spread


def _draw(
    rng: np.random.Generator,
    first_z: float,
    corners: tuple[int, int],
    square: float,
    options: SimulateOptions,
    rig: SimulatedRig,
) -> BoardPose:
    stereo = rig.stereo
    for attempt in range(_TRIES):
        # The longer nothing fits, the closer to the middle, to upright and to where the fields of view agree.
        ease = 1 - attempt / _TRIES
        z = options.focus_m + (first_z - options.focus_m) * ease
        tilt = rng.uniform(-1, 1, 3) * _TILT_RAD * ease
        reach = rng.uniform(-1, 1, 2) * [0.5 * rig.left.sensor_px[0], 0.5 * rig.left.sensor_px[1]]
        centre = np.array([*(reach * ease * z / rig.left.focal_px), z])
        axes: Float64 = Rotation.from_rotvec(tilt).as_matrix()
        middle = np.array([(corners[0] - 1) / 2, (corners[1] - 1) / 2, 0.0]) * square
        bar = np.column_stack([rig.left_from_bar[:, :3] @ axes, rig.left_from_bar @ [*(centre - axes @ middle), 1.0]])
        rotation = Rotation.from_matrix(bar[:, :3]).as_rotvec()
        pose = BoardPose(corners, square, _triple(rotation), _triple(bar[:, 3]))
        edge = np.array([[i, j, 0.0] for i in (-2, corners[0] + 1) for j in (-2, corners[1] + 1)]) * square
        in_left = edge @ bar[:, :3].T + bar[:, 3]
        in_right = in_left @ stereo.right_from_left.T + stereo.translation_m
        if np.all(on_sensor(in_left, stereo.left, _MARGIN_PX) & on_sensor(in_right, stereo.right, _MARGIN_PX)):
            return pose
    raise ConfigError(
        f"a board of {corners[0]} x {corners[1]} corners, {square * 1e3:g} mm apart, does not fit into both "
        f"views anywhere near {options.focus_m:.2f} m; give a smaller board_square_m or fewer board_corners"
    )


def _triple(values: Float64) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
