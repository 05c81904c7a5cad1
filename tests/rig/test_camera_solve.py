"""One camera: derivatives against differences, rays against points, and corners with known truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfstereo.errors import RigError, ShapeError
from lfstereo.rig.distortion import distort, undistort
from lfstereo.rig.intrinsics import RAY, Expand, matrix_rays, plenoptic_rays, project, ray_distance_m
from lfstereo.rig.sightings import Sightings
from lfstereo.rig.solve import solve_camera

RAYS = np.array([6e-4, 6e-4, 2e-5, 2.1e-5, -9e-4, -9e-4, 1.1e-3, 1.11e-3, 1e-4, 2e-4, 0.01, -0.02])
RAYS = np.concatenate([RAYS, [0.2, -0.35, 0.1, 0.004, -0.003]])
DERIVATIVE_TOLERANCE = 1e-5
"""Relative to the largest derivative, of central differences."""


def some_points(count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.1, 0.1, (count, 2)), rng.uniform(0.25, 0.4, count)])
    return rng.uniform(-4, 4, (count, 2)), points


def test_a_point_lies_on_the_ray_of_the_pixel_it_is_projected_to() -> None:
    offset, points = some_points()
    place = project(RAYS, offset, points, np.zeros((6, 2))).place
    assert ray_distance_m(RAYS, offset, place, points).max() < 1e-9


@pytest.mark.parametrize("stigmatic", [False, True])
def test_derivatives_of_the_projection(stigmatic: bool) -> None:
    offset, points = some_points()
    seen = project(RAYS, offset, points, np.zeros((6, 2)), stigmatic)

    def place(rays: np.ndarray, at: np.ndarray) -> np.ndarray:
        return project(rays, offset, at, seen.place, stigmatic).place

    for number in range(RAY):
        step = np.zeros(RAY)
        step[number] = 1e-6 * max(abs(RAYS[number]), 1e-3)
        difference = (place(RAYS + step, points) - place(RAYS - step, points)) / (2 * step[number])
        miss = np.abs(difference - seen.by_ray[..., number]).max()
        assert miss < DERIVATIVE_TOLERANCE * np.abs(difference).max(), number
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-7
        difference = (place(RAYS, points + step) - place(RAYS, points - step)) / 2e-7
        miss = np.abs(difference - seen.by_point[..., axis]).max()
        assert miss < DERIVATIVE_TOLERANCE * np.abs(difference).max()


@pytest.mark.parametrize(
    ("expand", "at"),
    [
        (plenoptic_rays, [14630.0, 14650.0, 3860.0, 2690.0, 1.2, 7e-4, 0.1, -0.2, 0.3, 0.01, 0.02]),
        (matrix_rays, RAYS[[0, 1, 2, 3, 4, 5, 6, 7, 12, 13, 14, 15, 16]]),
    ],
)
def test_derivatives_of_the_rays(expand: Expand, at: list[float]) -> None:
    values = np.asarray(at)
    _, by = expand(values)
    for number, value in enumerate(values):
        step = np.zeros(len(values))
        step[number] = 1e-6 * abs(value)
        difference = (expand(values + step)[0] - expand(values - step)[0]) / (2 * step[number])
        np.testing.assert_allclose(by[:, number], difference, rtol=1e-6, atol=1e-7 * np.abs(difference).max())


def test_the_lens_camera_projects_as_its_formula_says() -> None:
    fx, fy, cx, cy, zf, m = 14630.0, 14650.0, 3860.0, 2690.0, 0.85, 7e-4
    rays, _ = plenoptic_rays(np.array([fx, fy, cx, cy, 1 / zf, m, 0, 0, 0, 0, 0]))
    x, y, z, i, j = 0.05, -0.03, 0.7, 4.0, -2.0
    place = project(rays, np.array([[i, j]]), np.array([[x, y, z]]), np.zeros((1, 2))).place[0]
    expected = [fx * (x / z - i * m * (1 / z - 1 / zf)) + cx, fy * (y / z - j * m * (1 / z - 1 / zf)) + cy]
    np.testing.assert_allclose(place, expected, rtol=0, atol=1e-8)


def test_rays_through_one_micro_image_of_a_stigmatic_lens_meet() -> None:
    zf, m = 0.85, 7e-4
    rays, _ = plenoptic_rays(np.array([14630.0, 14630.0, 3860.0, 2690.0, 1 / zf, m, -0.12, 0.2, 0, 0.01, -0.005]))
    on_plane = np.array([[0.2, -0.13, zf]])
    offset = np.array([[0.0, 0.0], [6.0, -5.0]])
    # A point of the plane of zero slope, and one farther out on the ray that it sends through the pupil point (i, j).
    pupil = np.column_stack([m * offset, [0.0, 0.0]])
    farther = pupil + 1.3 * (on_plane - pupil)
    for points in (np.repeat(on_plane, 2, axis=0), farther):
        places = project(rays, offset, points, np.zeros((2, 2)), stigmatic=True).place
        np.testing.assert_allclose(places[1], places[0], rtol=0, atol=1e-8)
    bent = project(rays, offset, farther, np.zeros((2, 2))).place
    assert np.hypot(*(bent[1] - bent[0])) > 1.0  # Directions bent each by itself do not meet.


def test_undistorting_takes_the_distortion_out() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-0.4, 0.4, (2, 50))
    bent = distort(x, y, RAYS[12:])
    np.testing.assert_allclose(undistort(bent.x, bent.y, RAYS[12:]), (x, y), atol=1e-12)
    np.testing.assert_array_equal(undistort(x, y, np.zeros(5)), (x, y))


def reference_shots(archive: np.lib.npyio.NpzFile) -> list[Sightings]:
    corners = archive["corners"]
    row, column, number = np.meshgrid(*(np.arange(n) for n in corners.shape[1:4]), indexing="ij")
    offset = np.stack([column.ravel() - 4.0, row.ravel() - 4.0], axis=1)
    weight = np.ones(number.size)
    return [
        Sightings(f"pose {n}", "", number.ravel(), offset, corners[n].reshape(-1, 2) - 1, weight)
        for n in range(len(corners))
    ]


def test_corners_with_known_truth(real_data: Path) -> None:
    with np.load(real_data / "lftoolbox_reference/calibration/corners_and_truth.npz") as archive:
        truth, points = archive["H"], archive["P"].T
        found = solve_camera(reference_shots(archive), points, (625, 434))
    assert found.ray_rms_m <= 0.0270e-3
    assert found.sigma_px == pytest.approx(0.05, rel=0.01)
    assert found.matrix[0, 0] == pytest.approx(truth[0, 0], rel=0.005)
    for at in ((1, 1), (2, 0), (3, 1), (2, 2), (3, 3)):
        assert found.matrix[at] == pytest.approx(truth[at], rel=0.005)
    misses = (found.matrix - truth)[[0, 1, 0, 1, 2, 3, 2, 3], [0, 1, 2, 3, 0, 1, 2, 3]] / found.sd[:8]
    assert np.abs(misses).max() < 4  # standard deviations
    assert found.distortion[0] == pytest.approx(-0.2, rel=0.05)  # the reference's k1 bends the other way


def test_refuses_too_few_shots() -> None:
    with pytest.raises(RigError, match="0 usable shots, expected 3"):
        solve_camera([], np.zeros((4, 3)), (625, 434))


def test_refuses_sightings_that_do_not_fit_together() -> None:
    with pytest.raises(ShapeError, match=r"a\.h5: place has shape \(3, 2\), expected \(4, 2\)"):
        Sightings("a.h5", "", np.arange(4), np.zeros((4, 2)), np.zeros((3, 2)), np.ones(4))
