"""What is kept between runs: computed once, by one process of many, and again when damaged."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import platformdirs
import pytest

from lfstereo.lenslet.home import cache_folder, library_folder, remembered

PROCESSES = 4
WORKER = """
import os, sys, time
from pathlib import Path
from lfstereo.lenslet.home import remembered
started = Path(sys.argv[1])
def compute():
    (started / str(os.getpid())).touch()
    time.sleep(0.5)
    return {"n": 42}
assert remembered("shared", compute, lambda found: found["n"]) == 42
"""


@pytest.fixture
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


def number(found: Any) -> int:
    return int(found["n"])


def test_platform_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LFSTEREO_HOME")
    assert library_folder() == platformdirs.user_data_path("lfstereo") / "whites"
    assert cache_folder() == platformdirs.user_cache_path("lfstereo")


def test_computed_once(own_home: Path) -> None:
    calls = []

    def compute() -> dict[str, Any]:
        calls.append(1)
        return {"n": len(calls)}

    assert remembered("a", compute, number) == 1
    assert remembered("a", compute, number) == 1
    assert remembered("b", compute, number) == 2


@pytest.mark.parametrize("damage", ["{", "[]", "{}", "\xff", "[" * 200_000, '{"n": "x"}', "7"])
def test_damaged_entry_is_computed_again(own_home: Path, damage: str) -> None:
    remembered("a", lambda: {"n": 1}, number)
    path = own_home / "cache" / "a.json"
    path.write_text(damage, "latin-1")
    assert remembered("a", lambda: {"n": 2}, number) == 2
    assert json.loads(path.read_text()) == {"n": 2}


def test_failure_leaves_nothing(own_home: Path) -> None:
    def fail() -> dict[str, Any]:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        remembered("a", fail, number)
    assert remembered("a", lambda: {"n": 3}, number) == 3


def test_place_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "file" / "home"))
    assert remembered("a", lambda: {"n": 1}, number) == 1


def test_several_processes_compute_once(own_home: Path, tmp_path: Path) -> None:
    started = tmp_path / "started"
    started.mkdir()
    command = [sys.executable, "-c", WORKER, str(started)]
    workers = [subprocess.Popen(command) for _ in range(PROCESSES)]
    assert [worker.wait(60) for worker in workers] == [0] * PROCESSES
    assert len(list(started.iterdir())) == 1
