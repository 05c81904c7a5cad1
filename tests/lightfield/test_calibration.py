"""Grid and illumination of a photograph between two zoom steps, and what is said without white images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.container import Capture, write_capture
from lfstereo.develop.shading import shading_from_white_image
from lfstereo.errors import AssetError, QualityWarning
from lfstereo.lightfield.calibration import calibrate_photograph, decode_photograph
from lfstereo.lightfield.options import DecodeOptions

SHAPE = (360, 380)
GREY = (1.0, 1.0, 1.0)


def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * np.sin(x / 19 + 0.3) * np.cos(y / 23) + 0.2 * np.sin((x + 2 * y) / 41)


def at_zoom(capture: Capture, zoom: int) -> Capture:
    lens = replace(capture.metadata.lens, zoom_step=zoom)
    return replace(capture, metadata=replace(capture.metadata, lens=lens))


def test_illumination_moves_with_the_interpolated_grid(tmp_path: Path, draw_frame: Callable[..., Any]) -> None:
    def drawn(zoom: int, **given: Any) -> Capture:
        pitch = 14.3 * (1 + 0.006 * zoom / 100)
        frame = draw_frame(shape=SHAPE, pitch=pitch, origin=(190.0, 180.0), colour=GREY, **given)
        return at_zoom(frame.capture, zoom)

    for zoom in (0, 100):
        write_capture(tmp_path / f"MOD_{zoom:04}.RAW", drawn(zoom))
    found = calibrate_photograph(drawn(50, scene=texture, parallax=2.0), tmp_path)
    assert found.grid.source == "white images"
    true = shading_from_white_image(drawn(50))
    inner = np.s_[12:-12, 12:-12]
    moved = np.abs(found.shading - true)[inner].mean()
    assert found.white is not None
    unmoved = np.abs(shading_from_white_image(found.white) - true)[inner].mean()
    # What remains is the noise, and the interpolation of rims a px wide.
    assert moved < 0.35 * unmoved
    assert found.shading.min() >= 0


def test_decode_without_white_images_warns(draw_frame: Callable[..., Any], tmp_path: Path) -> None:
    photograph = draw_frame(scene=texture).capture
    (tmp_path / "empty").mkdir()
    with pytest.warns(QualityWarning, match=r"found no white image.* of its lenslets agree, standard error 0\.0"):
        light_field = decode_photograph(photograph, tmp_path / "empty")
    assert light_field.views.shape[:2] == (15, 15)
    with (
        pytest.warns(QualityWarning),
        pytest.raises(AssetError, match="method lftoolbox: found no white image"),
    ):
        decode_photograph(photograph, tmp_path / "empty", DecodeOptions(method="lftoolbox"))
