"""The record: what was written is read again, whatever a power cut left of its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfstereo.batch.jobs import Outcome
from lfstereo.batch.record import append, read_record, record_path
from lfstereo.batch.stamps import FileStamp
from lfstereo.errors import OutputError

DONE = Outcome(
    "a",
    "done",
    inputs={"left": FileStamp("/x", 7, 8, "9")},
    weights_sha256="w",
    figures={"valid_share": 0.5},
    seconds={"decode left": 1.5},
    peak_gib=2.0,
    attempt=2,
    workers=("host:1",),
)


def test_round_trip(tmp_path: Path) -> None:
    path = record_path(tmp_path, (1, 1))
    append(path, DONE, "f", {"slices": 16}, "0.1.0")
    entry = read_record(tmp_path).entries["a"]
    assert entry.outcome == DONE
    assert (entry.fingerprint, entry.options, entry.program) == ("f", {"slices": 16}, "0.1.0")


def test_the_latest_line_counts_over_all_shards(tmp_path: Path) -> None:
    append(record_path(tmp_path, (1, 2)), DONE, "f", {}, "")
    append(record_path(tmp_path, (2, 2)), Outcome("a", "failed", "cut off"), "", {}, "")
    append(record_path(tmp_path, (1, 2)), Outcome("b", "failed", "gone"), "", {}, "")
    entries = read_record(tmp_path).entries
    assert {name: entry.outcome.state for name, entry in entries.items()} == {"a": "failed", "b": "failed"}
    append(record_path(tmp_path, (1, 2)), DONE, "f", {}, "")
    assert read_record(tmp_path).entries["a"].outcome.state == "done"


@pytest.mark.parametrize("kept", [1, 40, -1])
def test_torn_line_is_passed_over_and_closed(tmp_path: Path, kept: int) -> None:
    path = record_path(tmp_path, (1, 1))
    append(path, DONE, "f", {}, "")
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:kept].replace(b'"a"', b'"b"'))
    torn = read_record(tmp_path)
    assert set(torn.entries) | {"b"} == {"a", "b"}
    append(path, Outcome("c", "failed", "gone"), "", {}, "")
    found = read_record(tmp_path)
    assert {"a", "c"} <= set(found.entries)
    assert found.torn_lines == (0 if kept == -1 else 1)


def test_place_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"record\.jsonl: cannot be written \(No such file"):
        append(record_path(tmp_path / "gone", (1, 1)), DONE, "f", {}, "")


def test_record_that_cannot_be_read(tmp_path: Path) -> None:
    record_path(tmp_path, (1, 1)).mkdir()
    with pytest.raises(OutputError, match="cannot be read"):
        read_record(tmp_path)
