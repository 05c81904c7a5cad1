"""Targets: what is printed is found again, and its file says what was printed."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.assets import asset_folder
from lfstereo.cli.main import main
from lfstereo.errors import ConfigError
from lfstereo.rig.target import Target, read_target, write_target
from lfstereo.rig.target_print import Sheet, lay_out, print_target

CHECKERBOARD = Target("checkerboard", (7, 6), 0.010)
CHARUCO = Target("charuco", (8, 5), 0.012)


def painted(sheet: Sheet, px_per_mm: int = 10) -> np.ndarray:
    picture = np.full([round(sheet.height_mm * px_per_mm), round(sheet.width_mm * px_per_mm)], 255, np.uint8)
    for (x, y, w, h), black in sheet.boxes:
        ends = [round(v * px_per_mm) for v in (y, y + h, x, x + w)]
        picture[ends[0] : ends[1], ends[2] : ends[3]] = 0 if black else 255
    return picture


def test_points_run_along_the_rows_in_metres() -> None:
    points = CHECKERBOARD.points
    assert points.shape == (42, 3)
    np.testing.assert_allclose(points[[0, 1, 7, 41]], [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.06, 0.05, 0]])


def test_the_printed_checkerboard_has_its_corners_where_the_points_are() -> None:
    found, corners = cv2.findChessboardCornersSB(painted(lay_out(CHECKERBOARD)), (7, 6))
    assert found
    # First corner one square and the 8 mm margin from the page's corner; pixel centres lie half a pixel later.
    # OpenCV may count from the other end.
    expected = (CHECKERBOARD.points[:, :2] * 1e3 + 18) * 10 - 0.5
    corners = corners.reshape(-1, 2)
    ordered = corners if corners[0, 0] < corners[-1, 0] else corners[::-1]
    np.testing.assert_allclose(ordered, expected, atol=0.2)


def test_the_printed_charuco_board_is_recognised_whole() -> None:
    picture = painted(lay_out(CHARUCO))
    corners, numbers, _, _ = cv2.aruco.CharucoDetector(CHARUCO.charuco_board()).detectBoard(picture)
    assert numbers.ravel().tolist() == list(range(40))
    expected = (CHARUCO.points[:, :2] * 1e3 + 20) * 10 - 0.5
    np.testing.assert_allclose(corners.reshape(-1, 2), expected, atol=0.5)


def test_svg_has_its_true_size_and_says_it(tmp_path: Path) -> None:
    print_target(tmp_path / "b.svg", CHECKERBOARD)
    text = (tmp_path / "b.svg").read_text()
    assert 'width="96mm" height="100mm"' in text
    assert "7 x 6 corners, square 10 mm" in text


def test_pdf_is_whole_and_to_scale(tmp_path: Path) -> None:
    print_target(tmp_path / "b.pdf", CHECKERBOARD)
    content = (tmp_path / "b.pdf").read_bytes()
    assert b"/MediaBox [0 0 272.1260 283.4646]" in content  # 96 and 100 mm at 72 / 25.4 points per mm
    start = int(re.findall(rb"startxref\n(\d+)", content)[0])
    assert content[start:].startswith(b"xref")
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", content), 1):
        assert content[int(place) :].startswith(b"%d 0 obj" % number)


@pytest.mark.parametrize("target", [CHECKERBOARD, CHARUCO, Target("charuco", (8, 5), 0.012, 0.008, "5x5_250")])
def test_file_round_trip(tmp_path: Path, target: Target) -> None:
    write_target(tmp_path / "t.toml", target)
    assert read_target(tmp_path / "t.toml") == target


@pytest.mark.parametrize(
    ("find", "replace", "message"),
    [
        ("lfstereo target 1", "other", "found no format"),
        ('kind = "checkerboard"\n', "", "kind missing"),
        ("[7, 6]", "[7, 7]", "one number odd and one even"),
        ("[7, 6]", "[7, 2]", "3 to 60"),
        ("[7, 6]", "7", "expected a list"),
        ("square_m = 0.01", "square_m = 10.0", "0.0005 to 1 m"),
        ('"checkerboard"', '"circles"', "expected one of checkerboard, charuco"),
        ('"checkerboard"', '"charuco"\nmarker = 3', "is not an option"),
        ("marker_m = 0.0", "marker_m = 0.02", "less than square_m"),
        ("[7, 6]", "[40, 39]", "more than 250 markers"),
    ],
)
def test_says_what_is_wrong_with_a_file(tmp_path: Path, find: str, replace: str, message: str) -> None:
    path = tmp_path / "t.toml"
    kind = "charuco" if "marker" in message or "square_m" in message else "checkerboard"
    write_target(path, Target(kind, (7, 6), 0.01))
    text = path.read_text()
    assert find in text
    path.write_text(text.replace(find, replace))
    with pytest.raises(ConfigError, match=message) as caught:
        read_target(path)
    assert str(path) in str(caught.value)


def test_a_kind_that_is_none() -> None:
    with pytest.raises(ConfigError, match="expected checkerboard or charuco"):
        Target("circles")  # type: ignore[arg-type]


def test_command_writes_both_files_and_keeps_what_exists(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "board.pdf"
    words = ["target", "-o", str(output), "--kind", "charuco", "--corners", "8", "5", "--square-m", "0.012"]
    assert main(words) == 0
    assert read_target(tmp_path / "board.toml") == CHARUCO
    assert main(words) == 3
    assert main(["target", "-o", str(tmp_path / "board.png")]) == 3
    assert "expected .svg or .pdf" in capsys.readouterr().err


@pytest.mark.parametrize("path", sorted(asset_folder("calib").joinpath("targets").glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_targets_can_be_read(path: Path) -> None:
    assert read_target(path).points.shape[1] == 3
