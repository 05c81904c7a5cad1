"""The command ``lfstereo decode``."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.container import write_capture
from lfstereo.lightfield import read_light_field


@pytest.fixture
def folder(tmp_path: Path, draw_frame: Callable[..., Any]) -> Path:
    """Hold one photograph and the white image of its camera."""
    shape = (300, 330)
    white = draw_frame(shape=shape).capture
    photo = draw_frame(shape=shape, scene=lambda x, y: 0.5 + 0.3 * np.sin(x / 20) * np.sin(y / 30)).capture
    (tmp_path / "whites" / "SIM1").mkdir(parents=True)
    write_capture(tmp_path / "whites" / "SIM1" / "MOD_0001.RAW", white)
    write_capture(tmp_path / "photo.LFR", photo)
    cv2.imwrite(str(tmp_path / "photo.png"), photo.mosaic)
    return tmp_path


def test_decode_writes_light_field_and_picture(folder: Path, capsys: pytest.CaptureFixture[str], offline: None) -> None:
    out = folder / "scene.h5"
    assert main(["decode", str(folder / "photo.LFR"), "--whites", str(folder / "whites"), "-o", str(out)]) == 0
    assert read_light_field(out).views.shape == (15, 15, 24, 27, 3)
    assert read_light_field(out).serial == "#fb1c"  # the mark of SIM1
    assert b"SIM1" not in out.read_bytes()
    assert cv2.imread(str(folder / "scene.png")) is not None
    printed = capsys.readouterr()
    assert "views 15 x 15 of 27 x 24 px" in printed.out
    assert "grid from the white image: 24 x 23 lenslets, pitch 14.30" in printed.out


def test_decode_without_white_image_as_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = folder / "scene.h5", folder / "look.png"
    words = ["decode", str(folder / "photo.LFR"), "-o", str(out), "--preview", str(picture), "--json", "--views", "9"]
    assert main(words) == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert summary["views"] == [9, 9, 24, 27, 3]
    assert summary["grid_from"] == "photograph"
    assert summary["pitch_px"] == pytest.approx(14.3, abs=0.01)
    assert "estimated from the picture itself: 100% of its lenslets agree" in printed.err
    assert picture.exists()
    assert not (folder / "scene.png").exists()


def test_options_from_a_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = folder / "run.toml"
    config.write_text('[decode]\nviews = 5\n[develop]\ndemosaic = "bilinear"\n')
    words = ["decode", str(folder / "photo.LFR"), "-o", str(folder / "a.h5"), "--config", str(config), "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["views"][:2] == [5, 5]
    config.write_text("[develop]\nsharpen = 3\n")
    assert main([*words, "--force"]) == 3
    assert "'sharpen' is not an option" in capsys.readouterr().err


def test_existing_output_is_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "scene.h5").write_text("mine")
    assert main(["decode", str(folder / "photo.LFR"), "-o", str(folder / "scene.h5")]) == 3
    assert "exists already" in capsys.readouterr().err
    (folder / "other.png").write_text("mine")
    assert main(["decode", str(folder / "photo.LFR"), "-o", str(folder / "other.h5")]) == 3
    assert (folder / "other.png").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["photo.LFR", "-o", "a.npz"], 3, "found the suffix '.npz', expected .h5"),
        (["photo.LFR", "--whites", "nowhere", "-o", "a.h5"], 3, "found no such folder"),
        (["missing.LFR", "-o", "a.h5"], 3, "missing.LFR"),
        (["photo.LFR", "--views", "4", "-o", "a.h5"], 3, "expected an odd number"),
        (["photo.LFR", "--least-quality", "3", "-o", "a.h5"], 4, "agree with one regular grid"),
        (["photo.png", "--camera", "lytro-f02", "-o", "a.h5"], 3, "lytro-f02"),
    ],
)
def test_bad_input_is_one_line(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(folder)
    assert main(["decode", *words]) == code
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith("lfstereo decode: ")
    assert message in last
    assert not list(folder.glob("*.h5"))


def test_photograph_given_as_white_image(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(folder / "photo.LFR"), "--whites", str(folder / "photo.LFR"), "-o", "a.h5"]) == 4
    assert "a white image stays below" in capsys.readouterr().err


def test_mosaic_as_an_image(folder: Path, draw_frame: Callable[..., Any], capsys: pytest.CaptureFixture[str]) -> None:
    from lfstereo.assets import asset_folder

    text = (asset_folder("calib") / "cameras" / "lytro-f01.toml").read_text()
    small = folder / "small.toml"
    small.write_text(text.replace("width = 3280", "width = 300").replace("height = 3280", "height = 260"))
    drawn = draw_frame(shape=(260, 300), pitch=9.93, bayer="bggr", scene=lambda x, y: 0.6 + 0.2 * np.sin(x / 9))
    levels = (drawn.capture.mosaic.astype(float) - 64) / 959 * (255 - 10.46) + 10.46
    cv2.imwrite(str(folder / "mosaic.png"), np.clip(np.round(levels), 0, 255).astype(np.uint8))
    words = ["decode", str(folder / "mosaic.png"), "--camera", str(small), "-o", str(folder / "f01.h5"), "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["views"][:2] == [9, 9]
    assert replace(read_light_field(folder / "f01.h5"), views=np.zeros((1, 1, 2, 2, 3), np.float32), weight=None)
