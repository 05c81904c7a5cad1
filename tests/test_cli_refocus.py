"""The commands ``refocus``, ``filter``, ``picture`` and ``animate``."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.lftoolbox import refocus_as_lftoolbox
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield import LightField, ViewSampling, read_light_field, write_light_field
from lfstereo.lightfield.encoding import srgb16
from lfstereo.rig.rig import PlenopticCamera, StereoRig, write_rig

ROUNDING = 40  # codes of 16 bits; light fields are stored rounded


def write_scene(path: Path, serial: str) -> LightField:
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.random((90, 120, 3), np.float32), (0, 0), 1.2)
    texture = (texture - texture.min()) / (texture.max() - texture.min())
    y, x = np.mgrid[:50, :62].astype(np.float32)
    views = np.empty((5, 5, 50, 62, 3), np.float32)
    for t in range(5):
        for s in range(5):
            slope = np.where(y < 25, 0.4, -0.3).astype(np.float32)
            views[t, s] = cv2.remap(texture, x + slope * (s - 2) + 20, y + slope * (t - 2) + 20, cv2.INTER_CUBIC)
    sampling = ViewSampling((0.0, 0.0), (1.0, 1.0), 0.0, 1.0)
    field = LightField(views.clip(0, 1), None, sampling, serial, "made")
    write_light_field(path, field)
    return read_light_field(path)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    write_scene(tmp_path / "scene.h5", "A")
    return tmp_path / "scene.h5"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    left, right = (PlenopticCamera(name, (62, 50), (110.0, 110.0), (31.0, 25.0), 0.85, 0.0009) for name in ("A", "B"))
    write_rig(tmp_path / "rig.toml", StereoRig(left, right, (0.0, 0.0, 0.0), (-0.1, 0.0, 0.0), 0.6, 1.2, 1.0))
    return tmp_path / "rig.toml"


def read_png(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return picture[..., ::-1].astype(int) if picture.ndim == 3 else picture.astype(int)


def test_stack_between_limits(scene: Path) -> None:
    out = scene.parent / "stack"
    words = ["--near", "0.4", "--far", "-0.4", "--slices", "3", "--all-in-focus"]
    assert main(["refocus", str(scene), "-o", str(out), *words]) == 0
    names = sorted(p.name for p in out.iterdir())
    assert names == [
        "all_in_focus.png",
        "refocus.toml",
        "slice_00_s+00.400.png",
        "slice_01_s+00.000.png",
        "slice_02_s-00.400.png",
    ]
    expected = srgb16(refocus(read_light_field(scene), [0.4, 0.0, -0.4]))
    for name, picture in zip(names[2:], expected, strict=True):
        np.testing.assert_array_equal(read_png(out / name), picture)
    table = tomllib.loads((out / "refocus.toml").read_text("utf-8"))
    assert table["slices"]["slope"] == [0.4, 0.0, -0.4]
    assert table["planes"]["slices"] == 3 and table["views"]["aperture"] == "disc"


def test_finds_the_limits_itself(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["refocus", str(scene), "-o", str(scene.parent / "stack"), "--slices", "2", "--json"]) == 0
    near, far = json.loads(capsys.readouterr().out)["slope"]
    assert near == pytest.approx(0.4, abs=0.15) and far == pytest.approx(-0.3, abs=0.15)


def test_one_picture_with_all_options(scene: Path) -> None:
    out = scene.parent / "one.png"
    words = ["--at", "0.2", "--aperture", "polygon", "--interpolation", "cubic", "--tilt", "0", "0.3"]
    assert main(["refocus", str(scene), "-o", str(out), *words]) == 0
    options = RefocusOptions(aperture="polygon", interpolation="cubic", tilt=(0.0, 0.3))
    expected = srgb16(refocus(read_light_field(scene), [0.2], options)[0])
    np.testing.assert_array_equal(read_png(out), expected)
    assert main(["refocus", str(scene), "-o", str(scene.parent / "fine.png"), "--at", "0.3", "--upsample", "2"]) == 0
    assert read_png(scene.parent / "fine.png").shape == (100, 124, 3)


def test_as_the_toolbox(scene: Path) -> None:
    out = scene.parent / "one.png"
    assert main(["refocus", str(scene), "-o", str(out), "--at", "-0.25", "--method", "lftoolbox"]) == 0
    expected = refocus_as_lftoolbox(read_light_field(scene).views, None, -0.25).picture
    np.testing.assert_allclose(read_png(out), srgb16(expected), atol=1)


def test_both_cameras_at_the_same_disparities(scene: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_scene(scene.parent / "right.h5", "B")
    out = scene.parent / "pair"
    words = ["--rig", str(rig), "--unit", "metres", "--near", "0.7", "--far", "1.1", "--slices", "3", "--json"]
    assert main(["refocus", str(scene), str(scene.parent / "right.h5"), "-o", str(out), *words]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["depth_m"][0] == pytest.approx(0.7, abs=1e-4) and table["depth_m"][2] == pytest.approx(1.1, abs=1e-4)
    assert np.allclose(np.diff(table["disparity_px"], 2), 0, atol=1e-3)
    names = [sorted(p.name for p in (out / side).iterdir()) for side in ("left", "right")]
    assert names[0] == names[1] and len(names[0]) == 3 and names[0][0].startswith("slice_00_d")


@pytest.mark.parametrize(
    "words, message",
    [
        (["scene.h5", "other.h5", "-o", "out"], "found 2 inputs"),
        (["scene.h5", "-o", "out.jpg"], "expected .png or none"),
        (["scene.h5", "-o", "out.png"], "one picture holds one plane"),
        (["scene.h5", "-o", "out", "--unit", "metres", "--at", "1"], "found no rig"),
        (["scene.h5", "-o", "o", "--at", "0", "--method", "lftoolbox", "--tilt", "1", "0"], "method lftoolbox: found"),
    ],
)
def test_refuses_what_does_not_go_together(
    words: list[str], message: str, scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(scene.parent)
    assert main(["refocus", *words]) == 3
    assert message in capsys.readouterr().err
    assert not Path("out").exists() and not Path("out.png").exists()


def test_filter_to_light_field_and_picture(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--kind", "hyperfan", "--near", "0.5", "--far", "0.3", "--bandwidth", "0.1"]
    assert main(["filter", str(scene), "-o", str(scene.parent / "near.h5"), *words]) == 0
    assert main(["filter", str(scene), "-o", str(scene.parent / "near.png"), *words]) == 0
    found = read_light_field(scene.parent / "near.h5")
    picture = read_png(scene.parent / "near.png")
    np.testing.assert_allclose(picture, srgb16(found.views[2, 2]).astype(int), atol=ROUNDING)
    sharp = srgb16(read_light_field(scene).views[2, 2]).astype(float)
    kept, lost = (np.std((picture - sharp)[rows, 6:-6]) for rows in (np.s_[5:20], np.s_[30:45]))
    assert lost > 1.5 * kept
    assert main(["filter", str(scene), "-o", str(scene.parent / "near.tif")]) == 3
    assert "expected .h5 or .png" in capsys.readouterr().err


def test_pictures_of_a_light_field(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = scene.parent
    assert main(["picture", str(scene), "-o", str(folder / "p.png"), "--position", "0.5", "1"]) == 0
    assert main(["picture", str(scene), "-o", str(folder / "row.png"), "--row", "10", "--zoom", "3"]) == 0
    assert main(["picture", str(scene), "-o", str(folder / "column.png"), "--column", "10"]) == 0
    assert main(["picture", str(scene), "-o", str(folder / "q.png"), "--quilt", "--columns", "3", "--rows", "2"]) == 0
    shapes = {p.name: read_png(p).shape[:2] for p in folder.glob("*.png")}
    assert shapes == {"p.png": (50, 62), "row.png": (15, 62), "column.png": (5, 50), "q_qs3x2a1.24.png": (100, 186)}
    capsys.readouterr()
    for words, message in (
        (["-o", str(folder / "p.jpg")], "expected .png"),
        (["-o", str(folder / "z.png"), "--row", "1", "--zoom", "0"], "--zoom: found 0"),
        (["-o", str(folder / "z.png"), "--row", "50"], "found row 50"),
    ):
        assert main(["picture", str(scene), *words]) == 3
        assert message in capsys.readouterr().err


def test_animations(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = scene.parent
    assert main(["animate", str(scene), "-o", str(folder / "sweep.gif"), "--frames", "4"]) == 0
    words = ["--kind", "orbit", "--frames", "4", "--slope", "0.4"]
    assert main(["animate", str(scene), "-o", str(folder / "orbit.mp4"), *words]) == 0
    assert "4 pictures" in capsys.readouterr().out
    assert main(["animate", str(scene), "-o", str(folder / "a.avi")]) == 3
    assert "expected .gif or .mp4" in capsys.readouterr().err
