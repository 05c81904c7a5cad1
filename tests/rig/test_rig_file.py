"""The rig file: what is written is read back, and what is wrong is said."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from lfstereo.errors import ConfigError
from lfstereo.rig.rig import PlenopticCamera, SensorGrid, StereoRig, read_rig, write_rig

CAMERA = PlenopticCamera("B5143909630", (7728, 5368), (14630.5, 14634.25), (3860.0, 2690.5), 0.85, 7.1e-4)
RIG = StereoRig(CAMERA, CAMERA, (0.0, 0.11, 0.001), (-0.0947, 0.001, 0.0052), 0.6, 1.2, 12.372)


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    write_rig(path, RIG)
    return path


def test_round_trip(rig_file: Path) -> None:
    assert read_rig(rig_file) == RIG
    assert RIG.baseline_m == pytest.approx((0.0947**2 + 0.001**2 + 0.0052**2) ** 0.5)


@pytest.mark.parametrize(
    ("find", "replace", "message"),
    [
        ('format = "lfstereo rig 1"', "", "format is None"),
        ("near_m = 0.6", "near_m = 1.6", "near_m < far_m"),
        ("near_m = 0.6", 'near_m = "x"', "expected 1 finite number"),
        ("[left]", "[links]", r"\[left\] is missing"),
        ("focus_distance_m = 0.85", "focus_distance_m = -1.0", "expected a positive number"),
        ("focal_px = [14630.5, 14634.25]", "focal_px = [14630.5]", "expected 2 finite numbers"),
        ("focal_px = [14630.5, 14634.25]", "focal_px = [0.0, 1.0]", "must be positive"),
        ("translation_m = [-0.0947, 0.001, 0.0052]", "translation_m = [0.0, 0.0, 0.0]", "translation_m is zero"),
        ('serial = "B5143909630"', "serial = 5", "expected text"),
        ("[right]", "[right", "not valid TOML"),
    ],
)
def test_says_what_is_wrong(rig_file: Path, find: str, replace: str, message: str) -> None:
    text = rig_file.read_text()
    assert find in text
    rig_file.write_text(text.replace(find, replace, 1))
    with pytest.raises(ConfigError, match=message) as caught:
        read_rig(rig_file)
    assert str(rig_file) in str(caught.value)
    assert "\n" not in str(caught.value).replace(str(rig_file), "")


def test_zoom_and_focus(rig_file: Path) -> None:
    assert read_rig(rig_file).left.zoom_step is None, "files without them are read"
    rig = dataclasses.replace(RIG, right=dataclasses.replace(CAMERA, zoom_step=982, focus_step=-5))
    write_rig(rig_file, rig, force=True)
    assert read_rig(rig_file) == rig
    rig_file.write_text(rig_file.read_text().replace("zoom_step = 982", "zoom_step = 98.2"))
    with pytest.raises(ConfigError, match=r"zoom_step = 98\.2, expected a whole number"):
        read_rig(rig_file)


def test_lattice_of_micro_images(rig_file: Path) -> None:
    grid = SensorGrid((1.5, 0.25), (12.375, 12.3715), -5.4e-4)
    rig = dataclasses.replace(RIG, right=dataclasses.replace(CAMERA, grid=grid))
    write_rig(rig_file, rig, force=True)
    assert read_rig(rig_file) == rig
    rig_file.write_text(rig_file.read_text().replace("step_px = [12.375", "step_px = [-12.375"))
    with pytest.raises(ConfigError, match=r"\[right\.grid\]: step_px = \[-12\.375.* expected positive numbers"):
        read_rig(rig_file)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_rig(tmp_path / "no.toml")
