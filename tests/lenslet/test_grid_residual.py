"""The residual of a grid: known displacements are found again, and drawn."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.container import Capture, write_capture
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.residual import GridResidual, draw_residual, measure_residual, residual_field


@pytest.fixture(scope="module")
def white(draw_frame: Callable[..., Any]) -> Capture:
    found: Capture = draw_frame(noise=0.5).capture
    return found


def test_shifted_grid_shows_the_shift(white: Capture) -> None:
    grid = fit_grid(white)
    assert measure_residual(white, grid).rms_px() < 0.02
    x, y = grid.origin_px
    shifted = measure_residual(white, replace(grid, origin_px=(x - 0.2, y + 0.1)))
    assert shifted.found.all()
    assert np.median(shifted.displacement, axis=0) == pytest.approx([0.2, -0.1], abs=0.02)
    assert shifted.rms_px() == pytest.approx(np.hypot(0.2, 0.1), abs=0.02)


def test_field_is_the_median_of_each_cell() -> None:
    centres = np.array([[5.0, 5.0], [6.0, 5.0], [7.0, 5.0], [25.0, 15.0], [26.0, 15.0]])
    displacement = np.array([[0.1, 0.0], [0.2, 0.0], [9.0, 0.0], [0.0, -0.3], [50.0, 50.0]])
    found = np.array([True, True, True, True, False])
    field, known = residual_field(GridResidual(centres, displacement, found, np.zeros(5)), (20, 30), 10.0)
    assert known.tolist() == [[True, False, False], [False, False, True]]
    assert field[0, 0].tolist() == pytest.approx([0.2, 0.0])
    assert field[1, 2].tolist() == pytest.approx([0.0, -0.3])


def test_zones_without_lenslets_count_nothing() -> None:
    residual = GridResidual(
        np.zeros((2, 2)), np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([True, True]), np.array([0.1, 0.9])
    )
    assert residual.rms_px(0, 0.5) == pytest.approx(5.0)
    assert residual.rms_px(0.2, 0.3) == 0.0


def test_command_writes_picture_and_numbers(tmp_path: Path, white: Capture, capsys: pytest.CaptureFixture[str]) -> None:
    write_capture(tmp_path / "MOD_0001.RAW", white)
    words = ["view-grid", str(tmp_path / "MOD_0001.RAW"), "-o", str(tmp_path / "grid.png")]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["grid_from"] == "white image"
    assert found["pitch_px"] == pytest.approx(14.3, abs=2e-3)
    assert found["row_distance_px"] == pytest.approx(14.3 * 3**0.5 / 2, abs=2e-3)
    assert found["rotation_rad"] == pytest.approx(0.002, abs=2e-4)
    assert found["rms_px"] < 0.02 and found["share_found"] == 1
    picture = cv2.imread(str(tmp_path / "grid.png"))
    assert picture.shape[1] == 5 * (5 * 60 + 4)
    assert main(words) == 3
    assert main([*words, "--force"]) == 0
    assert "RMS of " in capsys.readouterr().out


def test_map_of_an_ideal_grid(white: Capture) -> None:
    grid = fit_grid(white)
    picture = draw_residual(measure_residual(white, grid), grid, 900)
    assert picture.shape[1:] == (900, 3) and picture.dtype == np.uint8
