"""Stereo data sets on disk: where scenes are found, how disparities are coded, what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.depth.pfm import write_pfm
from lfstereo.errors import InputError, ShapeError
from lfstereo.simulate.stereo_scenes import (
    SceneFiles,
    find_scenes,
    grey_scale,
    read_disparity,
    read_picture,
    read_scene,
    right_from_left,
)


def picture(path: Path, height: int = 12, width: int = 20) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.full((height, width, 3), (10, 100, 188), np.uint8))  # BGR
    return path


def scene(folder: Path, truth: np.ndarray | None = None) -> SceneFiles:
    pair = picture(folder / "im0.png"), picture(folder / "im1.png")
    write_pfm(folder / "disp0GT.pfm", np.full((12, 20), 4, np.float32) if truth is None else truth)
    return SceneFiles("one", *pair, folder / "disp0GT.pfm")


def test_scenes_of_a_folder_in_order(tmp_path: Path) -> None:
    for name in ("b", "a"):
        scene(tmp_path / "sets" / name)
    found = find_scenes(tmp_path)
    assert [s.name for s in found] == ["sets-a", "sets-b"]
    assert find_scenes(tmp_path / "sets" / "a")[0].name == "a"


def test_flying_things_layout(tmp_path: Path) -> None:
    for split, letter in (("TRAIN", "A"), ("TEST", "B")):
        for side in ("left", "right"):
            picture(tmp_path / "frames_cleanpass" / split / letter / "0003" / side / "0006.png")
            maps = tmp_path / "disparity" / split / letter / "0003" / side
            maps.mkdir(parents=True)
            write_pfm(maps / "0006.pfm", np.full((12, 20), 5 if side == "left" else 7, np.float32))
    found = find_scenes(tmp_path)
    assert [(s.name, s.part) for s in found] == [("B-0003-0006", "test"), ("A-0003-0006", "train")]
    read = read_scene(found[0])
    assert (read.disparity == 5).all() and (read.right_disparity == 7).all()


def test_pictures_become_linear_rgb(tmp_path: Path) -> None:
    read = read_picture(picture(tmp_path / "a.png"))
    assert read.shape == (12, 20, 3) and read.dtype == np.float32
    np.testing.assert_allclose(read[0, 0], [0.503, 0.127, 0.003], atol=5e-4)
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((3, 4), 255, np.uint8))
    assert read_picture(tmp_path / "grey.png").tolist() == np.ones((3, 4, 3)).tolist()


def test_coded_disparities(tmp_path: Path) -> None:
    for name, codes, expected in (
        ("disp1.png", np.uint8([[0, 30, 60]]), [0, 10, 20]),
        ("kitti.png", np.uint16([[0, 256, 640]]), [0, 1, 2.5]),
        ("own.png", np.uint8([[0, 16, 255]]), [0, 2, 31.875]),
    ):
        cv2.imwrite(str(tmp_path / name), codes)
        values, known = read_disparity(tmp_path / name)
        assert values[0].tolist() == expected
        assert known[0].tolist() == [False, True, True]
    write_pfm(tmp_path / "right.pfm", np.float32([[-7, 0, np.inf]]))
    values, known = read_disparity(tmp_path / "right.pfm")
    assert values[0, 0] == 7 and known[0].tolist() == [True, False, False]
    assert read_disparity(tmp_path / "own.png", 255 / 100)[0][0, 2] == pytest.approx(100)


@pytest.mark.parametrize(
    ("path", "width", "expected"),
    [
        ("Art/disp1.png", 463, 3),
        ("Art/disp5.png", 695, 2),
        ("Art/disp1.png", 1390, 1),
        ("teddy/disp2.png", 450, 4),
        ("teddy/disp6.png", 900, 2),
        ("tsukuba/disp2.png", 384, 16),
        ("venus/disp2.pgm", 434, 8),
    ],
)
def test_grey_scale_of_middlebury(path: str, width: int, expected: float) -> None:
    assert grey_scale(Path(path), width) == expected


def test_unknown_disparities_take_the_background(tmp_path: Path) -> None:
    truth = np.full((12, 20), 9, np.float32)
    truth[:, 10:] = 3
    truth[:, 8:12] = np.inf
    read = read_scene(scene(tmp_path, truth))
    assert (read.disparity[:, 8:12] == 3).all()
    assert not read.known[:, 8:12].any() and read.known[:, :8].all()


def test_right_disparity_from_left_keeps_the_nearest() -> None:
    """A square at 6 px before a wall at 2 px: 6 px further left, and the wall behind it on its right."""
    disparity = np.full((4, 40), 2, np.float32)
    disparity[:, 20:28] = 6
    expected = np.full((4, 40), 2, np.float32)
    expected[:, 14:22] = 6
    np.testing.assert_array_equal(right_from_left(disparity), expected)


def test_files_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no stereo scene; expected a folder with im0"):
        find_scenes(tmp_path)
    with pytest.raises(InputError, match=r"no\.png: cannot be read"):
        read_picture(tmp_path / "no.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError, match="not a picture of 8 or 16 bits"):
        read_picture(tmp_path / "text.png")
    files = scene(tmp_path / "small", np.full((12, 19), 4, np.float32))
    with pytest.raises(ShapeError, match=r"disp0GT\.pfm: 19 x 12 px, expected 20 x 12 as im0\.png"):
        read_scene(files)
    files = scene(tmp_path / "blank", np.full((12, 20), np.inf, np.float32))
    with pytest.raises(InputError, match="no disparity is known"):
        read_scene(files)
    files = scene(tmp_path / "right")
    write_pfm(tmp_path / "right" / "other.pfm", np.zeros((3, 3), np.float32))
    with pytest.raises(ShapeError, match=r"other\.pfm: expected known disparities of the size of im0\.png"):
        read_scene(SceneFiles("x", files.left, files.right, files.disparity, tmp_path / "right" / "other.pfm"))
