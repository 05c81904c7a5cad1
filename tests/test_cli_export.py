"""The command ``lfstereo export``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy

from lfstereo.cli.main import main
from lfstereo.container import write_capture
from lfstereo.lightfield import LightField, ViewSampling, read_light_field, write_light_field


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    views = np.random.default_rng(1).uniform(0, 1, (3, 3, 4, 5, 3)).astype(np.float32)
    sampling = ViewSampling((0.0, 0.0), (12.4, 12.4), 0.0, 0.884)
    write_light_field(tmp_path / "scene.h5", LightField(views, None, sampling, "SIM1", "made"))
    return tmp_path / "scene.h5"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a__Decoded.mat", []),
        ("a.png", []),
        ("views", []),
        ("views", ["--format", "tiff"]),
        ("views", ["--format", "hci"]),
        ("again.h5", ["--force"]),
    ],
)
def test_light_field_to_each_format_and_back(scene: Path, name: str, words: list[str]) -> None:
    target = scene.parent / name
    assert main(["export", str(scene), "-o", str(target), *words]) == 0
    first, found = read_light_field(scene), read_light_field(target)
    np.testing.assert_allclose(found.views, first.views, atol=0.005)
    assert found.sampling == first.sampling
    assert main(["export", str(target), "-o", str(scene.parent / "back.h5")]) == 0
    np.testing.assert_allclose(read_light_field(scene.parent / "back.h5").views, first.views, atol=0.005)


def test_capture_to_dng(tmp_path: Path, draw_frame: Callable[..., Any]) -> None:
    capture = draw_frame(shape=(200, 240)).capture
    write_capture(tmp_path / "photo.LFR", capture)
    assert main(["export", str(tmp_path / "photo.LFR"), "-o", str(tmp_path / "photo.dng")]) == 0
    with rawpy.imread(str(tmp_path / "photo.dng")) as raw:
        np.testing.assert_array_equal(raw.raw_image, capture.mosaic)


@pytest.mark.parametrize(
    ("source", "target", "words", "message"),
    [
        ("scene.h5", "a.dng", [], "found the suffix '.h5', expected a raw capture"),
        ("photo.LFR", "a.mat", [], "found the suffix '.LFR', expected a light field; decode it first"),
        ("photo.LFR", "a.tif", ["--format", "dng"], "found the suffix '.tif', expected .dng"),
        ("scene.h5", "a.jpg", [], "found the suffix '.jpg', expected .h5, .mat, .png (ESLF), .dng"),
        ("scene.h5", "scene.h5", [], "exists already"),
        ("none.h5", "a.mat", [], "found no such file"),
    ],
)
def test_refusals(
    scene: Path, capsys: pytest.CaptureFixture[str], source: str, target: str, words: list[str], message: str
) -> None:
    assert main(["export", str(scene.parent / source), "-o", str(scene.parent / target), *words]) == 3
    assert message in capsys.readouterr().err
