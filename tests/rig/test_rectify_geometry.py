"""Rectification against points projected by the plenoptic camera model itself."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from lfstereo.errors import AssetError, RigError, ShapeError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig.geometry import RectifiedGeometry, Side, rectified_geometry
from lfstereo.rig.rectify import rectify
from lfstereo.rig.rig import PlenopticCamera, SensorGrid, StereoRig
from lfstereo.rig.view_maps import common_view_baseline_m, view_baseline_m, view_map

VIEWS = 5
VIEW_STEP_PX = 2.0
POINT_TOLERANCE_PX = 0.1
"""Of a point anywhere in the range and the aperture: the turn moves the pupil out of its plane."""


def illum(serial: str, focal: float = 14630.0, centre: tuple[float, float] = (3860.0, 2690.0)) -> PlenopticCamera:
    return PlenopticCamera(serial, (7728, 5368), (focal, focal * 1.0003), centre, 0.85, 7.1e-4)


def toed_in_rig(toe_deg: float = 3.2) -> StereoRig:
    toe = math.radians(toe_deg)
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("yxz", [2 * toe, 0.002, -0.003])
    centre = np.array([0.095 * math.cos(toe), 0.0008, 0.095 * math.sin(toe)])
    t = -turn.as_matrix() @ centre
    rotation = turn.as_rotvec()
    return StereoRig(
        left=illum("B5143909630"),
        right=illum("B5152102610", 14645.0, (3871.0, 2675.0)),
        rotation_rad=(rotation[0], rotation[1], rotation[2]),
        translation_m=(t[0], t[1], t[2]),
        near_m=0.6,
        far_m=1.2,
        pixel_px=12.372,
    )


def decoded(camera: PlenopticCamera, serial: str | None = None) -> LightField:
    sampling = ViewSampling((6.4, 5.1), (12.372, 12.376), -5.4e-4, VIEW_STEP_PX)
    views = np.zeros((VIEWS, VIEWS, 434, 625, 3), np.float32)
    return LightField(views, None, sampling, camera.serial if serial is None else serial, "a.h5")


def seen_at(camera: PlenopticCamera, sampling: ViewSampling, point: np.ndarray, p: float, q: float) -> np.ndarray:
    """Project a point in camera axes from a pupil point to px of the decoded view."""
    x, y, z = point
    lens = 1 / z - 1 / camera.focus_distance_m
    sensor = np.array(
        [
            camera.focal_px[0] * (x / z - p * lens) + camera.principal_px[0],
            camera.focal_px[1] * (y / z - q * lens) + camera.principal_px[1],
        ]
    )
    c, s = math.cos(sampling.rotation_rad), math.sin(sampling.rotation_rad)
    return np.array([[c, s], [-s, c]]) @ (sensor - sampling.origin_px) / sampling.step_px


def rectified_px(
    geometry: RectifiedGeometry, rig: StereoRig, side: Side, t: int, s: int, point: np.ndarray
) -> np.ndarray:
    camera = rig.left if side == "left" else rig.right
    light_field = decoded(camera)
    assert light_field.sampling is not None
    in_camera = point if side == "left" else rig.right_from_left @ point + rig.translation_m
    step = view_baseline_m(light_field, camera)
    t0, s0 = light_field.centre
    view_px = seen_at(camera, light_field.sampling, in_camera, (s - s0) * step, (t - t0) * step)
    found = view_map(light_field, camera, geometry, side, t, s)
    x, y, w = np.linalg.solve(found.view_from_picture @ found.picture_from_rectified, [*view_px, 1.0])
    return np.array([x, y]) / w


@pytest.mark.parametrize("toe_deg", [0.0, 3.2, -1.0])
def test_disparity_rows_and_slopes_of_points_anywhere(toe_deg: float) -> None:
    rig = toed_in_rig(toe_deg)
    geometry = rectified_geometry(rig)
    rng = np.random.default_rng(0)
    t0 = s0 = VIEWS // 2
    for _ in range(40):
        z = 1 / rng.uniform(1 / rig.far_m, 1 / rig.near_m)
        point = np.array([rng.uniform(-0.15, 0.25), rng.uniform(-0.15, 0.15), z])
        turned = geometry.left.rectified_from_camera @ point
        left = rectified_px(geometry, rig, "left", t0, s0, point)
        right = rectified_px(geometry, rig, "right", t0, s0, point)
        expected = geometry.focal_px * geometry.baseline_m / turned[2] - geometry.doffs_px
        assert left[1] == pytest.approx(right[1], abs=1e-6)
        assert left[0] - right[0] == pytest.approx(expected, abs=1e-6)
        for side, centre in (("left", left), ("right", right)):
            camera = rig.left if side == "left" else rig.right
            a, b = geometry.slope_from_disparity(view_baseline_m(decoded(camera), camera))
            slope = a * expected + b
            t, s = rng.integers(0, VIEWS, 2)
            found = rectified_px(geometry, rig, side, t, s, point)  # type: ignore[arg-type]
            np.testing.assert_allclose(
                found, centre - slope * np.array([s - s0, t - t0]), rtol=0, atol=POINT_TOLERANCE_PX
            )


def test_default_rig_fills_the_range_and_keeps_the_size() -> None:
    geometry = rectified_geometry(toed_in_rig())
    assert geometry.size == (434, 625)
    near = geometry.focal_px * geometry.baseline_m / 0.6 - geometry.doffs_px
    far = geometry.focal_px * geometry.baseline_m / 1.2 - geometry.doffs_px
    assert far == pytest.approx(0, abs=1e-9)
    assert near == pytest.approx(geometry.disparity_max_px, abs=1e-9)
    assert 85 < near < 100


def test_a_wider_range_grows_the_pixels_instead_of_exceeding_100_px() -> None:
    geometry = rectified_geometry(dataclasses.replace(toed_in_rig(), near_m=0.3))
    assert geometry.disparity_max_px == pytest.approx(100)
    assert geometry.size[0] < 434


def test_both_windows_are_centred_on_the_common_field() -> None:
    geometry = rectified_geometry(toed_in_rig())
    f, b, z = geometry.focal_px, geometry.baseline_m, geometry.reference_m
    left = f * (b / 2) / z + geometry.left.principal_px[0]
    right = f * (b / 2 - b) / z + geometry.right.principal_px[0]
    disparity_at_reference = f * b / z - geometry.doffs_px
    assert left - right == pytest.approx(disparity_at_reference)
    assert abs(left - 312) < 5


def test_rectifying_an_already_parallel_camera_changes_nothing() -> None:
    camera = PlenopticCamera("", (40, 30), (50.0, 50.0), (19.5, 14.5), 1.0, 0.002)
    rig = StereoRig(camera, camera, (0.0, 0.0, 0.0), (-0.02, 0.0, 0.0), 0.9, 1.1, 1.0)
    views = np.random.default_rng(1).random((3, 3, 30, 40, 3), dtype=np.float32)
    light_field = LightField(views, None, None, "", "views")
    geometry = rectified_geometry(rig)
    same = dataclasses.replace(
        geometry, left=dataclasses.replace(geometry.left, principal_px=(19.5, 14.5)), zero_slope_m=1.0
    )
    result = rectify(light_field, rig, same, "left")
    np.testing.assert_allclose(result.views, views, atol=1e-5)
    assert result.weight is not None and (result.weight == 255).all()


def test_refuses_a_rig_for_another_camera() -> None:
    rig = toed_in_rig()
    with pytest.raises(AssetError, match=r"camera #9d9e, but the rig's left camera is #1887"):
        rectify(decoded(rig.right), rig, rectified_geometry(rig), "left")


def test_another_camera_can_be_accepted() -> None:
    rig = toed_in_rig()
    field = dataclasses.replace(decoded(rig.right), views=np.zeros((1, 1, 434, 625, 3), np.float32))
    assert rectify(field, rig, rectified_geometry(rig), "left", any_camera=True).serial == rig.right.serial


@pytest.mark.parametrize(("stretch", "turn"), [(1.001, 0.0), (1.0, 0.001)])
def test_refuses_another_lattice_of_micro_images(stretch: float, turn: float) -> None:
    grid = SensorGrid((6.4, 5.1), (12.372 * stretch, 12.376 * stretch), -5.4e-4 + turn)
    rig = toed_in_rig()
    rig = dataclasses.replace(rig, left=dataclasses.replace(rig.left, grid=grid))
    field = dataclasses.replace(decoded(rig.left), views=np.zeros((1, 1, 434, 625, 3), np.float32))
    geometry = rectified_geometry(rig)
    with pytest.raises(AssetError, match=r"a\.h5: rows of micro-images 12\.3760 px apart .* --any-zoom"):
        rectify(field, rig, geometry, "left")
    rectify(field, rig, geometry, "left", any_zoom=True)
    same = dataclasses.replace(grid, step_px=(12.372, 12.376), rotation_rad=-5.4e-4)
    accepting = dataclasses.replace(rig, left=dataclasses.replace(rig.left, grid=same))
    rectify(field, accepting, geometry, "left")


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("weighted", [False, True])
def test_both_sides_have_one_slope_per_disparity(side: Side, weighted: bool) -> None:
    left = PlenopticCamera("", (60, 40), (50.0, 50.0), (29.5, 19.5), 1.0, 0.002)
    right = dataclasses.replace(left, pupil_m_per_px=0.0024)
    rig = StereoRig(left, right, (0.0, 0.0, 0.0), (-0.02, 0.0, 0.0), 0.4, 1.6, 1.0)
    geometry = rectified_geometry(rig)
    own = left if side == "left" else right
    slope_px = 50.0 * own.pupil_m_per_px * (1 / 0.5 - 1 / 1.0)
    t, s, row, column, _ = np.meshgrid(*[np.arange(n) for n in (5, 5, 40, 60, 3)], indexing="ij")
    # The plane at 0.5 m is painted with its own column, then with its own row.
    views = np.where(np.arange(3) == 0, column + slope_px * (s - 2), row + slope_px * (t - 2)).astype(np.float32)
    weight = np.full(views.shape[:4], 200, np.uint8) if weighted else None
    found = rectify(LightField(views, weight, None, "", "plane"), rig, geometry, side)
    field = LightField(views, None, None, "", "plane")
    common = 50.0 * common_view_baseline_m(field, rig) * (1 / 0.5 - 1 / 1.0)
    a, b = geometry.slope_from_disparity(common_view_baseline_m(field, rig))
    assert common == pytest.approx(a * (50.0 * 0.02 / 0.5 - geometry.doffs_px) + b)
    inside = (slice(None), slice(None), slice(10, 30), slice(20, 40))
    moved = found.views[inside] - found.views[2, 2][inside[2:]]
    assert moved[..., 0] == pytest.approx(common * (s - 2)[inside][..., 0], abs=1e-3)
    assert moved[..., 1] == pytest.approx(common * (t - 2)[inside][..., 0], abs=1e-3)
    assert found.weight is not None and (found.weight[inside] == (200 if weighted else 255)).all()


@pytest.mark.parametrize("name", ["zoom", "focus"])
def test_refuses_another_state_of_the_lens(name: str) -> None:
    camera = PlenopticCamera("", (40, 30), (50.0, 50.0), (19.5, 14.5), 1.0, 0.002, zoom_step=600, focus_step=-5)
    rig = StereoRig(camera, camera, (0.0, 0.0, 0.0), (-0.02, 0.0, 0.0), 0.9, 1.1, 1.0)
    geometry = rectified_geometry(rig)
    unknown = LightField(np.zeros((3, 3, 30, 40, 3), np.float32), None, None, "", "views")
    same = dataclasses.replace(unknown, zoom_step=600, focus_step=-5)
    other = dataclasses.replace(same, **{f"{name}_step": 12})
    for accepted in (unknown, same):
        assert rectify(accepted, rig, geometry, "left").zoom_step == accepted.zoom_step
    with pytest.raises(AssetError, match=f"views: taken at {name} step 12, but the rig's left .* --any-zoom"):
        rectify(other, rig, geometry, "left")
    rectify(other, rig, geometry, "left", any_zoom=True)


def test_refuses_a_light_field_of_another_size() -> None:
    rig = toed_in_rig()
    small = LightField(np.zeros((3, 3, 30, 40, 3), np.float32), None, None, "", "small")
    with pytest.raises(ShapeError, match=r"small: covers 40 x 30 px"):
        rectify(small, rig, rectified_geometry(rig), "left")


def test_refuses_cameras_behind_each_other() -> None:
    with pytest.raises(RigError, match="degrees"):
        rectified_geometry(dataclasses.replace(toed_in_rig(), translation_m=(-0.02, 0.0, -0.09)))
