"""Rectification takes a lens's distortion out; the rig file keeps it."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig import rectify as module
from lfstereo.rig.geometry import Side, rectified_geometry
from lfstereo.rig.intrinsics import plenoptic_rays, project
from lfstereo.rig.rectify import field_of_view, rectify
from lfstereo.rig.resample import resample_view
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig, write_rig
from lfstereo.rig.view_maps import view_baseline_m

BEND = (-0.3, 0.4, 0.1, 0.01, -0.02)
LEFT = PlenopticCamera("L", (1300, 900), (2500.0, 2510.0), (655.0, 447.0), 0.85, 7e-4, BEND)
RIGHT = dataclasses.replace(LEFT, serial="R", principal_px=(640.0, 452.0))
RIG = StereoRig(LEFT, RIGHT, (0.002, 0.06, 0.003), (-0.095, -0.0005, 0.003), 0.6, 1.2, 12.4)
SAMPLING = ViewSampling((6.0, 5.0), (12.4, 12.4), -5e-4, 0.884)


def light_field(camera: PlenopticCamera) -> LightField:
    row, column = np.mgrid[:72, :104].astype(np.float32)
    views = np.broadcast_to(np.stack([column, row, row * 0 + 1], axis=-1), (3, 3, 72, 104, 3)).copy()
    return LightField(views, None, SAMPLING, camera.serial, "bent")


@pytest.mark.parametrize("bend", [BEND, (0.0,) * 5])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_point_comes_from_where_the_lens_sees_it(side: Side, bend: tuple[float, ...]) -> None:
    """Views that hold their own coordinates tell: cubic convolution keeps straight courses exactly."""
    rig = dataclasses.replace(
        RIG, left=dataclasses.replace(LEFT, distortion=bend), right=dataclasses.replace(RIGHT, distortion=bend)
    )
    geometry = rectified_geometry(rig)
    camera = rig.left if side == "left" else rig.right
    field = light_field(camera)
    found = rectify(field, rig, geometry, side)
    step = view_baseline_m(field, camera)
    for t, s in ((1, 1), (0, 2)):
        for row, column in ((20, 30), (50, 70)):
            # The point at the depth where off-centre views are exact.
            target = geometry.camera(side)
            pupil = np.array([(s - 1) * step, (t - 1) * step])
            ray = (np.array([column, row]) - target.principal_px) / geometry.focal_px
            zr, z0 = geometry.reference_m, geometry.zero_slope_m
            point = np.array([*(ray * zr + pupil * (1 - zr / z0)), zr]) @ target.rectified_from_camera
            lens = [1 / camera.focus_distance_m, camera.pupil_m_per_px]
            rays, _ = plenoptic_rays(np.array([*camera.focal_px, *camera.principal_px, *lens, *bend]))
            offset = np.array([[s - 1, t - 1]]) * SAMPLING.view_step_px
            on_sensor = project(rays, offset, point[None], np.zeros((1, 2)), stigmatic=True).place[0]
            c, r = np.cos(SAMPLING.rotation_rad), np.sin(SAMPLING.rotation_rad)
            expected = np.array([[c, r], [-r, c]]) @ (on_sensor - SAMPLING.origin_px) / SAMPLING.step_px
            np.testing.assert_allclose(found.views[t, s, row, column, :2], expected, atol=1e-4)
            assert found.weight is not None and found.weight[t, s, row, column] == 255


def test_the_field_of_view_is_where_the_centre_view_has_its_full_weight() -> None:
    geometry = rectified_geometry(RIG)
    field = light_field(LEFT)
    found = rectify(field, RIG, geometry, "left")
    seen = field_of_view(field, LEFT, geometry, "left")
    assert found.weight is not None and 0.5 < seen.mean() < 1
    np.testing.assert_array_equal(seen, found.weight[1, 1] == 255)


def test_detail_between_the_samples_stays_in_place() -> None:
    """A cosine of eight px a turn, read in steps of a hundredth of a px, within the error of cubic convolution."""
    column = np.arange(40)
    wave = 0.5 + 0.4 * np.cos(2 * np.pi * column / 8)
    view = np.broadcast_to(wave[None, :, None], (9, 40, 3)).astype(np.float32).copy()
    out, weight = np.empty((9, 100, 3), np.float32), np.empty((9, 100), np.uint8)
    whole = np.full((9, 40), 255, np.uint8)
    finely = np.array([[0.01, 0, 16], [0, 1, 0], [0, 0, 1]])
    resample_view(view, whole, finely, np.zeros(5), np.eye(3), out, weight)
    expected = 0.5 + 0.4 * np.cos(2 * np.pi * (16 + 0.01 * np.arange(100)) / 8)
    np.testing.assert_allclose(out[4, :, 1], expected, atol=0.01)
    assert (weight == 255).all()


def test_beyond_the_border_there_is_no_weight_and_no_light_below_zero() -> None:
    view = np.zeros((6, 6, 3), np.float32)
    view[:, 3] = 1.0
    out, weight = np.empty((6, 12, 3), np.float32), np.empty((6, 12), np.uint8)
    shifted = np.array([[1.0, 0, -3.5], [0, 1, 0], [0, 0, 1]])
    resample_view(view, np.full((6, 6), 200, np.uint8), shifted, np.zeros(5), np.eye(3), out, weight)
    assert weight[2].tolist() == [0, 0, 0, 100, 200, 200, 200, 200, 200, 100, 0, 0]
    assert out.min() == 0 and out.max() < 1
    resample_view(np.ones_like(view), np.full((6, 6), 200, np.uint8), shifted, np.zeros(5), np.eye(3), out, weight)
    assert out[2, :, 0].tolist() == [0] * 3 + [1] * 7 + [0] * 2  # black, not the border's colour drawn out


def test_no_more_threads_than_compiled_code_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    pool = module.ThreadPoolExecutor

    def counted(max_workers: int) -> ThreadPoolExecutor:
        asked.append(max_workers)
        return pool(max_workers)

    monkeypatch.setattr(module, "ThreadPoolExecutor", counted)
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        rectify(light_field(LEFT), RIG, rectified_geometry(RIG), "left")
    finally:
        numba.set_num_threads(before)
    assert asked == [1]


def test_the_rig_file_keeps_the_distortion(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    write_rig(path, RIG)
    assert read_rig(path) == RIG
    lines = path.read_text().splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith("distortion")))
    assert read_rig(path).left.distortion == (0.0,) * 5
    path.write_text("\n".join(lines).replace("0.4, 0.1", "0.4"))
    with pytest.raises(ConfigError, match="expected 5 finite numbers"):
        read_rig(path)
