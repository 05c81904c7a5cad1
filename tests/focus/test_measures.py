"""Classical depth from focus on stacks whose depth is known."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.importers import read_sweep
from lfstereo.focus.measures import METHODS, FocusOptions, Method, blend_slices, depth_from_focus, find_focus
from lfstereo.focus.nayar1992 import modified_laplacian
from lfstereo.focus.refocus import render_stack, slice_disparities
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.field import LightField

ROOT = Path(__file__).resolve().parents[2]
VARIATIONAL_PX = 0.08
"""Of slices 0.25 px apart: its polynomial of degree 8 does not peak where the Gaussian does."""


def two_planes(noise: float = 0.0) -> tuple[LightField, np.ndarray, np.ndarray]:
    """9 x 9 views of a wall at slope -0.5 with a near half at +0.5. Returns the field, its slopes, its centre view."""
    rng = np.random.default_rng(0)
    rows, columns, pad = 60, 100, 8
    wall, front = rng.uniform(0.2, 1.0, (2, rows + 2 * pad, columns + 2 * pad, 3)).astype(np.float32)
    views = np.empty((9, 9, rows, columns, 3), np.float32)
    x = np.arange(columns)[None, :].repeat(rows, 0)
    for t in range(9):
        for s in range(9):
            # Slopes of half a px per view: sample on a lattice of half pixels by averaging neighbours.
            moved = [
                _at_half_px(picture, sign * (t - 4), sign * (s - 4), pad, (rows, columns))
                for picture, sign in ((wall, -1), (front, 1))
            ]
            near = x + 0.5 * (s - 4) < columns / 2
            views[t, s] = np.where(near[..., None], moved[1], moved[0])
    views += noise * rng.standard_normal(views.shape).astype(np.float32)
    slopes = np.where(x < columns / 2, 0.5, -0.5).astype(np.float32)
    return LightField(views, None, None, "", "test"), slopes, views[4, 4]


def _at_half_px(picture: np.ndarray, half_v: int, half_u: int, pad: int, size: tuple[int, int]) -> np.ndarray:
    v, u = pad + half_v // 2, pad + half_u // 2
    corners = [
        picture[v + a : v + a + size[0], u + b : u + b + size[1]] for a in (0, half_v % 2) for b in (0, half_u % 2)
    ]
    return np.mean(corners, axis=0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("noise, limit", [(0.0, 0.02), (0.03, 0.05)])
def test_finds_both_planes(noise: float, limit: float, method: Method) -> None:
    field, slopes, _ = two_planes(noise)
    found = depth_from_focus(
        render_stack(field, slice_disparities(1.0, -1.0, 9), (1.0, 0.0)), FocusOptions(method=method)
    )
    error = np.abs(found.disparity - slopes)[4:-4, 6:-6]
    assert np.median(error) < (VARIATIONAL_PX if method == "moeller2015" else limit)
    assert np.mean(error > 0.25) < 0.1  # off by a slice
    assert found.confidence.min() >= 0 and found.confidence.max() <= 1
    np.testing.assert_allclose(found.disparity, 1.0 - 0.25 * found.slice_index, atol=1e-5)


def test_all_in_focus_is_sharper_than_any_slice() -> None:
    field, _, sharp = two_planes()
    stack = render_stack(field, slice_disparities(1.0, -1.0, 9), (1.0, 0.0))
    found = depth_from_focus(stack)

    def error(picture: np.ndarray) -> float:
        return float(np.sqrt(np.mean((picture - sharp)[4:-4, 6:-6] ** 2)))

    assert error(found.all_in_focus) < 0.7 * min(error(slice_) for slice_ in stack.slices)


def test_without_neighbours_it_is_the_plain_measure() -> None:
    field, slopes, _ = two_planes()
    stack = render_stack(field, slice_disparities(1.0, -1.0, 9), (1.0, 0.0))
    found = depth_from_focus(stack, FocusOptions(radius_px=0, blur_px=0.0, window_px=5))
    assert np.median(np.abs(found.disparity - slopes)) < 0.02  # px


def test_measure_does_not_depend_on_exposure() -> None:
    picture = np.random.default_rng(0).uniform(0.2, 1.0, (9, 9, 3)).astype(np.float32)
    bright, dark = modified_laplacian(picture, 3, 0.7), modified_laplacian(picture / 16, 3, 0.7)
    np.testing.assert_allclose(bright, dark, atol=1e-4)


def test_gaussian_peak_between_slices_is_exact() -> None:
    """Sharpness falling as a Gaussian around slice 1.3: a sinusoid whose log amplitude is scaled by it."""
    x = np.arange(24)
    wave = np.cos(np.pi * x / 3)[None, :, None] * np.ones((5, 1, 3))
    amplitudes = 0.5 * np.exp(-((np.arange(4) - 1.3) ** 2) / 2)
    slices = np.stack([0.3 * np.exp(a * wave) for a in amplitudes]).astype(np.float32)
    stack = FocalStack(slices, np.float32([30, 20, 10, 0]), 0.1, "test")
    found = depth_from_focus(stack, FocusOptions(blur_px=0.0, window_px=7, radius_px=0))
    np.testing.assert_allclose(found.slice_index[:, 4:-4], 1.3, atol=1e-3)
    np.testing.assert_allclose(found.disparity[:, 4:-4], 17.0, atol=1e-2)  # px


def test_blend_interpolates_between_slices() -> None:
    slices = np.broadcast_to(np.float32([0, 1, 2])[:, None, None, None], (3, 1, 4, 3)).copy()
    blended = blend_slices(slices, np.float32([[0.0, 0.5, 1.75, 2.0]]))
    np.testing.assert_allclose(blended[0, :, 0], [0.0, 0.5, 1.75, 2.0])


def test_refuses_two_slices() -> None:
    with pytest.raises(ShapeError, match="found 2 slices"):
        depth_from_focus(FocalStack(np.zeros((2, 4, 4, 3), np.float32), np.float32([1, 0]), 0.1, "test"))


@pytest.mark.parametrize(
    "options",
    [
        FocusOptions(window_px=4),
        FocusOptions(window_px=0),
        FocusOptions(blur_px=-1.0),
        FocusOptions(radius_px=-1),
        FocusOptions(edge_share=0.0),
        FocusOptions(tv_strength=0.0),
        FocusOptions(iterations=0),
        FocusOptions(method="best"),  # type: ignore[arg-type]
    ],
)
def test_refuses_impossible_options(options: FocusOptions) -> None:
    with pytest.raises(ConfigError, match=r"(window_px|blur_px|radius_px|edge_share|tv_strength|iterations|method) = "):
        depth_from_focus(FocalStack(np.zeros((3, 4, 4, 3), np.float32), np.float32([2, 1, 0]), 0.1, "test"), options)


@pytest.mark.parametrize("method", METHODS)
def test_frames_in_focus_of_a_generated_stack(real_data: Path, method: Method) -> None:
    """41 frames whose frame in focus is known; the truth is a pickle, of which arrays alone are read."""
    spec = importlib.util.spec_from_file_location("bench", ROOT / "benchmarks" / "bench_depth_from_focus.py")
    assert spec is not None and spec.loader is not None
    bench = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench)
    folder = real_data / "focal" / "corentincou_gen" / "1"
    with (folder / "reference.pkl").open("rb") as file:
        truth = -np.asarray(bench.Arrays(file).load())
    found = find_focus(read_sweep(folder).slices, FocusOptions(method=method))
    error = np.abs(found.slice_index[20:379, 20:379] - truth)
    assert np.median(error) < 0.3  # frames
    assert np.mean(error > 3) < 0.001


def test_noise_alone_is_not_sure_and_texture_in_focus_is() -> None:
    rng = np.random.default_rng(1)
    slices = (0.3 + 0.01 * rng.standard_normal((9, 60, 80, 3))).astype(np.float32)
    slices[4, :, 40:] += 0.1 * rng.standard_normal((60, 40, 1)).astype(np.float32)
    found = find_focus(slices)
    assert found.valid[8:-8, 8:28].mean() < 0.02  # 1 in 1000, and windows that are not independent
    assert found.valid[:, 48:].all()
    np.testing.assert_allclose(found.slice_index[:, 56:], 4.0, atol=0.1)


def test_two_slices_are_told_apart() -> None:
    rng = np.random.default_rng(1)
    slices = np.full((2, 40, 40, 3), 0.3, np.float32)
    slices[0, :, :20] += 0.1 * rng.standard_normal((40, 20, 1)).astype(np.float32)
    slices[1, :, 20:] += 0.1 * rng.standard_normal((40, 20, 1)).astype(np.float32)
    found = find_focus(slices, FocusOptions(method="moeller2015"))
    assert (found.slice_index[:, 2:14] == 0).all() and (found.slice_index[:, 26:38] == 1).all()


def test_refuses_one_slice() -> None:
    with pytest.raises(ShapeError, match=r"expected \(K, V, U, 3\) with two or more"):
        find_focus(np.zeros((1, 4, 4, 3), np.float32))
