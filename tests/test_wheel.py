"""The wheel holds one importable name, its data and nothing else."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SIZE_LIMIT_BYTES = 60 * 2**20


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (path,) = out.glob("*.whl")
    assert path.stat().st_size < SIZE_LIMIT_BYTES
    return zipfile.ZipFile(path)


def test_only_one_importable_name(wheel: zipfile.ZipFile) -> None:
    assert {name.split("/")[0] for name in wheel.namelist()} == {"lfstereo", "lfstereo-0.1.0.dist-info"}


def test_every_module_and_asset_is_inside(wheel: zipfile.ZipFile) -> None:
    inside = set(wheel.namelist())
    modules = {str(p.relative_to(ROOT)) for p in (ROOT / "lfstereo").rglob("*.py")}
    assert modules <= inside
    page = {str(p.relative_to(ROOT)) for p in (ROOT / "lfstereo/viewer/page").iterdir()}
    assert page
    assert page <= inside
    for kind in ("calib", "models"):
        files = {f"lfstereo/_assets/{p.relative_to(ROOT)}" for p in (ROOT / kind).rglob("*") if p.is_file()}
        assert files <= inside
        assert files
    assert any(name.endswith("weights.safetensors") for name in inside)
    assert "lfstereo/py.typed" in inside


def test_one_console_script(wheel: zipfile.ZipFile) -> None:
    scripts = wheel.read("lfstereo-0.1.0.dist-info/entry_points.txt").decode()
    assert scripts.split() == ["[console_scripts]", "lfstereo", "=", "lfstereo.cli.main:main"]


def test_extras(wheel: zipfile.ZipFile) -> None:
    metadata = wheel.read("lfstereo-0.1.0.dist-info/METADATA").decode()
    extras = {line.split(": ")[1] for line in metadata.splitlines() if line.startswith("Provides-Extra: ")}
    assert {"cluster", "view", "train"} <= extras
    assert "Requires-Dist: distributed>=2024.8; extra == 'cluster'" in metadata
