"""A result made by hand: a near half and a far half, everything about it known, no network involved."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.depth.disparity import DisparityMap
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.samples import sample_views
from lfstereo.lightfield.store import write_light_field
from lfstereo.pipeline import PairResult, RunOptions, SideResult
from lfstereo.progress import StageClock
from lfstereo.results import Inputs, write_results
from lfstereo.rig.geometry import RectifiedCamera, RectifiedGeometry

from .browser import Page, browsed

ROWS, COLUMNS = 96, 140
NEAR_PX, FAR_PX = 60.0, 18.0
"""Disparity of the left and of the right half of the picture."""
UNCERTAINTY_PX = (0.5, 3.25)
"""Of the two halves."""
FOCAL_PX, BASELINE_M, DOFFS_PX = 300.0, 0.1, 90.0
SLOPE_FROM_DISPARITY = (0.02, -0.8)
"""Slopes of 0.4 and -0.44 px per view."""


def texture(seed: int = 2) -> np.ndarray:
    """Return a ``(V, U, 3)`` picture with detail everywhere."""
    noise = np.random.default_rng(seed).random((ROWS, COLUMNS, 3), dtype=np.float32)
    fine = cv2.GaussianBlur(noise, None, 0.9)
    coarse = cv2.GaussianBlur(noise, None, 6.0)
    return np.clip(0.4 + 1.2 * (fine - 0.5) + 3.0 * (coarse - 0.5), 0.02, 0.98).astype(np.float32)


def disparity() -> np.ndarray:
    return np.where(np.arange(COLUMNS)[None, :] < COLUMNS // 2, NEAR_PX, FAR_PX).repeat(ROWS, axis=0).astype(np.float32)


def light_field(count: int = 5) -> LightField:
    """Return views in which the two halves move by their slopes."""
    sharp, near = texture(), disparity() == NEAR_PX
    views = np.empty((count, count, ROWS, COLUMNS, 3), np.float32)
    for t in range(count):
        for s in range(count):
            moved = []
            for d in (NEAR_PX, FAR_PX):
                slope = SLOPE_FROM_DISPARITY[0] * d + SLOPE_FROM_DISPARITY[1]
                shift = np.float32([[1, 0, -slope * (s - count // 2)], [0, 1, -slope * (t - count // 2)]])
                moved.append(cv2.warpAffine(sharp, shift, (COLUMNS, ROWS), borderMode=cv2.BORDER_REPLICATE))
            views[t, s] = np.where(near[..., None], *moved)
    return LightField(views, None, None, "", "two halves")


def pair_result() -> PairResult:
    sharp, map_px = texture(), disparity()
    focused = np.linspace(90.0, 0.0, 16, dtype=np.float32)
    slices = np.empty((16, ROWS, COLUMNS, 3), np.float32)
    for k, d in enumerate(focused):
        blurred = [cv2.GaussianBlur(sharp, None, 0.05 + 0.12 * abs(d - half)) for half in (NEAR_PX, FAR_PX)]
        slices[k] = np.where((map_px == NEAR_PX)[..., None], *blurred)
    stack = FocalStack(slices, focused, 0.1, "two halves")
    columns = np.arange(COLUMNS)[None, :].repeat(ROWS, axis=0).astype(np.float32)
    rows = np.arange(ROWS)[:, None].repeat(COLUMNS, axis=1).astype(np.float32)
    right = cv2.remap(sharp, columns + 20, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    seen = np.ones((ROWS, COLUMNS), bool)
    seen[:, :4] = False
    sides = [
        SideResult(stack, view, seen, "", SLOPE_FROM_DISPARITY, samples)
        for view, samples in ((sharp, sample_views(light_field())), (right, None))
    ]
    cameras = [RectifiedCamera(np.eye(3), (cx, (ROWS - 1) / 2)) for cx in (70.0, 70.0 + DOFFS_PX)]
    geometry = RectifiedGeometry(*cameras, FOCAL_PX, BASELINE_M, (ROWS, COLUMNS), 0.3, 0.3, 90.0)
    unsure = np.where(map_px == NEAR_PX, *UNCERTAINTY_PX).astype(np.float32)
    return PairResult(DisparityMap(map_px, seen, sharp, unsure), *sides, geometry, "0" * 64, seen)


@pytest.fixture(scope="session")
def result_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result folder as a run writes it."""
    place = tmp_path_factory.mktemp("viewer")
    inputs = [place / name for name in ("left <b>.h5", "right & co.h5", "rig.toml")]
    for path in inputs:
        path.write_bytes(path.name.encode())
    out = place / "shelf" / "a result"
    out.parent.mkdir()
    write_results(out, pair_result(), Inputs(*inputs), RunOptions(), StageClock())
    return out


@pytest.fixture(scope="session")
def field_file(result_folder: Path) -> Path:
    """A light field beside the result."""
    path = result_folder.parent / "field.h5"
    write_light_field(path, light_field())
    return path


@pytest.fixture(scope="session")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """One browser for all tests."""
    yield from browsed(tmp_path_factory.mktemp("profile"), COLUMNS)
