"""``lfstereo calibrate`` on painted boards seen by two known cameras."""

from __future__ import annotations

import json
import math
import types
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lfstereo.cli.main import main
from lfstereo.errors import AssetError, TargetNotFoundError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import write_light_field
from lfstereo.rig import session
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig
from lfstereo.rig.session import see_targets
from lfstereo.rig.shots import pair_shots
from lfstereo.rig.target import Target, write_target
from lfstereo.rig.target_print import lay_out
from lfstereo.viewer.template import read_content

TARGET = Target("checkerboard", (7, 6), 0.025)
LEFT = PlenopticCamera("L", (240, 180), (420.0, 420.0), (121.0, 88.0), 0.85, 8e-4)
RIGHT = PlenopticCamera("R", (240, 180), (424.0, 424.0), (118.0, 90.5), 0.85, 8e-4)
RIG = StereoRig(LEFT, RIGHT, (0.003, 0.11, -0.004), (-0.0948, 0.0006, 0.0052), 0.6, 1.2, 1.0)
VIEWS = 3
FINE = 3
BASELINE_TOLERANCE = 0.01
"""Relative, of 240 x 180 px views painted with 3 x 3 samples per px."""
ROTATION_TOLERANCE_RAD = math.radians(0.3)


def page() -> np.ndarray:
    sheet, px_per_mm = lay_out(TARGET), 4
    picture = np.full([round(sheet.height_mm * px_per_mm), round(sheet.width_mm * px_per_mm)], 0.9, np.float32)
    for (x, y, w, h), black in sheet.boxes:
        ends = [round(v * px_per_mm) for v in (y, y + h, x, x + w)]
        picture[ends[0] : ends[1], ends[2] : ends[3]] = 0.06 if black else 0.9
    return picture


def seen_by(camera: PlenopticCamera, rotation: np.ndarray, translation: np.ndarray, name: str) -> LightField:
    """Paint the board as each view's pinhole sees it: a homography from the printed page."""
    width, height = camera.sensor_px
    picture = page()
    first = 8.0e-3 + TARGET.square_m
    board_from_page = np.array([[0.25e-3, 0, 0.125e-3 - first], [0, 0.25e-3, 0.125e-3 - first], [0, 0, 1]])
    enlarge = np.array([[FINE, 0, (FINE - 1) / 2], [0, FINE, (FINE - 1) / 2], [0, 0, 1.0]])
    views = np.empty((VIEWS, VIEWS, height, width, 3), np.float32)
    for t, s in np.ndindex(VIEWS, VIEWS):
        pupil = np.array([s - VIEWS // 2, t - VIEWS // 2]) * camera.pupil_m_per_px
        centre = camera.principal_px + np.array(camera.focal_px) * pupil / camera.focus_distance_m
        matrix = np.array([[camera.focal_px[0], 0, centre[0]], [0, camera.focal_px[1], centre[1]], [0, 0, 1]])
        plane = np.column_stack([rotation[:, :2], translation - [*pupil, 0]])
        warp = enlarge @ matrix @ plane @ board_from_page
        large = cv2.warpPerspective(picture, warp, (width * FINE, height * FINE), borderValue=0.4)
        views[t, s] = cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)[..., None]
    return LightField(views, None, None, camera.serial, name, zoom_step=105, focus_step=-6)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photographs")
    write_target(folder / "board.toml", TARGET)
    rng = np.random.default_rng(4)
    for side in ("left", "right", "mixed"):
        (folder / side).mkdir()
    for n in range(7):
        tilt = np.array([[0.4, 0], [-0.4, 0.1], [0, 0.45], [0.1, -0.45], [0.3, 0.3], [-0.3, 0.35], [0.05, 0]])[n]
        rotation = Rotation.from_rotvec([*tilt, rng.uniform(-0.15, 0.15)]).as_matrix()
        z = (0.8, 0.95, 0.7, 1.05, 0.75, 0.9, 1.1)[n]
        middle = [0.0475 + (n % 3 - 1) * 0.05 * z, (n % 2 - 0.5) * 0.12 * z, z]
        translation = middle - rotation @ TARGET.points.mean(axis=0)
        right = RIG.right_from_left @ translation + RIG.translation_m
        write_light_field(folder / "left" / f"{n:02d}.h5", seen_by(LEFT, rotation, translation, f"l{n}"))
        there = seen_by(RIGHT, RIG.right_from_left @ rotation, right, f"r{n}")
        write_light_field(folder / "right" / f"{n:02d}.h5", there)
    return folder


def words(folder: Path, output: Path, *more: str) -> list[str]:
    sides = [str(folder / side) for side in ("left", "right")]
    return ["calibrate", *sides, "--target", str(folder / "board.toml"), "-o", str(output), *more]


def test_photographs_become_a_rig_and_a_report(
    photographs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "rig.toml"
    assert main(words(photographs, output, "--json", "--drop", "06")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["serials"] == ["L", "R"]
    assert sorted({shot["name"] for shot in summary["shots"]}) == [f"{n:02d}" for n in range(6)]
    rig = read_rig(output)
    assert rig.baseline_m == pytest.approx(RIG.baseline_m, rel=BASELINE_TOLERANCE)
    turn = Rotation.from_matrix(rig.right_from_left @ RIG.right_from_left.T).magnitude()
    assert turn < ROTATION_TOLERANCE_RAD
    assert rig.left.focus_distance_m == pytest.approx(0.85, rel=0.03)
    assert (rig.left.zoom_step, rig.right.focus_step) == (105, -6)
    picture = cv2.imread(str(tmp_path / "rig.png"))
    assert picture.shape[1] == 1400 and picture.std() > 10
    content = read_content(tmp_path / "rig.html")
    assert content["title"] == ["L", "R"]
    assert [shot["name"] for shot in content["shots"]] == [f"{n:02d}" for n in range(6)]
    assert content["rig"]["baseline_m"] == pytest.approx(rig.baseline_m)
    distances = [shot["distance_m"] for shot in content["shots"]]
    assert distances == pytest.approx([0.8, 0.95, 0.7, 1.05, 0.75, 0.9], rel=0.05)
    assert content["shots"][0]["tilt_deg"] == pytest.approx(math.degrees(0.4), abs=2)
    assert [file["name"] for file in content["files"]] == ["rig.toml", "rig.png"]
    assert main(words(photographs, output)) == 3
    assert "exists already" in capsys.readouterr().err


def test_says_which_shots_there_are_to_drop(
    photographs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words(photographs, tmp_path / "rig.toml", "--drop", "99")) == 3
    assert "found no shot 99, expected some of 00, 01" in capsys.readouterr().err


def test_too_few_shots_are_no_rig(photographs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "rig.toml"
    assert main(words(photographs, output, "--drop", "00", "01", "02", "03")) == 4
    assert "3 of 3 shots usable" in capsys.readouterr().err
    assert not output.exists()


def test_shots_without_the_target_are_named(photographs: Path) -> None:
    shots = pair_shots(photographs / "left", photographs / "right")[:1]
    with pytest.raises(TargetNotFoundError, match=r"none of 1 shots shows the target.*00.h5: found no checkerboard"):
        see_targets(shots, Target("checkerboard", (10, 7), 0.03), None)
    with pytest.raises(TargetNotFoundError, match="found no shots"):
        see_targets([], TARGET, None)


def test_refuses_shots_of_several_cameras(photographs: Path) -> None:
    left, right = ([p for _, *p in pair_shots(photographs / "left", photographs / "right")][n] for n in (0, 1))
    with pytest.raises(AssetError, match=r"camera #be43, expected #304b as .*all left shots"):
        see_targets([("a", left[0], left[1]), ("b", right[1], right[0])], TARGET, None)


def test_refuses_two_sides_of_one_camera(photographs: Path) -> None:
    paths = [path for _, path, _ in pair_shots(photographs / "left", photographs / "right")]
    with pytest.raises(AssetError, match=r"shot a: .*00\.h5 and .*01\.h5 were both taken by camera #304b"):
        see_targets([("a", paths[0], paths[1])], TARGET, None)


def capture(zoom: int) -> types.SimpleNamespace:
    lens = types.SimpleNamespace(zoom_step=zoom, focus_step=5)
    return types.SimpleNamespace(metadata=types.SimpleNamespace(serial="A", height=4, width=6, lens=lens))


def test_raw_captures_must_be_of_one_zoom(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(session, "read_capture", lambda path: capture(int(path.stem)))
    monkeypatch.setattr(session, "find_corners", lambda *_: (_ for _ in ()).throw(TargetNotFoundError("none")))
    monkeypatch.setattr(session, "thin_lens_of_metadata", lambda metadata: None)
    blank = types.SimpleNamespace(sampling=None)
    monkeypatch.setattr(session.ShotSide, "_decoded", lambda *_: blank)
    shots = [(n, tmp_path / f"{n}.LFR", tmp_path / f"{n}.LFR") for n in ("1", "2")]
    with pytest.raises(AssetError, match=r"2\.LFR: zoom step 2, expected 1 as .*1\.LFR"):
        see_targets(shots, TARGET, None)


def test_pairs_by_name_with_the_side_taken_out(tmp_path: Path) -> None:
    for name in ("00_left.LFR", "00_right.LFR", "01_left.LFR", "01_right.LFR", "notes.txt"):
        (tmp_path / name).touch()
    found = [(name, a.name, b.name) for name, a, b in pair_shots(tmp_path, tmp_path)]
    assert [pair[1:] for pair in found] == [("00_left.LFR", "00_right.LFR"), ("01_left.LFR", "01_right.LFR")]
    (tmp_path / "01_right.LFR").unlink()
    with pytest.raises(AssetError, match=r"01_left\.LFR: found no partner"):
        pair_shots(tmp_path, tmp_path)


def test_a_capture_is_not_its_own_partner(tmp_path: Path) -> None:
    (tmp_path / "IMG_1.LFR").touch()
    with pytest.raises(AssetError, match=r"IMG_1\.LFR: found in the left and in the right"):
        pair_shots(tmp_path, tmp_path)


def test_pairs_by_order_where_no_name_agrees(tmp_path: Path) -> None:
    for side, names in (("a", ("IMG_1.LFR", "IMG_2.LFR")), ("b", ("IMG_7.LFR", "IMG_9.LFR"))):
        (tmp_path / side).mkdir()
        for name in names:
            (tmp_path / side / name).touch()
    found = [(a.name, b.name) for _, a, b in pair_shots(tmp_path / "a", tmp_path / "b")]
    assert found == [("IMG_1.LFR", "IMG_7.LFR"), ("IMG_2.LFR", "IMG_9.LFR")]


def test_folders_without_captures(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="found no such folder"):
        pair_shots(tmp_path / "no", tmp_path)
    with pytest.raises(AssetError, match="found no capture of the left camera"):
        pair_shots(tmp_path, tmp_path)
