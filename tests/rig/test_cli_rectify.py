"""``lfstereo rectify``: the toolbox's calibration file in, the toolbox's rectification out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import read_light_field, write_light_field
from lfstereo.rig.lftoolbox import ToolboxIntrinsics, rectify_as_lftoolbox
from lfstereo.rig.lftoolbox_file import read_calibration

MATRIX = np.diag([6e-4, 6.2e-4, 0.011, 0.0114, 1.0])
MATRIX[:4, 4] = -MATRIX[:4, :4] @ [2, 2, 6.3, 4.1]
DISTORTION = [0.3, -0.1, 0.0, 0.004, -0.002]


def calibration(folder: Path, **changes: object) -> Path:
    path = folder / "CalInfo.json"
    table = {"EstCamIntrinsicsH": MATRIX.tolist(), "EstCamDistortionV": DISTORTION, "Phase": "Refine"}
    path.write_text(json.dumps(table | changes))
    return path


def test_rectifies_as_the_toolbox_does(tmp_path: Path) -> None:
    views = np.random.default_rng(0).random((3, 3, 8, 12, 3), dtype=np.float32)
    field = LightField(views, np.full((3, 3, 8, 12), 200, np.uint8), None, "A1", "random")
    write_light_field(tmp_path / "in.h5", field)
    words = ["rectify", str(tmp_path / "in.h5"), "--calibration", str(calibration(tmp_path))]
    assert main([*words, "-o", str(tmp_path / "out.h5")]) == 0
    expected = rectify_as_lftoolbox(field, ToolboxIntrinsics(MATRIX, np.array(DISTORTION)))
    found = read_light_field(tmp_path / "out.h5")
    np.testing.assert_allclose(found.views, expected.views, atol=1e-3)
    assert not np.allclose(found.views, views, atol=1e-2)
    assert main([*words, "-o", str(tmp_path / "out.h5")]) == 3


def test_says_what_is_wrong_with_the_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"CalInfo\.json: cannot be read"):
        read_calibration(tmp_path / "CalInfo.json")
    path = calibration(tmp_path, EstCamDistortionV="none")
    with pytest.raises(ConfigError, match="found no EstCamIntrinsicsH and EstCamDistortionV of numbers"):
        read_calibration(path)
    path.write_text("{}")
    with pytest.raises(ConfigError, match="expected the toolbox's CalInfo"):
        read_calibration(path)


def test_reads_a_published_calibration(real_data: Path) -> None:
    found = read_calibration(real_data / "raw/jaramillo_f01/CalSamples/CalInfo.json")
    assert found.matrix[2, 2] == pytest.approx(0.001884420936)
    assert found.distortion[0] == pytest.approx(0.1807141378)
