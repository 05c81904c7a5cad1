"""Every example runs as a user would run it, and prints what it should."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
DATA = os.environ.get("LFSTEREO_DATA", "")
DISPARITY_PX, RADIUS_CM = 1.0, 0.02


def run_example(name: str, *arguments: Path) -> str:
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent), "PYTHONWARNINGS": "error"}
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers_after(word: str, text: str) -> list[float]:
    line = next(line for line in text.splitlines() if word in line)
    return [float(n) for n in re.findall(r"-?\d+\.\d+", line[line.index(word) :])]


def test_every_example_is_tested() -> None:
    here = Path(__file__).read_text("utf-8")
    assert [p.name for p in sorted(EXAMPLES.glob("*.py")) if f'"{p.name}"' not in here] == []


def test_refocus_light_field(tmp_path: Path) -> None:
    printed = run_example("refocus_light_field.py", tmp_path)
    assert numbers_after("disc: found", printed)[0] == pytest.approx(50.0, abs=DISPARITY_PX)
    assert numbers_after("wall: found", printed)[0] == pytest.approx(0.0, abs=DISPARITY_PX)
    assert len(list(tmp_path.glob("slice_*.png"))) == 11
    assert (tmp_path / "all_in_focus.png").is_file() and (tmp_path / "disparity.png").is_file()


def test_depth_from_disparity(tmp_path: Path) -> None:
    printed = run_example("depth_from_disparity.py", tmp_path)
    assert numbers_after("ball radius", printed)[0] == pytest.approx(8.0, abs=RADIUS_CM)
    assert {p.name for p in tmp_path.iterdir()} == {"disparity.pfm", "points.ply", "disparity_colour.png"}
