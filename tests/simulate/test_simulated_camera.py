"""The simulated optics against closed forms: distances, lattice, vignetting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lfstereo.simulate.camera import LENSLET_PITCH_M, PIXEL_PITCH_M, SimulatedCamera
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig, build_rig
from lfstereo.simulate.trace import vignetting

CENTROID_TOLERANCE_PX = 0.06
CENTROID_BIAS_PX = 0.005


def straight(camera: SimulatedCamera, size: tuple[int, int], principal: tuple[float, float]) -> SimulatedCamera:
    """A camera whose lenslet (0, 0) sits on the axis, without rotation."""
    return replace(
        camera,
        sensor_px=size,
        principal_px=principal,
        lenslet_offset_m=(0.0, 0.0),
        lenslet_rotation_rad=0.0,
        lenslet_scale=(1.0, 1.0),
    )


def centroids(share: np.ndarray, lattice: np.ndarray, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
    """Measured and expected micro-image centres of a white image."""
    y, x = np.mgrid[: share.shape[0], : share.shape[1]]
    found, expected = [], []
    for i in rows:
        for j in columns:
            centre = lattice[0] + (j + 0.5 * (i % 2)) * lattice[1] + i * lattice[2]
            near = np.hypot(x - centre[0], y - centre[1]) < 7.15
            weights = share[near]
            found.append([np.sum(x[near] * weights) / weights.sum(), np.sum(y[near] * weights) / weights.sum()])
            expected.append(centre)
    return np.array(found), np.array(expected)


def test_distances_follow_the_thin_lens(rig: SimulatedRig) -> None:
    camera = rig.left
    assert camera.image_distance_m == pytest.approx(0.02 * 0.85 / 0.83, rel=1e-12)
    assert camera.focal_px == pytest.approx((0.020481927710843373 + 38.4e-6) / 1.4e-6, rel=1e-9)
    # The pupil of 10 mm fills 13.4 of 14.3 px: micro-images do not overlap.
    assert 2 * camera.pupil_radius_m / camera.pupil_m_per_px == pytest.approx(13.39, abs=0.01)


def test_micro_images_are_spaced_wider_than_the_lenslets(rig: SimulatedRig) -> None:
    lattice = rig.left.lattice()
    expected = LENSLET_PITCH_M / PIXEL_PITCH_M * (1 + 38.4e-6 / rig.left.image_distance_m)
    assert np.linalg.norm(lattice[1]) == pytest.approx(expected, rel=1e-9)
    assert np.arctan2(lattice[1, 1], lattice[1, 0]) == pytest.approx(-5.4e-4, abs=1e-9)
    assert np.linalg.norm(lattice[2]) == pytest.approx(expected * np.sqrt(3) / 2 * 1.000343, rel=1e-9)


def test_white_image_shows_the_lattice(rig: SimulatedRig) -> None:
    camera = replace(rig.left, sensor_px=(300, 260), principal_px=(148.3, 131.7))
    found, expected = centroids(vignetting(camera), camera.lattice(), range(-8, 9), range(-7, 6))
    assert np.abs(found - expected).max() < CENTROID_TOLERANCE_PX
    assert np.abs((found - expected).mean(axis=0)).max() < CENTROID_BIAS_PX


def test_vignetting_is_symmetric_about_the_axis(rig: SimulatedRig) -> None:
    share = vignetting(straight(rig.left, (201, 201), (100.0, 100.0)))
    assert share.max() == pytest.approx(1.0, abs=0.002)
    np.testing.assert_allclose(share, share[::-1, ::-1], atol=1e-6)
    np.testing.assert_allclose(share, share[:, ::-1], atol=1e-6)


def test_micro_image_holds_the_light_of_the_pupil(rig: SimulatedRig) -> None:
    share = vignetting(straight(rig.left, (201, 201), (100.0, 100.0)))
    radius, distance = rig.left.pupil_radius_m, rig.left.image_distance_m
    # Integral of cos^4 over a disc seen from its axis: its area times D^2 / (D^2 + R^2).
    area = np.pi * (radius / rig.left.pupil_m_per_px) ** 2 * distance**2 / (distance**2 + radius**2)
    y, x = np.mgrid[:201, :201] - 100.0
    assert share[np.hypot(x, y) < 7.6].sum() == pytest.approx(area, rel=0.02)
    assert share[100, 107] < 0.35, "dark between micro-images"


def test_corner_is_cut_towards_the_axis_and_darker(rig: SimulatedRig) -> None:
    centre = vignetting(straight(rig.left, (200, 200), (100.0, 100.0)))
    corner = straight(rig.left, (200, 200), (3800.0, 2600.0))
    share = vignetting(corner)
    assert 0.6 < share.mean() / centre.mean() < 0.85
    found, expected = centroids(share, corner.lattice(), range(-205, -200), range(-262, -258))
    # Cat's eye: the rim cuts the side of the pupil from which oblique light would come past it.
    inwards = np.array([3700.0, 2500.0]) / np.hypot(3700, 2500)
    shift = (found - expected) @ inwards
    assert np.all((shift > 0.2) & (shift < 1.5))


def test_rig_sees_the_crossing_of_its_axes(rig: SimulatedRig, options: SimulateOptions) -> None:
    ahead = np.array([0.0, 0.0, options.focus_m])
    left = rig.left_from_bar[:, :3] @ ahead + rig.left_from_bar[:, 3]
    right = rig.stereo.right_from_left @ left + rig.stereo.translation_m
    for point, camera in ((left, rig.left), (right, rig.right)):
        off_axis = point[:2] / point[2] * camera.focal_px
        assert np.abs(off_axis).max() < 60, "within 0.25 degrees of the middle of the sensor"
    assert rig.stereo.baseline_m == pytest.approx(0.095, rel=1e-9)
    assert rig.stereo.right_centre_m[0] > 0.09


def test_rig_file_describes_the_cameras(rig: SimulatedRig) -> None:
    assert rig.stereo.left.focal_px[0] == rig.left.focal_px
    assert rig.stereo.right.pupil_m_per_px == rig.right.pupil_m_per_px
    assert rig.stereo.pixel_px == pytest.approx(12.372, abs=0.001)
    full = build_rig(SimulateOptions())
    assert full.left.sensor_px == (7728, 5368)
