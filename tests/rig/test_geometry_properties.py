"""Rays of any camera and their inverse, and the rectification that has nothing to do."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lfstereo.lightfield.field import LightField
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.intrinsics import matrix_from_rays, plenoptic_rays, project, ray_distance_m
from lfstereo.rig.rectify import rectify
from lfstereo.rig.rig import PlenopticCamera, StereoRig

PLACE_PX = 1e-6
RAY_M = 1e-9

cameras = st.builds(
    lambda focal, ratio, cx, cy, zf, pupil: np.array([focal, focal * ratio, cx, cy, 1 / zf, pupil, 0, 0, 0, 0, 0]),
    st.floats(1e3, 5e4),
    st.floats(0.98, 1.02),
    st.floats(0, 8000),
    st.floats(0, 6000),
    st.floats(0.2, 20),
    st.floats(1e-4, 2e-3),
)
offsets = st.tuples(st.floats(-7, 7), st.floats(-7, 7)).map(lambda ij: np.array([ij]))
places = st.tuples(st.floats(0, 7728), st.floats(0, 5368)).map(lambda kl: np.array([kl]))


@given(cameras, offsets, places, st.floats(0.1, 50))
def test_a_sample_sees_the_points_of_its_own_ray(
    camera: np.ndarray, offset: np.ndarray, place: np.ndarray, depth_m: float
) -> None:
    """``H`` gives a sample's ray; projecting any point of it gives the sample back."""
    rays, _ = plenoptic_rays(camera)
    s, t, u, v, _ = matrix_from_rays(rays) @ [*offset[0], *place[0], 1.0]
    point = np.array([[s + u * depth_m, t + v * depth_m, depth_m]])
    assert float(ray_distance_m(rays, offset, place, point)[0]) < RAY_M * max(1.0, depth_m)
    found = project(rays, offset, point, place).place
    np.testing.assert_allclose(found, place, atol=PLACE_PX * max(1.0, float(np.abs(place).max())))


@given(cameras)
def test_matrix_and_its_inverse(camera: np.ndarray) -> None:
    matrix = matrix_from_rays(plenoptic_rays(camera)[0])
    samples = np.array([[3.0, -2.0, 4000.0, 100.0, 1.0]]).T
    np.testing.assert_allclose(np.linalg.solve(matrix, matrix @ samples), samples, atol=1e-6)


@settings(max_examples=15)
@given(
    focal=st.floats(500, 2000),
    baseline_m=st.floats(0.005, 0.02),
    centre=st.tuples(st.floats(15, 25), st.floats(10, 20)),
    seed=st.integers(0, 2**32 - 1),
)
def test_cameras_that_are_rectified_already_are_left_alone(
    focal: float, baseline_m: float, centre: tuple[float, float], seed: int
) -> None:
    near, far = 0.8, 1.2
    reference = 2 / (1 / near + 1 / far)

    def camera(shift_px: float) -> PlenopticCamera:
        return PlenopticCamera("", (40, 30), (focal, focal), (centre[0] + shift_px, centre[1]), 0.9, 1e-3)

    # The virtual cameras are centred on the common field of view, which these two share as they are.
    rig = StereoRig(
        left=camera(0.0),
        right=camera(focal * baseline_m / reference),
        rotation_rad=(0.0, 0.0, 0.0),
        translation_m=(-baseline_m, 0.0, 0.0),
        near_m=near,
        far_m=far,
        pixel_px=1.0,
    )
    views = np.random.default_rng(seed).random((3, 3, 30, 40, 3), np.float32)
    found = rectify(LightField(views, None, None, "", "test"), rig, rectified_geometry(rig), "left")
    np.testing.assert_allclose(found.views, views, atol=1e-5)
    assert found.weight is not None and (found.weight == 255).all()
