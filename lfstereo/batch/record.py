"""The record of a batch: one JSON line per pair that ended, in a file that a person can read.

A line is written whole and brought to the disk before the pair counts as done. A line that a power cut tore is passed
over, so its pair is done again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from lfstereo.batch.jobs import Outcome, outcome_from, values_of
from lfstereo.errors import OutputError

RECORD = "record.jsonl"


@dataclass(frozen=True, slots=True)
class Entry:
    """What the record says about one pair."""

    outcome: Outcome
    fingerprint: str
    """Of a finished pair; see :func:`lfstereo.batch.stamps.fingerprint`."""
    written: str
    """UTC time of the line."""
    options: dict[str, Any] = field(default_factory=dict)
    program: str = ""
    """Version of lfstereo."""


@dataclass(frozen=True, slots=True)
class Record:
    """All that the record files of an output folder say."""

    entries: dict[str, Entry]
    """The latest of each pair, by name."""
    torn_lines: int
    """Lines that cannot be read."""


def record_path(output: Path, shard: tuple[int, int]) -> Path:
    """Return the record file of a batch; each shard writes its own."""
    part, parts = shard
    return output / (RECORD if parts == 1 else f"record.{part}-of-{parts}.jsonl")


def read_record(output: Path) -> Record:
    """Read all record files of an output folder; the latest line of a pair counts.

    Raises
    ------
    OutputError
        If a record exists but cannot be read.
    """
    entries: dict[str, Entry] = {}
    torn = 0
    for path in sorted(output.glob("record*.jsonl")):
        try:
            lines = path.read_bytes().splitlines()
        except OSError as error:
            raise OutputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
        for line in lines:
            try:
                entry = _parsed(json.loads(line)) if line.strip() else None
            except (ValueError, KeyError, TypeError, AttributeError):
                torn += 1
                continue
            before = entries.get(entry.outcome.name) if entry else None
            if entry and (before is None or before.written <= entry.written):
                entries[entry.outcome.name] = entry
    return Record(entries, torn)


def append(path: Path, outcome: Outcome, fingerprint: str, options: Mapping[str, Any], program: str) -> None:
    """Add one line and bring it to the disk.

    Raises
    ------
    OutputError
        If it cannot be written; nothing but a torn line, which is passed over, is left then.
    """
    values = {"pair": outcome.name, "state": outcome.state, "written": datetime.now(UTC).isoformat()}
    rest = {name: value for name, value in values_of(outcome).items() if name not in ("name", "state")}
    extra = {"fingerprint": fingerprint, "options": dict(options), "program": program}
    line = json.dumps(values | rest | {name: value for name, value in extra.items() if value}) + "\n"
    try:
        with path.open("ab+") as file:
            if file.tell() and not _ends_with_newline(file):
                line = "\n" + line
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror}); free some space and start again") from error


def _ends_with_newline(file: Any) -> bool:
    file.seek(-1, os.SEEK_END)
    return bool(file.read(1) == b"\n")


def _parsed(line: dict[str, Any]) -> Entry:
    own: dict[str, Any] = {
        name: line[name] for name in ("written", "fingerprint", "options", "program") if name in line
    }
    return Entry(outcome_from(line | {"name": str(line["pair"])}), **{"fingerprint": "", **own})
