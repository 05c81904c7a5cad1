"""``lfstereo batch`` from the command line on a simulated session: the real conversion, in real workers."""

from __future__ import annotations

import csv
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfstereo.batch.record import read_record
from lfstereo.cli.main import main
from lfstereo.container import read_capture, write_capture
from lfstereo.container.serials import camera_mark
from lfstereo.depth.pfm import read_pfm

SAME_PX = 0.01
"""Two runs differ by the order of sums in threads at most."""


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Captures of one scene under two names, of a camera without white image, and a truncated one."""
    folder = tmp_path_factory.mktemp("session")
    pair = folder / "captures" / "first"
    assert main(["simulate", "-o", str(pair), "--sensor", "small", "--near-m", "0.8", "--far-m", "1.0"]) == 0
    for name in ("rig.toml", "whites"):
        shutil.move(pair / name, folder / name)
    for number, name in enumerate(("second", "stranger", "truncated")):
        other = folder / "captures" / name
        other.mkdir()
        for side in ("left", "right"):
            capture = read_capture(pair / f"{side}.LFR")
            serial = "B5000000000" if name == "stranger" and side == "left" else capture.metadata.serial
            metadata = replace(capture.metadata, captured_at=f"2015-05-13T05:00:0{number}.000Z", serial=serial)
            write_capture(other / f"{side}.LFR", replace(capture, metadata=metadata))
    os.truncate(folder / "captures" / "truncated" / "right.LFR", 1_000_000)
    return folder


def words(session: Path, out: Path, *more: str) -> list[str]:
    places = ["--rig", str(session / "rig.toml"), "--whites", str(session / "whites"), "-o", str(out)]
    return ["batch", str(session / "captures"), *places, *more]


@pytest.fixture(scope="module")
def converted(session: Path) -> Path:
    out = session / "out"
    assert main(words(session, out, "--truth", "truth", "--workers", "1", "--json")) == 5
    return out


def test_good_pairs_are_converted_and_bad_ones_named(converted: Path) -> None:
    assert {path.name for path in converted.iterdir() if path.is_dir()} == {".batch", "first", "second"}
    entries = read_record(converted).entries
    assert entries["first"].outcome.state == entries["second"].outcome.state == "done"
    assert f"taken by camera {camera_mark('B5000000000')}" in entries["stranger"].outcome.reason
    assert "right.LFR: byte" in entries["truncated"].outcome.reason
    assert set(entries["first"].outcome.inputs) == {"left", "right", "rig", "truth", "white left", "white right"}
    assert not list((converted / ".batch" / "notes").iterdir())


def test_the_same_map_as_a_run(session: Path, converted: Path, tmp_path: Path) -> None:
    pair = session / "captures" / "first"
    places = ["--rig", str(session / "rig.toml"), "--whites", str(session / "whites"), "-o", str(tmp_path / "run")]
    assert main(["run", str(pair / "left.LFR"), str(pair / "right.LFR"), *places]) == 0
    expected, known = read_pfm(tmp_path / "run" / "disparity.pfm")
    for name in ("first", "second"):
        found, found_known = read_pfm(converted / name / "disparity.pfm")
        np.testing.assert_array_equal(found_known, known)
        np.testing.assert_allclose(found[known], expected[known], atol=SAME_PX)


def test_summary(converted: Path) -> None:
    with (converted / "summary.csv").open(newline="") as file:
        table = {row["pair"]: row for row in csv.DictReader(file)}
    assert {name: row["state"] for name, row in table.items()} == {
        "first": "done",
        "second": "done",
        "stranger": "failed",
        "truncated": "failed",
    }
    assert 0 < float(table["first"]["mae_px"]) < 8
    assert table["second"]["mae_px"] == ""
    assert 0 < float(table["first"]["view_difference"]) < 60
    assert "first/thumbnail.jpg" in (converted / "summary.html").read_text()


def test_dry_run_tells_what_is_left(session: Path, converted: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words(session, converted, "--truth", "truth", "--dry-run")) == 0
    printed = capsys.readouterr().out
    assert "4 pairs by folder; of 4 here 2 to do" in printed
    assert "first: first/left.LFR + first/right.LFR: finished" in printed
    assert "truncated/right.LFR: to do (failed before: " in printed
    assert main(words(session, converted, "--truth", "truth", "--dry-run", "--json", "--any-zoom")) == 0
    pairs = json.loads(capsys.readouterr().out)["pairs"]
    assert [pair["why"] for pair in pairs][:2] == ["option any_zoom changed"] * 2


def test_config_file(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "batch.toml"
    config.write_text('[batch]\npair_by = "time"\n[run]\nany_zoom = true\n')
    assert main(words(session, tmp_path / "out", "--dry-run", "--config", str(config))) == 0
    assert "pairs by time" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()
