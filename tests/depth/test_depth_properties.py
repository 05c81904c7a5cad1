"""Disparity to depth and back, in float32 against float64."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lfstereo.depth.triangulate import disparity_of, triangulate

FLOAT32 = 2.0**-23
"""Relative step of a float32."""
disparities = arrays(np.float32, (3, 4), elements=st.floats(0, 100, width=32))
geometries = st.tuples(st.floats(200, 5000), st.floats(0.01, 0.5), st.floats(1, 200))


@given(disparities, geometries)
def test_disparity_comes_back_from_its_depth(disparity: np.ndarray, geometry: tuple[float, float, float]) -> None:
    """The depth is rounded to float32, which moves the disparity by that share of ``d + doffs``."""
    depth = triangulate(disparity, None, *geometry)
    assert depth.valid.all()
    found = disparity_of(depth.depth_m, *geometry)
    assert (np.abs(found - disparity) <= 1.01 * FLOAT32 * (disparity + geometry[2])).all()


@given(disparities, geometries)
def test_depth_is_that_of_float64(disparity: np.ndarray, geometry: tuple[float, float, float]) -> None:
    focal_px, baseline_m, doffs_px = geometry
    exact = focal_px * baseline_m / (disparity.astype(np.float64) + doffs_px)
    np.testing.assert_allclose(triangulate(disparity, None, *geometry).depth_m, exact, rtol=FLOAT32)


@given(disparities, geometries)
def test_nearer_is_larger(disparity: np.ndarray, geometry: tuple[float, float, float]) -> None:
    depth = triangulate(disparity, None, *geometry).depth_m.ravel()
    order = np.argsort(disparity.ravel())
    assert (np.diff(depth[order]) <= 0).all()
