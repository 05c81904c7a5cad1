"""All-in-focus pictures from slices."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.errors import ShapeError
from lfstereo.focus.fusion import fuse_slices
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.store import read_light_field


def error(picture: np.ndarray, sharp: np.ndarray) -> float:
    return float(np.sqrt(np.mean((picture - sharp)[8:-8, 8:-8] ** 2)))


def test_takes_each_half_from_where_it_is_sharp() -> None:
    sharp = np.random.default_rng(0).random((64, 96, 3), np.float32)
    blurred = cv2.GaussianBlur(sharp, (0, 0), 3)
    left = np.arange(96)[None, :, None] < 48
    slices = np.stack([np.where(left, sharp, blurred), np.where(left, blurred, sharp)])
    fused = fuse_slices(slices)
    assert error(fused, sharp) < 0.15 * error(slices[0], sharp)


def test_one_slice_is_itself() -> None:
    picture = np.random.default_rng(1).random((37, 50, 3), np.float32)
    np.testing.assert_allclose(fuse_slices(picture[None]), picture, atol=1e-5)


def test_a_flat_scene_stays_flat() -> None:
    np.testing.assert_allclose(fuse_slices(np.full((3, 40, 40, 3), 0.3, np.float32)), 0.3, atol=1e-5)


def test_tiny_pictures_are_averaged() -> None:
    slices = np.stack([np.zeros((4, 4, 3), np.float32), np.ones((4, 4, 3), np.float32)])
    np.testing.assert_allclose(fuse_slices(slices), 0.5)


def test_fuses_a_rendered_light_field(real_data: Path) -> None:
    field = read_light_field(real_data / "lf" / "hci_antinous")
    slices = refocus(field, np.linspace(2.6, -3.1, 16))
    sharp = field.views[field.centre]
    assert error(fuse_slices(slices), sharp) < 0.6 * min(error(slice_, sharp) for slice_ in slices)


def test_refuses_what_is_no_stack() -> None:
    with pytest.raises(ShapeError, match="slices: found an array of shape"):
        fuse_slices(np.zeros((4, 4, 3), np.float32))
