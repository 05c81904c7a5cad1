"""Rigs in other programs' files: the same points at the same px, and what is wrong is said."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lfstereo.cli.main import main
from lfstereo.errors import ConfigError, RigError
from lfstereo.rig.distortion import distort
from lfstereo.rig.interchange import PlenopticPart, choose_format, export_rig, import_rig
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig, write_rig

LEFT = PlenopticCamera(
    "A1", (7728, 5368), (14630.5, 14634.25), (3860.0, 2690.5), 0.85, 7.1e-4, (-0.12, 0.05, 0.02, 0.004, -0.003)
)
RIGHT = dataclasses.replace(LEFT, serial="B2", focal_px=(14700.0, 14690.0), distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
RIG = StereoRig(LEFT, RIGHT, (0.002, 0.11, 0.001), (-0.0947, 0.001, 0.0052), 0.6, 1.2, 12.372)
PART = PlenopticPart((0.85, 0.85), (7.1e-4, 7.1e-4), 0.6, 1.2, 12.372, 1.0, "A1", "B2")
x, y = np.meshgrid(np.linspace(-0.1, 0.2, 7), np.linspace(-0.12, 0.12, 5))
POINTS = np.stack([x, y, 0.9 + 0.3 * x], axis=-1).reshape(-1, 3)


def seen(camera: PlenopticCamera, points: np.ndarray) -> np.ndarray:
    bent = distort(points[:, 0] / points[:, 2], points[:, 1] / points[:, 2], np.asarray(camera.distortion))
    return np.stack([bent.x, bent.y], axis=1) * camera.focal_px + camera.principal_px


def seen_by_both(rig: StereoRig) -> np.ndarray:
    return np.stack([seen(rig.left, POINTS), seen(rig.right, POINTS @ rig.right_from_left.T + rig.translation_m)])


def seen_by_opencv(
    matrices: list[np.ndarray], bends: list[np.ndarray], turn: np.ndarray, move: np.ndarray
) -> np.ndarray:
    first, _ = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), matrices[0], bends[0])
    second, _ = cv2.projectPoints(POINTS, cv2.Rodrigues(turn)[0], move, matrices[1], bends[1])
    return np.stack([first[:, 0], second[:, 0]])


def test_opencv_sees_the_same(tmp_path: Path) -> None:
    path = tmp_path / "rig.yml"
    export_rig(path, RIG, "opencv")
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    read = {name: file.getNode(name).mat() for name in ("M1", "D1", "M2", "D2", "R", "T")}
    found = seen_by_opencv([read["M1"], read["M2"]], [read["D1"], read["D2"]], read["R"], read["T"])
    assert np.abs(found - seen_by_both(RIG))[0].max() < 0.1, "sensor px; a displaced centre as tangential terms"
    assert np.abs(found - seen_by_both(RIG))[1].max() < 1e-6, "nothing displaced: the same model"
    np.testing.assert_allclose(read["M2"][0, 0], 14700.0, rtol=1e-12)


def test_back_from_opencv(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    export_rig(path, RIG, "opencv")
    back = import_rig(path, PART)
    assert np.abs(seen_by_both(back) - seen_by_both(RIG)).max() < 0.1
    assert back.right.distortion == pytest.approx(RIG.right.distortion, abs=1e-12)
    assert back.translation_m == pytest.approx(RIG.translation_m, abs=1e-15)
    assert back.rotation_rad == pytest.approx(RIG.rotation_rad, abs=1e-12)
    assert (back.left.serial, back.near_m, back.right.focus_distance_m) == ("A1", 0.6, 0.85)


def test_kalibr_sees_the_same(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    export_rig(path, RIG, "kalibr")
    text = path.read_text()

    def lists(name: str) -> list[np.ndarray]:
        return [np.array(json.loads(found)) for found in re.findall(rf"{name}: (\[.*\])", text)]

    matrices = [np.array([[i[0], 0, i[2]], [0, i[1], i[3]], [0, 0, 1]]) for i in lists("intrinsics")]
    rows = np.array([json.loads(row) for row in re.findall(r"  - (\[.*\])", text)])
    found = seen_by_opencv(matrices, lists("distortion_coeffs"), rows[:3, :3], rows[:3, 3])
    assert np.abs(found - seen_by_both(RIG)).max() < 0.1
    assert lists("resolution")[0].tolist() == [7728, 5368]
    assert rows[3].tolist() == [0, 0, 0, 1]
    assert all("." in number for number in re.findall(r"[-\d.]+e[-+]\d+", text)), "YAML 1.1 takes 1e-05 for a text"


def test_json_holds_everything(tmp_path: Path) -> None:
    export_rig(tmp_path / "rig.json", RIG, "json")
    found = json.loads((tmp_path / "rig.json").read_text())
    assert found["left"]["pupil_m_per_px"] == 7.1e-4
    assert found["right"]["distortion"] == [-0.1, 0, 0, 0, 0]
    assert found["translation_m"] == list(RIG.translation_m)


def test_rotation_vector_and_millimetres(tmp_path: Path) -> None:
    path = tmp_path / "rig.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", 640)
    file.write("image_height", 480)
    for n in "12":
        file.write(f"cameraMatrix{n}", np.array([[530.0, 0, 320], [0, 530, 240], [0, 0, 1]]))
        file.write(f"distCoeffs{n}", np.zeros(4))
    file.write("R", np.array([0.0, 0.01, 0.0]))
    file.write("T", np.array([-99.0, 1.0, 0.0]))
    file.release()
    rig = import_rig(path, dataclasses.replace(PART, unit_m=0.001))
    assert rig.translation_m == pytest.approx((-0.099, 0.001, 0))
    np.testing.assert_allclose(rig.right_from_left, Rotation.from_rotvec([0, 0.01, 0]).as_matrix(), atol=1e-12)
    assert rig.left.sensor_px == (640, 480) and rig.left.distortion == (0.0,) * 5


@pytest.mark.parametrize(
    ("find", "replace", "message"),
    [
        ("image_width: 7728", "", "no image_width"),
        ("M2:", "M3:", "no matrix M2"),
        ("\nT:", "\nU:", "no matrix T"),
        ("rows: 1\n   cols: 5", "rows: 5\n   cols: 2", "readable OpenCV|no matrix D1"),
        ("%YAML", "}{ YAML", "not a readable OpenCV"),
    ],
)
def test_says_what_is_wrong(tmp_path: Path, find: str, replace: str, message: str) -> None:
    path = tmp_path / "rig.yml"
    export_rig(path, RIG, "opencv")
    text = path.read_text()
    assert find in text
    path.write_text(text.replace(find, replace, 1))
    with pytest.raises(ConfigError, match=message) as caught:
        import_rig(path, PART)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("M1", np.array([[-5.0, 0, 1], [0, 5, 1], [0, 0, 1]]), "focal length"),
        ("D1", np.array([0, 0, 0, 0, 0, 0.1, 0, 0]), "rational distortion"),
        ("R", 2 * np.eye(3), "no rotation"),
        ("T", np.zeros(3), "T = 0"),
    ],
)
def test_refuses_impossible_values(tmp_path: Path, name: str, value: np.ndarray, message: str) -> None:
    values = {"M1": np.diag([5.0, 5, 1]), "D1": np.zeros(5), "M2": np.diag([5.0, 5, 1]), "D2": np.zeros(5)}
    values |= {"R": np.eye(3), "T": np.array([-1.0, 0, 0]), name: value}
    path = tmp_path / "rig.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", 64)
    file.write("image_height", 48)
    for key, number in values.items():
        file.write(key, number)
    file.release()
    with pytest.raises(ConfigError, match=message):
        import_rig(path, PART)


def test_the_plenoptic_part_must_be_given(tmp_path: Path) -> None:
    export_rig(tmp_path / "rig.yml", RIG, "opencv")
    with pytest.raises(ConfigError, match="pinhole cameras only"):
        import_rig(tmp_path / "rig.yml")
    with pytest.raises(ConfigError, match="near_m < far_m"):
        import_rig(tmp_path / "rig.yml", dataclasses.replace(PART, far_m=0.5))
    with pytest.raises(ConfigError, match="expected a rig file"):
        import_rig(tmp_path / "rig.xml", PART)
    with pytest.raises(ConfigError, match=r"expected \.toml"):
        choose_format(tmp_path / "rig.xml", None)


def test_refuses_lenses_that_the_model_cannot_tell(tmp_path: Path) -> None:
    odd = dataclasses.replace(LEFT, distortion=(-3.0, 20.0, 0.0, 0.08, 0.05))
    with pytest.raises(RigError, match="lens models differ"):
        export_rig(tmp_path / "rig.yml", dataclasses.replace(RIG, left=odd), "opencv")
    export_rig(tmp_path / "rig.yml", dataclasses.replace(RIG, left=RIGHT), "opencv")
    text = (tmp_path / "rig.yml").read_text()
    bends = re.search(r"D1:.*?data: \[(.*?)\]", text, re.S)
    assert bends is not None
    (tmp_path / "rig.yml").write_text(text.replace(bends.group(1), " 0., 0., 0.05, 0.02, 0. ", 1))
    with pytest.raises(RigError, match="camera 1: the lens models differ"):
        import_rig(tmp_path / "rig.yml", PART)


def test_opencv_has_one_picture_size(tmp_path: Path) -> None:
    other = dataclasses.replace(RIG, right=dataclasses.replace(RIGHT, sensor_px=(3280, 3280)))
    with pytest.raises(RigError, match="expected one size"):
        export_rig(tmp_path / "rig.yml", other, "opencv")
    export_rig(tmp_path / "rig.yaml", other, "kalibr")


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_rig(tmp_path / "rig.toml", RIG)
    assert main(["rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "rig.yml")]) == 0
    assert "baseline 94.848 mm, centre views only" in capsys.readouterr().out
    assert main(["rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "c.yaml"), "--format", "kalibr"]) == 0
    assert (tmp_path / "c.yaml").read_text().startswith("# lfstereo rig")
    words = ["rig", str(tmp_path / "rig.yml"), "-o", str(tmp_path / "back.toml")]
    assert main(words) == 3
    words += ["--focus-distance-m", "0.85", "0.85", "--pupil-m-per-px", "7.1e-4", "7.1e-4", "--near-m", "0.6"]
    assert main([*words, "--far-m", "1.2", "--serial-left", "A1"]) == 0
    assert read_rig(tmp_path / "back.toml").left.serial == "A1"
    assert main([*words, "--far-m", "1.2"]) == 3
    assert "exists already" in capsys.readouterr().err
