"""The folder of a simulated session: everything there, read back, reproducible."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container import read_capture
from lfstereo.errors import ConfigError, OutputError
from lfstereo.options import from_mapping
from lfstereo.rig.rig import read_rig
from lfstereo.simulate.folder import write_simulation
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig

OPTIONS = SimulateOptions(sensor="small", samples=1, boards=1, seed=11)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("session") / "pair"
    write_simulation(path, OPTIONS)
    return path


def digests(folder: Path) -> dict[str, str]:
    files = (p for p in sorted(folder.rglob("*")) if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def test_layout(folder: Path) -> None:
    names = set(digests(folder))
    for serial in ("SIM00000001", "SIM00000002"):
        names -= {f"whites/{serial}/{name}" for name in ("MOD_0015.RAW", "MOD_0015.TXT", "HOTPIXEL.BIN")}
    truth = ("disparity.pfm", "depth.tiff", "valid.png", "occlusion.png", "centre_left.png", "centre_right.png")
    names -= {f"truth/{name}" for name in truth}
    names -= {"boards/00_left.LFR", "boards/00_right.LFR", "boards/poses.toml", "boards/target.toml"}
    assert names == {"left.LFR", "right.LFR", "rig.toml", "simulation.toml"}


def test_captures_read_back(folder: Path) -> None:
    for side, serial in (("left", "SIM00000001"), ("right", "SIM00000002")):
        picture = read_capture(folder / f"{side}.LFR")
        white = read_capture(folder / "whites" / serial / "MOD_0015.RAW")
        for capture in (picture, white):
            assert capture.mosaic.shape == (1074, 1546)
            assert capture.metadata.serial == serial
            assert capture.metadata.bayer == "grbg"
        assert white.metadata.is_white_image
        assert not picture.metadata.is_white_image
        assert picture.metadata.lens.zoom_step == white.metadata.lens.zoom_step
        assert white.metadata.normalized_responses[0] < 1
        assert 100 < np.median(picture.mosaic) < 600, "well exposed"
        assert np.mean(picture.mosaic >= 1023) < 0.001
        assert np.mean(white.mosaic >= 1023) < 0.001


def test_rig_and_options_read_back(folder: Path) -> None:
    assert read_rig(folder / "rig.toml") == build_rig(OPTIONS).stereo
    table = tomllib.loads((folder / "simulation.toml").read_text("utf-8"))["simulate"]
    assert from_mapping(SimulateOptions, table, "simulation.toml") == OPTIONS
    poses = tomllib.loads((folder / "boards" / "poses.toml").read_text("utf-8"))
    assert poses["corners"] == [7, 6]
    assert poses["shot"][0]["left"] == "00_left.LFR"


def test_hot_pixel_list(folder: Path) -> None:
    data = (folder / "whites" / "SIM00000001" / "HOTPIXEL.BIN").read_bytes()
    count = int.from_bytes(data[:4], "little")
    x, y = np.frombuffer(data[4:], "<u2").reshape(2, count)
    assert count == OPTIONS.hot_pixels
    white = read_capture(folder / "whites" / "SIM00000001" / "MOD_0015.RAW").mosaic
    around = (white[y.clip(2) - 2, x].astype(int) + white[(y + 2).clip(max=1073), x]) / 2
    assert np.median(white[y, x] - around) > 40


def test_same_seed_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    write_simulation(tmp_path / "again", OPTIONS)
    assert digests(tmp_path / "again") == digests(folder)


def test_existing_folder_is_kept(folder: Path) -> None:
    before = digests(folder)
    with pytest.raises(OutputError, match="exists already"):
        write_simulation(folder, OPTIONS)
    assert digests(folder) == before


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"near_m": 1.0, "far_m": 0.9}, "far_m = 0.9, expected more than near_m"),
        ({"baseline_m": 0.0}, "baseline_m = 0.0, expected a positive number"),
        ({"focal_length_m": 0.4}, "focal_length_m = 0.4, expected under half of near_m"),
        ({"focus_m": 0.03}, "focus_m = 0.03, expected over twice the focal length"),
        ({"f_number": 1.4}, "f_number = 1.4, expected 1.8 or more"),
        ({"samples": 5000}, "samples = 5000, expected at most 1024"),
        ({"boards": 100}, "boards = 100, expected at most 99"),
        ({"read_noise_dn": -1.0}, "read_noise_dn = -1.0, expected zero or more"),
        ({"distortion_k1": 0.7}, "distortion_k1 = 0.7, expected -0.5 to 0.5"),
        ({"board_square_m": 0.0}, "board_square_m = 0.0, expected a positive number"),
        ({"sensor": "huge"}, "sensor = 'huge'"),
    ],
)
def test_impossible_options_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        from_mapping(SimulateOptions, values, "test")
