"""The command ``lfstereo info``."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.container import Capture, write_capture
from lfstereo.container.mosaic_image import read_camera_profile


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """A small Illum picture."""
    metadata = replace(
        read_camera_profile("lytro-illum"), width=48, height=40, serial="B51", firmware="2.0", exposure_s=0.01
    )
    path = tmp_path / "IMG_0001.LFR"
    write_capture(path, Capture(np.full((40, 48), 500, np.uint16), metadata, "test"))
    return path


def test_text(picture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(picture)]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"{picture}: a raw capture of a Lytro ILLUM\n")
    for line in (
        "camera         Lytro, Inc. ILLUM, serial B51 (mark #700d), firmware 2.0",
        "frame          48 x 40 px, 10 bits little-endian, Bayer grbg",
        "levels         black 64 64 64 64, white 1023 1023 1023 1023 (r, gr, gb, b)",
        "exposure       ISO 80, 10 ms, bias +0.000 EV",
        "lens           23.20 mm f/2.19, zoom step -270, focus step 390",
        "pitch 20.00 um (14.2857 px of 1.40 um)",
        "content          16        2400  ok     raw lenslet image",
    ):
        assert line in text


def test_json(picture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(picture), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["metadata"]["lens"]["zoom_step"] == -270
    assert found["sections"][0] == {
        "kind": "content",
        "offset": 16,
        "length": 2400,
        "sha1": found["sections"][0]["sha1"],
        "intact": True,
        "what": "raw lenslet image",
    }


def test_damaged_section_is_shown_and_gives_exit_code_3(picture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = bytearray(picture.read_bytes())
    bad[200] ^= 1
    picture.write_bytes(bad)
    assert main(["info", str(picture)]) == 3
    out, err = capsys.readouterr()
    assert "2400  BAD    raw lenslet image" in out
    assert err.startswith(f"lfstereo info: {picture}: byte 16: found raw lenslet image whose SHA-1 differs")
    assert err.count("\n") == 1


def test_file_that_is_no_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.lfp").write_text("text")
    assert main(["info", str(tmp_path / "a.lfp")]) == 3
    assert "byte 0: found 'text', expected 89 4c" in capsys.readouterr().err


def test_real_files(real_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = real_data / "containers"
    assert main(["info", str(folder / "f01_depth_map.lfp")]) == 0
    assert "no raw lenslet image, so it cannot be decoded" in capsys.readouterr().out
    assert main(["info", str(folder / "f01_raw_truncated.lfp")]) == 3
    assert capsys.readouterr().err.count("\n") == 1
