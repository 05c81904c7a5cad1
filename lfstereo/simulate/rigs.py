"""Two simulated cameras side by side, slightly toed in and slightly crooked, as bodies on a bar are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.rig.rig import StereoRig, Triple
from lfstereo.simulate.camera import LENSLET_PITCH_M, PIXEL_PITCH_M, SENSORS, SimulatedCamera
from lfstereo.simulate.options import SimulateOptions


@dataclass(frozen=True, slots=True)
class SimulatedRig:
    """The cameras, their exact calibration, and the bar they stand on."""

    left: SimulatedCamera
    right: SimulatedCamera
    stereo: StereoRig
    left_from_bar: Float64
    """``(3, 4)``: rotation and translation from bar axes (x along the bar, z ahead, origin midway) to left camera."""


def build_rig(options: SimulateOptions) -> SimulatedRig:
    """Set up the rig: both optical axes cross at the focused depth, plus 0.1-0.2 degrees of crookedness."""
    left, right = _camera(options, "left"), _camera(options, "right")
    toe_in = math.atan2(options.baseline_m / 2, options.focus_m)
    crooked = np.radians([[0.11, -0.06, 0.14], [-0.13, 0.08, -0.10]])
    half = options.baseline_m / 2
    turns, centres = [], [np.array([-half, 0.0, 0.0]), np.array([half, 0.0, 0.0])]
    for sign, extra in zip((1.0, -1.0), crooked, strict=True):
        bar_from_camera = Rotation.from_rotvec([0.0, sign * toe_in, 0.0]) * Rotation.from_rotvec(extra)
        turns.append(bar_from_camera.inv().as_matrix())
    # The bodies never sit perfectly: the right one a little lower and further back, at the same distance.
    offset = np.array([1.0, 0.004, -0.006])
    centres[1] = centres[0] + options.baseline_m * offset / np.linalg.norm(offset)
    right_from_left = turns[1] @ turns[0].T
    left_centre_from_right = turns[1] @ (centres[0] - centres[1])
    stereo = StereoRig(
        left=left.plenoptic(),
        right=right.plenoptic(),
        rotation_rad=_triple(Rotation.from_matrix(right_from_left).as_rotvec()),
        translation_m=_triple(left_centre_from_right),
        near_m=options.near_m,
        far_m=options.far_m,
        pixel_px=LENSLET_PITCH_M / PIXEL_PITCH_M * math.sqrt(3) / 2,
    )
    left_from_bar = np.column_stack([turns[0], -turns[0] @ centres[0]])
    return SimulatedRig(left, right, stereo, left_from_bar)


def _camera(options: SimulateOptions, side: str) -> SimulatedCamera:
    width, height = SENSORS[options.sensor]
    left = side == "left"
    shift = (21.3, -14.8) if left else (-17.6, 11.2)
    scale = min(1.0, width / SENSORS["illum"][0])
    return SimulatedCamera(
        serial="SIM00000001" if left else "SIM00000002",
        sensor_px=(width, height),
        focal_length_m=options.focal_length_m * (1.0 if left else 1.001),
        f_number=options.f_number,
        focus_m=options.focus_m * (1.0 if left else 1.003),
        lenslet_gap_m=38.4e-6 if left else 38.1e-6,
        lenslet_offset_m=(8.42e-6, -0.95e-6) if left else (-5.34e-6, 2.06e-6),
        lenslet_rotation_rad=-5.4e-4 if left else 3.1e-4,
        lenslet_scale=(1.0, 1.000343) if left else (1.0, 0.99983),
        principal_px=((width - 1) / 2 + shift[0] * scale, (height - 1) / 2 + shift[1] * scale),
        distortion_k1=options.distortion_k1 * (1.0 if left else 0.94),
    )


def _triple(values: Float64) -> Triple:
    return float(values[0]), float(values[1]), float(values[2])
