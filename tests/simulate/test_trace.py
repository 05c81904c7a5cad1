"""Traced light against closed forms: flat at the focus, shift with the pupil, projection by the rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.primitives import PATCH
from lfstereo.simulate.rigs import SimulatedRig
from lfstereo.simulate.scene import Scene, Surface, card, even_light, linear_rgb, primitive
from lfstereo.simulate.texture import MOTTLED, SPOT
from lfstereo.simulate.trace import trace_light, vignetting

GREEN = np.zeros((2, 2, 3))
GREEN[..., 1] = 1.0
OFFSETS = np.array([[dx, dy] for dy in (-3.0, 0.0, 3.0) for dx in (-4.0, -2.0, 0.0, 2.0, 4.0)])
SHIFT_TOLERANCE_PX = 0.05


@pytest.fixture(scope="module")
def camera(rig: SimulatedRig) -> SimulatedCamera:
    return replace(rig.left, sensor_px=(660, 600), principal_px=(331.2, 298.4))


def dot(point: tuple[float, float, float], size: float) -> Scene:
    """A soft white spot across the axis, of the given standard deviation (m), on black."""
    surface = Surface(SPOT, ("#000000", "#ffffff", "#ffffff"), size, 0.0)
    row = primitive(PATCH, point, np.eye(3), (5 * size, 5 * size, 1.0), surface)
    return Scene(row[None], even_light(), np.ones((1, 2, 2), np.float32))


def lenslets(camera: SimulatedCamera, margin_px: float) -> np.ndarray:
    """Micro-image centres at least a margin inside the sensor, ``(N, 2)`` px."""
    lattice = camera.lattice()
    column, row = np.linalg.solve(lattice[1:].T, np.asarray(camera.sensor_px) / 2 - lattice[0]).round()
    i, j = np.mgrid[row - 40 : row + 40, column - 40 : column + 40]
    centres = lattice[0] + (j + 0.5 * (i % 2))[..., None] * lattice[1] + i[..., None] * lattice[2]
    centres = centres.reshape(-1, 2)
    inside = np.all((centres > margin_px) & (centres < np.array(camera.sensor_px) - 1 - margin_px), axis=1)
    return centres[inside]


def views(camera: SimulatedCamera, scene: Scene, samples: int, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Micro-image centres, and what each lenslet sees at given offsets (x, y) px, ``(offsets, lenslets)``."""
    seen = trace_light(camera, scene, GREEN, samples) / np.maximum(vignetting(camera), 0.01)
    centres = lenslets(camera, 8.0)
    at = centres[None] + offsets[:, None]
    return centres, map_coordinates(seen, [at[..., 1], at[..., 0]], order=1)


def dot_centres(camera: SimulatedCamera, scene: Scene, offsets: np.ndarray) -> np.ndarray:
    """Where the dot's centroid lies on the lattice, seen at each offset inside the micro-images."""
    centres, seen = views(camera, scene, 24, offsets)
    return seen @ centres / seen.sum(axis=1, keepdims=True)


def test_grey_card_gives_the_vignetting(camera: SimulatedCamera) -> None:
    light = trace_light(camera, card(0.85, 1.0, "#808080"), GREEN, 2)
    grey = linear_rgb("#808080")[1]
    lit = vignetting(camera) > 1e-3
    np.testing.assert_allclose(light[lit], grey * vignetting(camera)[lit], rtol=1e-5)
    assert np.all(light >= 0)


def test_textured_card_at_the_focus_is_flat_within_each_micro_image(camera: SimulatedCamera) -> None:
    spread = []
    for z in (0.85, 0.70):
        _, seen = views(camera, card(z, 1.0, "#c0c0c0", MOTTLED), 12, OFFSETS)
        spread.append(seen.std(axis=0).mean() / seen.mean(axis=0).std())
    assert spread[0] < 0.12, "only the sampling noise of a lenslet's area"
    assert spread[1] > 2 * spread[0], "out of focus the directions differ"


@pytest.mark.parametrize("z", [0.65, 0.85, 1.2])
def test_dot_shifts_with_the_pupil_by_the_slope_formula(camera: SimulatedCamera, z: float) -> None:
    x, y, size = 0.0016 * z, -0.0011 * z, 0.0028 * z
    centres = dot_centres(camera, dot((x, y, z), size), OFFSETS)
    shift = camera.focal_px * camera.pupil_m_per_px * (1 / z - 1 / camera.focus_m)
    for axis, place in enumerate((x / z, y / z)):
        slope, middle = np.polyfit(OFFSETS[:, axis], centres[:, axis], 1)
        assert middle == pytest.approx(place * camera.focal_px + camera.principal_px[axis], abs=SHIFT_TOLERANCE_PX)
        reach = np.ptp(OFFSETS[:, axis])
        assert slope * reach == pytest.approx(-shift * reach, abs=SHIFT_TOLERANCE_PX)


def test_nearer_than_the_focus_moves_against_the_pupil(camera: SimulatedCamera) -> None:
    centres = dot_centres(camera, dot((0.0, 0.0, 0.65), 0.002), OFFSETS)
    assert np.polyfit(OFFSETS[:, 0], centres[:, 0], 1)[0] < 0
    assert np.polyfit(OFFSETS[:, 1], centres[:, 1], 1)[0] < 0


def test_right_camera_sees_a_point_where_the_rig_says(rig: SimulatedRig) -> None:
    point = np.array([0.004, -0.002, 0.80])
    in_right = rig.stereo.right_from_left @ point + rig.stereo.translation_m
    expected = in_right[:2] / in_right[2] * rig.right.focal_px
    camera = replace(rig.right, sensor_px=(500, 500), principal_px=(250.0 - expected[0], 250.0 - expected[1]))
    scene = dot((0.0, 0.0, 0.0), 0.002).seen_from(np.eye(3), point)
    scene = scene.seen_from(rig.stereo.right_from_left, np.asarray(rig.stereo.translation_m))
    centre = dot_centres(camera, scene, np.zeros((1, 2)))[0]
    assert np.abs(centre - 250.0).max() < 0.1


@pytest.mark.parametrize("k1", [-0.3, 0.3])
def test_distortion_moves_points_along_the_radius(rig: SimulatedRig, k1: float) -> None:
    direction = np.array([0.20, -0.12])
    bent = direction * (1 + k1 * direction @ direction)
    principal = 200.0 - bent * rig.left.focal_px
    camera = replace(
        rig.left, sensor_px=(400, 400), principal_px=(principal[0], principal[1]), distortion_k1=k1, f_number=4.0
    )
    scene = dot((0.85 * direction[0], 0.85 * direction[1], 0.85), 0.002)
    centre = dot_centres(camera, scene, np.zeros((1, 2)))[0]
    assert np.abs(centre - 200.0).max() < 0.3
    assert camera.plenoptic().distortion == (k1, 0.0, 0.0, 0.0, 0.0)


def test_every_bayer_site_weighs_colours_by_its_own_filter(camera: SimulatedCamera) -> None:
    filters = np.arange(12, dtype=np.float64).reshape(2, 2, 3)
    light = trace_light(camera, card(0.9, 1.0, "#4080c0"), filters, 1)
    share = vignetting(camera)
    for row in (0, 1):
        for column in (0, 1):
            ratio = light[row::2, column::2].sum() / share[row::2, column::2].sum()
            assert ratio == pytest.approx(float(filters[row, column] @ linear_rgb("#4080c0")), rel=1e-4)
