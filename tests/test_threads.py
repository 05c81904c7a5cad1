"""What is computed does not depend on the number of threads, and float32 is close to float64."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numba
import numpy as np
import pytest
import torch

from lfstereo.assets import asset_folder
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield import LightField, ViewSampling, decode
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rectify import rectify
from lfstereo.rig.rig import read_rig

REFOCUS_FLOAT32 = 2e-6
"""Linear RGB of order 1, mean of 25 views."""
NETWORK_FLOAT32 = 2e-3
"""Px of disparity, of a map of 0 to 100 px."""
SLOPES = [-0.7, 0.0, 0.31]


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let numba, OpenCV, torch and our own pools use so many threads."""
    before = numba.get_num_threads(), cv2.getNumThreads(), torch.get_num_threads()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "cpu_count", lambda: count)
        numba.set_num_threads(count)
        cv2.setNumThreads(count)
        torch.set_num_threads(count)
        yield
    numba.set_num_threads(before[0])
    cv2.setNumThreads(before[1])
    torch.set_num_threads(before[2])


@pytest.fixture(scope="module")
def small() -> LightField:
    views = np.random.default_rng(0).random((5, 5, 60, 80, 3), np.float32)
    weight = np.random.default_rng(1).integers(0, 256, views.shape[:4], dtype=np.uint8)
    return LightField(views, weight, ViewSampling((6.4, 5.1), (96.6, 89.4), -5e-4, 2.0), "", "test")


def decoded(draw_frame: Callable[..., Any]) -> np.ndarray:
    white = draw_frame(shape=(200, 220), noise=0.5).capture
    photo = draw_frame(shape=(200, 220), scene=lambda x, y: 0.5 + 0.3 * np.sin(x / 13) * np.cos(y / 17)).capture
    return decode(photo, white).views


def rectified(field: LightField) -> np.ndarray:
    rig = read_rig(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml")
    return rectify(field, rig, rectified_geometry(rig), "left", any_camera=True).views


def tiny_network() -> BdffNet:
    torch.manual_seed(1)
    return BdffNet(Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)).eval()


def disparity(network: BdffNet, kind: torch.dtype) -> np.ndarray:
    stacks = [torch.rand(1, 16, 3, 64, 64, generator=torch.Generator().manual_seed(n)).to(kind) for n in (1, 2)]
    with torch.inference_mode():
        return network(*stacks).fused.numpy() * 100


needs_two = pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one core: there are no two threads")


@needs_two
@pytest.mark.parametrize("stage", ["decode", "rectify", "refocus", "network"])
def test_one_and_two_threads_give_the_same_numbers(
    stage: str, small: LightField, draw_frame: Callable[..., Any]
) -> None:
    def run() -> np.ndarray:
        if stage == "decode":
            return decoded(draw_frame)
        if stage == "rectify":
            return rectified(small)
        return refocus(small, SLOPES) if stage == "refocus" else disparity(tiny_network(), torch.float32)

    with threads(1):
        one = run()
    with threads(2):
        two = run()
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("weighted", [False, True])
def test_refocusing_in_float32(small: LightField, weighted: bool) -> None:
    """Against the definition in float64: linear interpolation of every view, weighted, over the summed weight."""
    views, weight = small.views.astype(np.float64), np.ones(small.views.shape[:4])
    if weighted:
        assert small.weight is not None
        weight = small.weight / 255.0
    field = LightField(small.views, small.weight if weighted else None, None, "", "test")
    found = refocus(field, SLOPES, RefocusOptions(aperture="all"))
    for slope, picture in zip(SLOPES, found, strict=True):
        total = sum(shifted(weight[t, s], slope, t - 2, s - 2) for t in range(5) for s in range(5))
        light = weight[..., None] * views
        summed = sum(shifted(light[t, s], slope, t - 2, s - 2) for t in range(5) for s in range(5))
        inner = np.s_[4:-4, 4:-4]
        exact = (summed / np.maximum(total, 1e-9)[..., None])[inner]
        np.testing.assert_allclose(picture[inner], exact, atol=REFOCUS_FLOAT32)


def shifted(picture: np.ndarray, slope: float, dt: int, ds: int) -> np.ndarray:
    """Return ``I(x - slope ds, y - slope dt)`` by linear interpolation; zero from outside."""
    for axis, move in ((0, slope * dt), (1, slope * ds)):
        whole = int(np.floor(move))
        part = move - whole
        padded = np.pad(picture, [(6, 6) if n == axis else (0, 0) for n in range(picture.ndim)])
        near, far = np.roll(padded, whole, axis), np.roll(padded, whole + 1, axis)
        blended = (1 - part) * near + part * far
        picture = np.take(blended, range(6, 6 + picture.shape[axis]), axis)
    return picture


def test_the_network_in_float32() -> None:
    network = tiny_network()
    coarse = disparity(network, torch.float32)
    fine = disparity(network.double(), torch.float64)
    assert coarse.dtype == np.float32 and fine.dtype == np.float64
    np.testing.assert_allclose(coarse, fine, atol=NETWORK_FLOAT32)
