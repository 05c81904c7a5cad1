"""Small frames of both cameras, made from the profiles and a seeded generator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lfstereo.container import Capture, FrameMetadata
from lfstereo.container.mosaic_image import read_camera_profile


def random_capture(metadata: FrameMetadata, seed: int = 1) -> Capture:
    """Return a frame of random pixels that use every bit of the packing."""
    shape = (metadata.height, metadata.width)
    pixels = np.random.default_rng(seed).integers(0, 1 << metadata.bits_per_pixel, shape, dtype=np.uint16)
    return Capture(mosaic=pixels, metadata=metadata, source="test")


@pytest.fixture
def illum() -> FrameMetadata:
    """An Illum's metadata with no field at its default, for a frame of 48 x 40."""
    profile = read_camera_profile("lytro-illum")
    return replace(
        profile,
        firmware="2.0.0 (42)",
        serial="B5100000001",
        width=48,
        height=40,
        black=(64.0, 65.0, 66.0, 67.0),
        exposure_bias_ev=-0.25,
        iso=125.5,
        captured_at="2026-05-04T03:02:01.000Z",
        exposure_s=0.01,
        lenslets=replace(
            profile.lenslets, rotation_rad=-5.4e-4, scale_x=0.9999, scale_y=1.0003, offset_m=(8e-6, -1e-6, 3.7e-5)
        ),
    )


@pytest.fixture
def f01() -> FrameMetadata:
    """An F01's metadata for a frame of 50 x 40."""
    return replace(read_camera_profile("lytro-f01"), serial="A1000000001", width=50, height=40)


@pytest.fixture
def illum_capture(illum: FrameMetadata) -> Capture:
    """A frame of an Illum."""
    return random_capture(illum)


@pytest.fixture
def f01_capture(f01: FrameMetadata) -> Capture:
    """A frame of an F01."""
    return random_capture(f01)
