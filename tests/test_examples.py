"""Every example runs as a user would run it, and prints what it should."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
DISPARITY_PX, RADIUS_CM = 1.0, 0.02


def run_example(name: str, *arguments: Path | str) -> str:
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


def nine_views(folder: Path) -> None:
    """A slanted wall seen from nine places; disparity 4 to 12 px over four steps, stored times 8."""
    rng = np.random.default_rng(0)
    rows, columns = 80, 160
    dots = cv2.GaussianBlur(rng.integers(0, 256, (rows, columns + 60, 3)).astype(np.uint8), (0, 0), 0.8)
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    per_px, at_zero = 8.0 / columns / 4, 1.0  # slope, px per step, of view 2's column
    for n in range(9):
        # A column c of view 2 is seen in view n at c - (n - 2) slope(c), with slope(c) = per_px c + at_zero.
        column = (x + (n - 2) * at_zero) / (1 - (n - 2) * per_px)
        picture = cv2.remap(dots, column + 20, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        cv2.imwrite(str(folder / f"im{n}.ppm"), picture)
    cv2.imwrite(str(folder / "disp2.pgm"), np.rint(8 * 4 * (per_px * x + at_zero)).astype(np.uint8))


def test_multiview_stereo(tmp_path: Path) -> None:
    nine_views(tmp_path)
    picture = tmp_path / "maps.png"
    printed = run_example("multiview_stereo.py", tmp_path, "--near", "16", "--model", "none", "-o", picture)
    assert numbers_after("SGBM, holes filled", printed)[0] < 0.4  # px, with an eighth of a px in the truth itself
    assert numbers_after("SGBM + WLS", printed)[0] < 0.4
    assert picture.is_file()


@pytest.mark.parametrize("scene", ["Venus", "bull"])
def test_multiview_stereo_of_photographs(real_data: Path, scene: str) -> None:
    folder = real_data / "stereo" / "mb2001_multiview" / scene
    printed = run_example("multiview_stereo.py", folder, "--model", "none")
    assert numbers_after("SGBM + WLS", printed)[0] < 0.4  # px
