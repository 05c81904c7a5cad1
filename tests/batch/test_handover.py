"""Focal stacks between two workers: every number as it was."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.assets import asset_folder
from lfstereo.batch.handover import read_focused, write_focused
from lfstereo.errors import ContainerError
from lfstereo.focus.refocus import slice_disparities
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.samples import ViewSamples
from lfstereo.pipeline import FocusedPair, SideResult
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import StereoRig, read_rig


@pytest.fixture(scope="module")
def rig() -> StereoRig:
    return read_rig(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml")


def side(seed: int, samples: bool) -> SideResult:
    random = np.random.default_rng(seed)
    pictures = random.integers(0, 256, (2, 5, 7, 3), np.uint8)
    return SideResult(
        stack=FocalStack(random.random((4, 5, 7, 3), np.float32), slice_disparities(90, 0, 4), 0.104, "left.LFR"),
        centre_view=random.random((5, 7, 3), np.float32),
        seen=random.random((5, 7)) > 0.5,
        serial="SIM1",
        slope_from_disparity=(0.01, -0.3),
        samples=ViewSamples(pictures, ((0, 0), (2, -2)), 2, 225) if samples else None,
    )


def assert_same(found: Any, expected: Any) -> None:
    if dataclasses.is_dataclass(expected):
        for field in dataclasses.fields(expected):
            assert_same(getattr(found, field.name), getattr(expected, field.name))
    else:
        np.testing.assert_array_equal(found, expected)
        assert np.asarray(found).dtype == np.asarray(expected).dtype


def test_round_trip(tmp_path: Path, rig: StereoRig) -> None:
    focused = FocusedPair(side(1, True), side(2, False), rectified_geometry(rig))
    write_focused(tmp_path / "a" / "pair.npz", focused)
    assert_same(read_focused(tmp_path / "a" / "pair.npz", rig), focused)


@pytest.mark.parametrize("content", [None, b"", b"PK no archive"])
def test_damaged(tmp_path: Path, rig: StereoRig, content: bytes | None) -> None:
    path = tmp_path / "pair.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ContainerError, match="focal stacks cannot be read"):
        read_focused(path, rig)
