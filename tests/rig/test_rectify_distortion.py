"""Rectification takes a lens's distortion out; the rig file keeps it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.intrinsics import plenoptic_rays, project
from lfstereo.rig.rectify import field_of_view, rectify
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig, write_rig
from lfstereo.rig.view_maps import view_baseline_m, view_homography, view_map

BEND = (-0.3, 0.4, 0.1, 0.01, -0.02)
LEFT = PlenopticCamera("L", (1300, 900), (2500.0, 2510.0), (655.0, 447.0), 0.85, 7e-4, BEND)
RIGHT = dataclasses.replace(LEFT, serial="R", principal_px=(640.0, 452.0))
RIG = StereoRig(LEFT, RIGHT, (0.002, 0.06, 0.003), (-0.095, -0.0005, 0.003), 0.6, 1.2, 12.4)
SAMPLING = ViewSampling((6.0, 5.0), (12.4, 12.4), -5e-4, 0.884)


def light_field(camera: PlenopticCamera) -> LightField:
    row, column = np.mgrid[:72, :104].astype(np.float32)
    views = np.broadcast_to(np.stack([column, row, row * 0 + 1], axis=-1), (3, 3, 72, 104, 3)).copy()
    return LightField(views, None, SAMPLING, camera.serial, "bent")


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_point_is_mapped_to_where_the_bent_lens_sees_it(side: str) -> None:
    geometry = rectified_geometry(RIG)
    camera = LEFT if side == "left" else RIGHT
    field = light_field(camera)
    step = view_baseline_m(field, camera)
    for t, s in ((1, 1), (0, 2)):
        x, y = view_map(field, camera, geometry, side, t, s)  # type: ignore[arg-type]
        for row, column in ((10, 20), (50, 80)):
            # The point at the depth where off-centre views are exact.
            target = geometry.camera(side)  # type: ignore[arg-type]
            pupil = np.array([(s - 1) * step, (t - 1) * step])
            ray = (np.array([column, row]) - target.principal_px) / geometry.focal_px
            zr, z0 = geometry.reference_m, geometry.zero_slope_m
            point = np.array([*(ray * zr + pupil * (1 - zr / z0)), zr]) @ target.rectified_from_camera
            lens = [1 / camera.focus_distance_m, camera.pupil_m_per_px]
            rays, _ = plenoptic_rays(np.array([*camera.focal_px, *camera.principal_px, *lens, *BEND]))
            offset = np.array([[s - 1, t - 1]]) * SAMPLING.view_step_px
            on_sensor = project(rays, offset, point[None], np.zeros((1, 2))).place[0]
            c, r = np.cos(SAMPLING.rotation_rad), np.sin(SAMPLING.rotation_rad)
            expected = np.array([[c, r], [-r, c]]) @ (on_sensor - SAMPLING.origin_px) / SAMPLING.step_px
            np.testing.assert_allclose([x[row, column], y[row, column]], expected, atol=1e-4)


def test_rectify_follows_the_map() -> None:
    geometry = rectified_geometry(RIG)
    field = light_field(LEFT)
    found = rectify(field, RIG, geometry, "left")
    x, y = view_map(field, LEFT, geometry, "left", 1, 2)
    inside = found.weight[1, 2] == 255  # type: ignore[index]
    assert inside.mean() > 0.5
    np.testing.assert_allclose(found.views[1, 2, inside, 0], x[inside], atol=0.1)
    np.testing.assert_allclose(found.views[1, 2, inside, 1], y[inside], atol=0.1)
    np.testing.assert_array_equal(field_of_view(field, LEFT, geometry, "left"), found.weight[1, 1] == 255)  # type: ignore[index]


def test_without_distortion_the_map_is_the_homography() -> None:
    straight = dataclasses.replace(LEFT, distortion=(0.0,) * 5)
    geometry = rectified_geometry(RIG)
    field = light_field(straight)
    x, y = view_map(field, straight, geometry, "left", 0, 2)
    u, v, w = view_homography(field, straight, geometry, "left", 0, 2) @ [30.0, 40.0, 1.0]
    np.testing.assert_allclose([x[40, 30], y[40, 30]], [u / w, v / w], atol=1e-4)


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
