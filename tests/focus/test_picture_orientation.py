"""Pictures that lie on their side by their EXIF data come upright, whatever their format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

from lfstereo.focus.importers import ImportOptions, read_sweep

JPEG_CODES = 6
"""Of a smooth picture at quality 95."""
AS_STORED = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.transpose(1, 0, 2),
    6: lambda a: np.rot90(a, 1),
    7: lambda a: a[::-1, ::-1].transpose(1, 0, 2),
    8: lambda a: np.rot90(a, -1),
}
"""EXIF orientation -> how an upright picture is stored (CIPA DC-008, tag 274)."""


def upright() -> np.ndarray:
    y, x = np.mgrid[:24, :32]
    return np.stack([4 * x + 40, 5 * y + 60, 2 * x + 3 * y + 50], axis=-1).astype(np.uint8)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("orientation", AS_STORED)
def test_upright(tmp_path: Path, suffix: str, orientation: int) -> None:
    stored = np.ascontiguousarray(AS_STORED[orientation](upright()))
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    for number in range(2):
        Image.fromarray(stored).save(tmp_path / f"{number}{suffix}", exif=exif, quality=95)
    found = read_sweep(tmp_path, ImportOptions()).slices[0]
    linear = np.where(found <= 0.0031308, 12.92 * found, 1.055 * np.maximum(found, 1e-9) ** (1 / 2.4) - 0.055)
    assert linear.shape == upright().shape
    assert np.abs(linear * 255 - upright()).max() < JPEG_CODES
