"""The command ``lfstereo whites``: import, list, check, and the decode that uses what was imported."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.container import Capture, write_capture

FACTORY = {
    "zoomPosition": [3],
    "focusPosition": [[4]],
    "xDiskOriginPixels": [[6.2]],
    "yDiskOriginPixels": [[9.7]],
    "xDiskStepPixelsX": [[14.3]],
    "xDiskStepPixelsY": [[0.0286]],
    "yDiskStepPixelsX": [[7.1252]],
    "yDiskStepPixelsY": [[12.3985]],
}


@pytest.fixture
def camera(tmp_path: Path, draw_frame: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a camera left, in a folder; with a home of its own."""
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "home"))
    white: Capture = draw_frame().capture
    lens = replace(white.metadata.lens, zoom_step=3, focus_step=4)
    folder = tmp_path / "camera"
    folder.mkdir()
    write_capture(folder / "MOD_0001.RAW", replace(white, metadata=replace(white.metadata, lens=lens)))
    (folder / "mla_calibration.json").write_text(json.dumps(FACTORY))
    (folder / "HOTPIXEL.BIN").write_bytes(bytes([1, 0, 0, 0, 50, 0, 60, 0]))
    photograph: Capture = draw_frame(scene=lambda x, y: 0.6 + 0.3 * np.sin(x / 19) * np.cos(y / 23)).capture
    write_capture(tmp_path / "photo.LFR", replace(photograph, metadata=replace(photograph.metadata, lens=lens)))
    return folder


def test_import_list_check_decode(camera: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["whites", "import", str(camera)]) == 0
    assert "1 white images of SIM1, 4 files copied" in capsys.readouterr().out
    assert main(["whites", "list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["whites"]
    assert (row["serial"], row["zoom_step"], row["focus_step"]) == ("SIM1", 3, 4)
    assert main(["whites", "check", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["whites"]
    assert row["pitch_px"] == pytest.approx(14.3, abs=2e-3)
    assert row["quality"] == 1 and row["uncertainty_px"] < 0.01
    assert row["factory_offset_px"] < 0.05
    out = tmp_path / "scene.h5"
    assert main(["decode", str(tmp_path / "photo.LFR"), "-o", str(out), "--json", "--report"]) == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert "warning" not in printed.err
    assert summary["grid_from"] == "white image" and summary["hot_pixels"] == 1
    assert summary["grid_offset_px"] < 0.05
    assert summary["white_image"].endswith("MOD_0001.RAW")


def test_tables_and_a_frame_that_is_no_white_image(camera: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (camera / "MOD_0001.TXT").read_bytes()
    raw = (camera / "MOD_0001.RAW").read_bytes()
    (camera / "MOD_0002.TXT").write_bytes(text)
    (camera / "MOD_0002.RAW").write_bytes(bytes(len(raw)))
    (camera / "MOD_0003.RAW").write_bytes(raw)
    assert main(["whites", "list", str(camera)]) == 0
    printed = capsys.readouterr()
    assert "SIM1                3      4  440 x 400" in printed.out
    assert "MOD_0003.RAW: found no metadata beside it" in printed.err
    assert main(["whites", "check", str(camera)]) == 4
    printed = capsys.readouterr()
    assert printed.out.count("SIM1") == 1
    assert "is it a dark frame?" in printed.err


def test_nowhere(camera: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["whites", "list", str(camera / "nowhere")]) == 3
    assert "found no such folder" in capsys.readouterr().err
