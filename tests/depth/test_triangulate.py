"""Metres and points from closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.conventions import depth_from_disparity
from lfstereo.depth.points import PointCloud, PointOptions, points_from_depth
from lfstereo.depth.triangulate import DepthMap, disparity_of, triangulate
from lfstereo.errors import ConfigError, InputError, ShapeError

GREY = np.full((4, 5, 3), 0.18, np.float32)


def plane(depth_m: float = 2.0, shape: tuple[int, int] = (4, 5)) -> DepthMap:
    return DepthMap(np.full(shape, depth_m, np.float32), np.ones(shape, np.bool_))


def test_depth_of_the_known_case() -> None:
    found = triangulate(np.full((2, 2), 10.0, np.float32), None, 1000.0, 0.1, 90.0)
    np.testing.assert_allclose(found.depth_m, 1.0, atol=1e-6)
    assert found.valid.all() and found.depth_m.dtype == np.float32
    assert depth_from_disparity(10.0, 1000.0, 0.1, 90.0) == pytest.approx(1.0)


def test_a_disparity_behind_infinity_is_not_valid() -> None:
    found = triangulate(np.array([[-90.0, -100.0, np.nan, 0.0]], np.float32), None, 1000.0, 0.1, 90.0)
    assert found.valid.tolist() == [[False, False, False, True]]
    assert np.isfinite(found.depth_m).all()


def test_unknown_disparity_stays_unknown() -> None:
    valid = np.array([[True, False]])
    assert triangulate(np.full((1, 2), 5.0, np.float32), valid, 500.0, 0.1, 0.0).valid.tolist() == [[True, False]]


def test_disparity_and_depth_are_inverse() -> None:
    disparity = np.linspace(0.0, 100.0, 50, dtype=np.float32)[None]
    depth = triangulate(disparity, None, 1156.0, 0.095, 90.0).depth_m
    np.testing.assert_allclose(disparity_of(depth, 1156.0, 0.095, 90.0), disparity, atol=1e-4)  # px


def test_points_follow_the_pinhole() -> None:
    depth = np.random.default_rng(0).uniform(1.0, 3.0, (4, 5)).astype(np.float32)
    cloud = points_from_depth(
        DepthMap(depth, np.ones((4, 5), np.bool_)), GREY, 300.0, (2.5, 1.0), PointOptions(edge_step=None)
    )
    x, y, z = cloud.points_m.T
    v, u = np.indices((4, 5))
    np.testing.assert_allclose(300.0 * x / z + 2.5, u.ravel(), atol=1e-4)  # px
    np.testing.assert_allclose(300.0 * y / z + 1.0, v.ravel(), atol=1e-4)  # px
    np.testing.assert_allclose(z, depth.ravel())
    assert (cloud.colours == 118).all()


def test_points_leave_out_what_is_unknown_far_or_at_an_outline() -> None:
    depth = plane(2.0)
    depth.depth_m[:, 3:] = 4.0
    depth.valid[0, 0] = False
    assert len(points_from_depth(depth, GREY, 1.0, (0.0, 0.0), PointOptions(edge_step=None)).points_m) == 19
    near = points_from_depth(depth, GREY, 1.0, (0.0, 0.0), PointOptions(max_depth_m=3.0, edge_step=None))
    assert len(near.points_m) == 11
    kept = points_from_depth(depth, GREY, 1.0, (0.0, 0.0))
    assert sorted({float(x) for x in np.round(kept.points_m[:, 0] / kept.points_m[:, 2])}) == [0.0, 1.0, 4.0]
    assert len(kept.points_m) == 4 + 4 + 4 - 1


def test_no_valid_pixel_gives_no_points() -> None:
    depth = DepthMap(np.zeros((4, 5), np.float32), np.zeros((4, 5), np.bool_))
    assert points_from_depth(depth, GREY, 1.0, (0.0, 0.0)).points_m.shape == (0, 3)


def test_a_slanted_plane_keeps_its_points() -> None:
    depth = plane()
    depth.depth_m[:] = 2.0 + 0.01 * np.arange(5)
    assert len(points_from_depth(depth, GREY, 1.0, (0.0, 0.0)).points_m) == 20


@pytest.mark.parametrize("focal, baseline, doffs", [(0.0, 0.1, 0.0), (1.0, -0.1, 0.0), (1.0, 0.1, np.nan)])
def test_refuses_an_impossible_geometry(focal: float, baseline: float, doffs: float) -> None:
    with pytest.raises(InputError, match="rectified geometry: found focal length"):
        triangulate(np.zeros((1, 1), np.float32), None, focal, baseline, doffs)


def test_refuses_arrays_that_do_not_fit() -> None:
    with pytest.raises(ShapeError, match="disparity: found an array of shape"):
        triangulate(np.zeros(3, np.float32), None, 1.0, 1.0, 0.0)
    with pytest.raises(ShapeError, match="valid: found shape"):
        triangulate(np.zeros((2, 2), np.float32), np.ones((1, 2), np.bool_), 1.0, 1.0, 0.0)
    with pytest.raises(ShapeError, match="depth map: valid has shape"):
        DepthMap(np.zeros((2, 2), np.float32), np.ones((2, 3), np.bool_))
    with pytest.raises(ShapeError, match="colour: found shape"):
        points_from_depth(plane(), np.zeros((4, 4, 3), np.float32), 1.0, (0.0, 0.0))
    with pytest.raises(ShapeError, match="colours of the points"):
        PointCloud(np.zeros((2, 3), np.float32), np.zeros((1, 3), np.uint8))


def test_refuses_a_depth_that_is_not_positive() -> None:
    with pytest.raises(InputError, match="not positive metres"):
        disparity_of(np.array([0.0], np.float32), 1.0, 1.0, 0.0)


@pytest.mark.parametrize("options", [PointOptions(max_depth_m=0.0), PointOptions(edge_step=-1.0)])
def test_refuses_options_that_keep_nothing(options: PointOptions) -> None:
    with pytest.raises(ConfigError, match=r"expected a (depth|share) above 0"):
        points_from_depth(plane(), GREY, 1.0, (0.0, 0.0), options)
