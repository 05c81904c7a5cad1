"""Marks that stand for cameras, and light fields that are told apart by them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfstereo.assets import asset_folder
from lfstereo.cli.main import main
from lfstereo.container import Capture, write_capture
from lfstereo.container.dng import read_dng
from lfstereo.container.serials import camera_mark, same_camera
from lfstereo.rig.match import side_of
from lfstereo.rig.rig import read_rig, without_serials


def test_marks_tell_cameras_apart_but_do_not_tell_which_they_are() -> None:
    serials = [f"B51{number:08d}" for number in range(3000)]
    marks = {camera_mark(serial) for serial in serials}
    assert all(mark.startswith("#") and len(mark) == 5 for mark in marks)
    # 3000 of 65536 places: some 67 meet another one by chance.
    assert 2870 < len(marks) < 2990


def test_same_camera_by_serial_by_mark_and_by_nothing() -> None:
    one, other = "B5100000001", "B5100000002"
    for first in (one, camera_mark(one)):
        for second in (one, camera_mark(one)):
            assert same_camera(first, second)
        for second in (other, camera_mark(other)):
            assert not same_camera(first, second)
    assert same_camera("", other) and same_camera(one, "")


def test_a_rig_of_marks_still_knows_its_sides() -> None:
    rig = read_rig(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml")
    marked = without_serials(rig)
    assert (marked.left.serial, marked.right.serial) == (camera_mark(rig.left.serial), camera_mark(rig.right.serial))
    for known in (rig, marked):
        assert side_of(rig.left.serial, known) == "left"
        assert side_of(camera_mark(rig.right.serial), known) == "right"
        assert side_of("B99", known) is None and side_of("", known) is None
    assert side_of(rig.left.serial, replace(rig, right=rig.left)) is None


@pytest.mark.parametrize("keep", [False, True])
def test_exported_dng_carries_the_serial_number_only_if_asked(
    tmp_path: Path, illum_capture: Capture, keep: bool
) -> None:
    write_capture(tmp_path / "a.LFR", illum_capture)
    words = ["export", str(tmp_path / "a.LFR"), "-o", str(tmp_path / "a.dng")]
    assert main([*words, *(["--keep-serials"] if keep else [])]) == 0
    serial = illum_capture.metadata.serial
    assert (serial.encode() in (tmp_path / "a.dng").read_bytes()) is keep
    assert same_camera(read_dng(tmp_path / "a.dng").metadata.serial, serial)
