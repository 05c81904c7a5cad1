"""Captures into pairs: what is certain is paired, everything else is listed with its reason."""

from __future__ import annotations

import shutil
import zlib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from lfstereo.assets import asset_folder
from lfstereo.batch.captures import list_captures
from lfstereo.batch.options import BatchOptions
from lfstereo.batch.pairing import Pairing, pair_captures
from lfstereo.container import Capture, write_capture
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.errors import ConfigError, InputError
from lfstereo.rig.rig import StereoRig, read_rig

START = datetime(2015, 5, 13, 4, 46, tzinfo=UTC)
LEFT, RIGHT = "SIM00000001", "SIM00000002"
CLOCK_S = 73.25
"""The right camera's clock is ahead by this."""
CLOCK_TOLERANCE_S = 0.06


@pytest.fixture(scope="module")
def rig() -> StereoRig:
    found = read_rig(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml")
    return replace(found, left=replace(found.left, serial=LEFT), right=replace(found.right, serial=RIGHT))


def shoot(path: Path, serial: str, taken_s: float | None, white: bool = False) -> None:
    """Write a small capture; its pixels follow from its name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    moment = "" if taken_s is None else (START + timedelta(seconds=taken_s)).isoformat(timespec="milliseconds")
    metadata = replace(
        read_camera_profile("lytro-illum"),
        width=8,
        height=8,
        serial=serial,
        captured_at=moment.replace("+00:00", "Z"),
        is_white_image=white,
        is_dark_frame=False,
    )
    pixels = np.random.default_rng(zlib.crc32(path.name.encode())).integers(0, 1024, (8, 8), np.uint16)
    write_capture(path, Capture(pixels, metadata, "test"))


def paired(folder: Path, rig: StereoRig, **options: object) -> Pairing:
    return pair_captures(list_captures(folder), rig, BatchOptions(**options))  # type: ignore[arg-type]


def names(pairing: Pairing) -> dict[str, tuple[str, str]]:
    return {p.name: (p.left.place.as_posix(), p.right.place.as_posix()) for p in pairing.pairs}


def leftover(pairing: Pairing) -> dict[str, tuple[str, str]]:
    return {c.place.as_posix(): (item.kind, item.reason) for item in pairing.leftovers for c in item.captures}


def test_one_folder_per_scene(tmp_path: Path, rig: StereoRig) -> None:
    shoot(tmp_path / "a" / "IMG_1.LFR", RIGHT, 0.0)
    shoot(tmp_path / "a" / "IMG_2.LFR", LEFT, 0.0)
    shoot(tmp_path / "b" / "c" / "left.LFR", "", 5.0)
    shoot(tmp_path / "b" / "c" / "right.LFR", "", 5.0)
    shoot(tmp_path / "lonely" / "left.LFR", LEFT, 9.0)
    for n in range(3):
        shoot(tmp_path / "three" / f"{n}.LFR", LEFT, 20.0 + n)
    shoot(tmp_path / "contrary" / "left.LFR", RIGHT, 30.0)
    shoot(tmp_path / "contrary" / "right.LFR", LEFT, 30.0)
    shoot(tmp_path / "a" / "MOD_0001.RAW", LEFT, 0.0, white=True)
    found = paired(tmp_path, rig, pair_by="folder")
    assert names(found) == {"a": ("a/IMG_2.LFR", "a/IMG_1.LFR"), "b__c": ("b/c/left.LFR", "b/c/right.LFR")}
    left = leftover(found)
    assert left["lonely/left.LFR"][0] == "unpaired"
    assert left["three/1.LFR"] == ("ambiguous", "3 captures in one folder, expected 2")
    assert left["contrary/left.LFR"][0] == "ambiguous"
    assert len(left) == 6


def test_names(tmp_path: Path, rig: StereoRig) -> None:
    for scene in ("one", "two"):
        shoot(tmp_path / f"{scene}_L.LFR", LEFT, 0.0)
        shoot(tmp_path / f"{scene}_R.LFR", RIGHT, 0.0)
    shoot(tmp_path / "three_left.lfp", LEFT, 1.0)
    shoot(tmp_path / "IMG_0007.LFR", LEFT, 2.0)
    found = paired(tmp_path, rig)
    assert found.way == "name"
    assert names(found) == {"one": ("one_L.LFR", "one_R.LFR"), "two": ("two_L.LFR", "two_R.LFR")}
    assert leftover(found) == {
        "three_left.lfp": ("unpaired", "its other side is missing"),
        "IMG_0007.LFR": ("unpaired", "its name does not fit the pattern"),
    }


def test_one_folder_per_camera_by_pattern(tmp_path: Path, rig: StereoRig) -> None:
    for side in ("LEFT", "RIGHT"):
        for n in (1, 2):
            shoot(tmp_path / "day" / side / f"IMG_{n}.LFR", {"LEFT": LEFT, "RIGHT": RIGHT}[side], float(n))
    shoot(tmp_path / "day" / "LEFT" / "IMG_2.RAW", LEFT, 2.5)
    found = paired(tmp_path, rig, pattern="{side}/{scene}.LFR")
    assert names(found) == {"day__IMG_1": ("day/LEFT/IMG_1.LFR", "day/RIGHT/IMG_1.LFR")}
    assert leftover(found)["day/RIGHT/IMG_2.LFR"] == (
        "ambiguous",
        "2 left and 1 right captures of scene 'day/IMG_2', expected one each",
    )


@pytest.mark.parametrize("pattern", ["{scene}", "{side}_{side}", "{scene}{scene}_{side}"])
def test_pattern_that_says_nothing(tmp_path: Path, rig: StereoRig, pattern: str) -> None:
    with pytest.raises(ConfigError, match=r"expected \{side\} once"):
        paired(tmp_path, rig, pattern=pattern)


def test_serial_and_time_with_a_clock_that_is_wrong(tmp_path: Path, rig: StereoRig) -> None:
    moments = [0.0, 11.0, 48.0, 97.5, 180.0, 181.0]
    jitter = [0.02, -0.03, 0.0, 0.04, 0.01, -0.01]
    for n, (moment, off) in enumerate(zip(moments, jitter, strict=True)):
        shoot(tmp_path / "L" / f"IMG_{n}.LFR", LEFT, moment)
        shoot(tmp_path / "R" / f"IMG_{n + 40}.LFR", RIGHT, moment + CLOCK_S + off)
    shoot(tmp_path / "L" / "IMG_9.LFR", LEFT, 300.0)
    shoot(tmp_path / "L" / "IMG_10.LFR", "OTHER", 300.0)
    shoot(tmp_path / "R" / "IMG_60.LFR", RIGHT, None)
    (tmp_path / "R" / "IMG_70.LFR").write_bytes(b"\x89LFP\r\n\x1a\n cut")
    found = paired(tmp_path, rig, pair_by="time")
    assert {p.left.place.stem: p.right.place.stem for p in found.pairs} == {
        f"IMG_{n}": f"IMG_{n + 40}" for n in range(4)
    }
    assert found.clock is not None
    assert found.clock.offset_s == pytest.approx(CLOCK_S, abs=CLOCK_TOLERANCE_S)
    assert found.clock.spread_s < 2 * CLOCK_TOLERANCE_S
    left = leftover(found)
    assert {left[f"L/IMG_{n}.LFR"][0] for n in (4, 5)} == {"ambiguous"}, "one second apart, within the tolerance of two"
    assert left["L/IMG_9.LFR"][1] == "no capture of the other camera within 2 s, clocks +73.3 s apart"
    assert "taken by camera #1e8b" in left["L/IMG_10.LFR"][1]
    assert left["R/IMG_60.LFR"][1] == "its metadata tell no capture time"
    assert left["R/IMG_70.LFR"][0] == "unreadable"


def test_the_same_exposure_twice_is_used_once(tmp_path: Path, rig: StereoRig) -> None:
    shoot(tmp_path / "a" / "left.LFR", LEFT, 0.0)
    shoot(tmp_path / "a" / "right.LFR", RIGHT, 0.0)
    shutil.copytree(tmp_path / "a", tmp_path / "a copy")
    found = paired(tmp_path, rig)
    assert list(names(found)) == ["a"]
    assert leftover(found)["a copy/left.LFR"] == ("duplicate", "the same exposure as a/left.LFR, which is used")


def test_unreadable_capture_is_paired_by_folder(tmp_path: Path, rig: StereoRig) -> None:
    shoot(tmp_path / "a" / "left.LFR", LEFT, 0.0)
    (tmp_path / "a" / "right.LFR").write_bytes(b"nothing")
    (pair,) = paired(tmp_path, rig).pairs
    assert "this is no Lytro container" in pair.right.problem


def test_no_such_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found no such folder"):
        list_captures(tmp_path / "none")


def test_two_pairs_of_one_name(tmp_path: Path, rig: StereoRig) -> None:
    for folder in ("a/b", "a__b"):
        shoot(tmp_path / folder / "left.LFR", LEFT, 0.0 if "/" in folder else 1.0)
        shoot(tmp_path / folder / "right.LFR", RIGHT, 0.0 if "/" in folder else 1.0)
    with pytest.raises(ConfigError, match="two of them would be called"):
        paired(tmp_path, rig, pair_by="folder")
