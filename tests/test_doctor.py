"""Every check of the installation finds what was broken on purpose."""

from __future__ import annotations

import importlib.metadata
import json
import platform
import shutil
import sys
from pathlib import Path

import pytest

from lfstereo import doctor
from lfstereo.assets import asset_folder
from lfstereo.cli.main import main
from lfstereo.errors import AssetError


def states(findings: list[doctor.Finding]) -> list[str]:
    assert all(finding.to_do for finding in findings if finding.state != "ok")
    return [finding.state for finding in findings]


def test_command_says_ready(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["doctor", "--json", "-o", str(tmp_path / "not" / "yet")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ready"]
    assert {"python", "numpy", "torch", "weights binocular-v3", "cache", "ffmpeg", "disk"} <= {
        finding["name"] for finding in told["findings"]
    }


def test_command_says_what_is_wrong(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = [doctor.Finding("numpy", "wrong", "1.0", "run 'pip install numpy'")]
    monkeypatch.setattr(doctor, "check_installation", lambda output: wrong)
    assert main(["doctor"]) == 3
    told = capsys.readouterr().out
    assert "-> run 'pip install numpy'" in told
    assert "1 of 1 wrong" in told


def test_python(monkeypatch: pytest.MonkeyPatch) -> None:
    assert states(doctor.check_python()) == ["ok"]
    monkeypatch.setattr(platform, "python_version_tuple", lambda: ("3", "9", "1"))
    assert states(doctor.check_python()) == ["wrong"]


def test_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    needed = ["numpy>=1", "numpy>=99", "no-such-package>=1", 'no-such-extra; extra == "x"']
    monkeypatch.setattr(importlib.metadata, "requires", lambda name: needed)
    findings = doctor.check_packages()
    assert states(findings) == ["ok", "wrong", "wrong"]
    assert findings[1].to_do == "run 'pip install \"numpy>=99\"'"


def test_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> list[str]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "requires", missing)
    assert states(doctor.check_packages()) == ["wrong"]


def test_packages_without_packaging(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "packaging.requirements", None)
    assert doctor.check_packages()[0].to_do == "run 'pip install packaging'"


def test_weights(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, damage in (("good", None), ("changed", b"x"), ("gone", b"")):
        shutil.copytree(asset_folder("models") / "binocular-v3", tmp_path / name)
        weights = tmp_path / name / "weights.safetensors"
        if damage == b"":
            weights.unlink()
        elif damage:
            weights.write_bytes(weights.read_bytes() + damage)
    monkeypatch.setattr(doctor, "asset_folder", lambda kind: tmp_path)
    assert [(f.name, f.state) for f in doctor.check_weights()] == [
        ("weights changed", "wrong"),
        ("weights gone", "wrong"),
        ("weights good", "ok"),
    ]


def test_no_weights(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doctor, "asset_folder", lambda kind: tmp_path)
    assert states(doctor.check_weights()) == ["wrong"]

    def missing(kind: str) -> Path:
        raise AssetError("missing")

    monkeypatch.setattr(doctor, "asset_folder", missing)
    assert states(doctor.check_weights()) == ["wrong"]


def test_cache_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "home"))
    assert states(doctor.check_cache()) == ["ok", "ok"]
    (tmp_path / "file").touch()
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "file"))
    assert states(doctor.check_cache()) == ["advice", "advice"]


def test_torch_that_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lfstereo.network.device_check", None)
    assert states(doctor.check_graphics_card()) == ["wrong"]


def test_no_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    assert states(doctor.check_ffmpeg()) == ["ok"]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert states(doctor.check_ffmpeg()) == ["advice"]


def test_little_room(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doctor, "MEMORY_GIB", 1e9)
    monkeypatch.setattr(doctor, "DISK_GIB", 1e9)
    assert states(doctor.check_disk(tmp_path / "a" / "b")) == ["advice"]
    if Path("/proc/meminfo").is_file():
        assert states(doctor.check_memory()) == ["advice"]
    monkeypatch.setattr(doctor, "_available_bytes", lambda: 0)
    assert states(doctor.check_memory()) == ["ok"]
