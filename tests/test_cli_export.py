"""The command ``lfstereo export``."""

from __future__ import annotations

import configparser
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy

from lfstereo.cli.main import main
from lfstereo.container import read_capture, write_capture
from lfstereo.lightfield import LightField, ViewSampling, read_light_field, write_light_field
from lfstereo.rig.rig import PlenopticCamera, StereoRig, write_rig


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
        ("views", ["--format", "tiff", "--colour-space", "linear", "--exposure-ev", "-1"]),
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


def test_capture_to_dng(tmp_path: Path, draw_frame: Callable[..., Any], capsys: pytest.CaptureFixture[str]) -> None:
    capture = draw_frame(shape=(200, 240)).capture
    write_capture(tmp_path / "photo.LFR", capture)
    assert main(["export", str(tmp_path / "photo.LFR"), "-o", str(tmp_path / "photo.dng")]) == 0
    with rawpy.imread(str(tmp_path / "photo.dng")) as raw:
        np.testing.assert_array_equal(raw.raw_image, capture.mosaic)
    np.testing.assert_array_equal(read_capture(tmp_path / "photo.dng").mosaic, capture.mosaic)
    words = ["export", str(tmp_path / "photo.LFR"), "-o", str(tmp_path / "b.dng"), "--colour-space", "prophoto"]
    assert main(words) == 3
    assert "expected none for a raw mosaic" in capsys.readouterr().err


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    camera = PlenopticCamera("SIM1", (62, 50), (14000.0, 14000.0), (31.0, 25.0), 0.85, 0.0007)
    other = replace(camera, serial="SIM2")
    pair = StereoRig(camera, other, (0.0, 0.0, 0.0), (-0.1, 0.0, 0.0), 0.6, 1.2, 12.4)
    write_rig(tmp_path / "rig.toml", pair)
    return tmp_path / "rig.toml"


def test_benchmark_folder_with_a_rig_tells_depth(scene: Path, rig: Path) -> None:
    target = scene.parent / "hci"
    assert main(["export", str(scene), "-o", str(target), "--format", "hci", "--rig", str(rig)]) == 0
    found = configparser.ConfigParser()
    found.read(target / "parameters.cfg")
    sensor, focal = (float(found["intrinsics"][name]) for name in ("sensor_size_mm", "focal_length_mm"))
    baseline, focus = (float(found["extrinsics"][name]) for name in ("baseline_mm", "focus_distance_m"))
    assert baseline == pytest.approx(0.7 * 0.884)
    # The benchmark's own formula for depth in mm, at the slope that a point 0.6 m away has by our conventions.
    slope = 14000 / 12.4 * 0.0007 * 0.884 * (1 / 0.6 - 1 / 0.85)
    beta, focus_mm = baseline * focal * 5, 1000 * focus
    assert beta * focus_mm / (slope * focus_mm * sensor + beta) == pytest.approx(600, rel=1e-6)


def test_rig_that_does_not_fit(scene: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", str(scene), "-o", str(scene.parent / "a"), "--rig", str(rig)]
    assert main(words) == 3
    assert "--rig: found the format png, expected hci" in capsys.readouterr().err
    assert main([*words, "--format", "hci", "--side", "right"]) == 3
    assert "found camera #fb1c, expected #6b06, the right one of" in capsys.readouterr().err
    write_light_field(scene, replace(read_light_field(scene), sampling=None), force=True)
    assert main([*words, "--format", "hci"]) == 3
    assert "found views without a place on the sensor" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("source", "target", "words", "message"),
    [
        ("scene.h5", "a.dng", [], "found the suffix '.h5', expected a raw capture"),
        ("photo.LFR", "a.mat", [], "found the suffix '.LFR', expected a light field; decode it first"),
        ("photo.LFR", "a.tif", ["--format", "dng"], "found the suffix '.tif', expected .dng"),
        ("scene.h5", "a.jpg", [], "found the suffix '.jpg', expected .h5, .mat, .png (ESLF), .dng"),
        ("scene.h5", "scene.h5", [], "exists already"),
        ("scene.h5", "a.mat", ["--colour-space", "display-p3"], "format mat: found options of pictures"),
        ("none.h5", "a.mat", [], "found no such file"),
    ],
)
def test_refusals(
    scene: Path, capsys: pytest.CaptureFixture[str], source: str, target: str, words: list[str], message: str
) -> None:
    assert main(["export", str(scene.parent / source), "-o", str(scene.parent / target), *words]) == 3
    assert message in capsys.readouterr().err
