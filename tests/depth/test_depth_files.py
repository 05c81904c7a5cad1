"""Round trips of PFM, PNG and PLY, and what damaged files answer."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.depth.pfm import read_pfm, write_pfm
from lfstereo.depth.pictures import write_png
from lfstereo.depth.ply import read_ply, write_ply
from lfstereo.depth.png16 import read_disparity_png, write_disparity_png
from lfstereo.depth.points import PointCloud
from lfstereo.errors import InputError, OutputError, ShapeError
from lfstereo.lightfield.encoding import srgb8, srgb16

PIXELS = np.float32([[1.5, -2.0, 3.25], [0.0, 100.0, 1e-3]])


def test_pfm_returns_what_was_written(tmp_path: Path) -> None:
    valid = np.array([[True, True, False], [True, True, True]])
    write_pfm(tmp_path / "d.pfm", PIXELS, valid)
    values, known = read_pfm(tmp_path / "d.pfm")
    np.testing.assert_array_equal(known, valid)
    np.testing.assert_array_equal(values, np.where(valid, PIXELS, 0))


def test_pfm_bytes(tmp_path: Path) -> None:
    """Header in ASCII, then the bottom row first, little-endian."""
    write_pfm(tmp_path / "d.pfm", PIXELS)
    assert (tmp_path / "d.pfm").read_bytes() == b"Pf\n3 2\n-1.0\n" + PIXELS[::-1].astype("<f4").tobytes()


def test_pfm_agrees_with_opencv(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.pfm"), PIXELS)
    np.testing.assert_array_equal(read_pfm(tmp_path / "d.pfm")[0], PIXELS)


def test_pfm_big_endian_with_comment(tmp_path: Path) -> None:
    path = tmp_path / "d.pfm"
    path.write_bytes(b"Pf\n# made elsewhere\n3 2\n1\n" + PIXELS[::-1].astype(">f4").tobytes())
    np.testing.assert_array_equal(read_pfm(path)[0], PIXELS)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "header ends after 0 of 3 lines"),
        (b"Pf\n3 2\n", "header ends after 2 of 3 lines"),
        (b"P5\n3 2\n255\n" + b"\0" * 6, "starts with 'P5', expected 'Pf'"),
        (b"PF\n1 1\n-1\n" + b"\0" * 12, "starts with 'PF', expected 'Pf'"),
        (b"Pf\n3\n-1\n" + b"\0" * 24, "size is '3'"),
        (b"Pf\n3 x\n-1\n" + b"\0" * 24, "size is '3 x'"),
        (b"Pf\n0 2\n-1\n", "size is '0 2'"),
        (b"Pf\n-3 2\n-1\n", "size is '-3 2'"),
        (b"Pf\n99999999 99999999\n-1\n", "expected width and height of 1 to 65536"),
        (b"Pf\n3 2\n0\n" + b"\0" * 24, "scale is '0'"),
        (b"Pf\n3 2\nnan\n" + b"\0" * 24, "scale is 'nan'"),
        (b"Pf\n3 2\nlittle\n" + b"\0" * 24, "scale is 'little'"),
        (b"Pf\n3 2\n-1\n" + b"\0" * 23, "3 x 2 px need 24 bytes of pixels, found 23"),
        (b"Pf\n3 2\n-1\n" + b"\0" * 25, "3 x 2 px need 24 bytes of pixels, found 25"),
        (b"\xff\xd8\xff\xe0" * 2000, "header ends after 0 of 3 lines"),
    ],
)
def test_damaged_pfm(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "d.pfm"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_pfm(path)
    assert message in str(caught.value) and str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_png_keeps_disparity_to_1_512_px(tmp_path: Path) -> None:
    disparity = np.random.default_rng(0).uniform(0.0, 255.9, (20, 30)).astype(np.float32)
    valid = disparity > 20
    write_disparity_png(tmp_path / "d.png", disparity, valid)
    found, known = read_disparity_png(tmp_path / "d.png")
    np.testing.assert_array_equal(known, valid)
    np.testing.assert_allclose(found[valid], disparity[valid], atol=1 / 512 + 1e-5)  # px


def test_png_tells_a_disparity_of_zero_from_unknown(tmp_path: Path) -> None:
    write_disparity_png(tmp_path / "d.png", np.zeros((1, 2), np.float32), np.array([[True, False]]))
    found, known = read_disparity_png(tmp_path / "d.png")
    assert known.tolist() == [[True, False]] and found[0, 0] == 1 / 256
    assert cv2.imread(str(tmp_path / "d.png"), cv2.IMREAD_UNCHANGED).tolist() == [[1, 0]]


def test_png_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a 16-bit PNG holds 0 to"):
        write_disparity_png(tmp_path / "d.png", np.float32([[300.0]]))
    with pytest.raises(InputError, match="a 16-bit PNG holds 0 to"):
        write_disparity_png(tmp_path / "d.png", np.float32([[np.nan]]))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("dtype, shape", [(np.uint8, (4, 4)), (np.uint16, (4, 4, 3))])
def test_png_of_another_kind(tmp_path: Path, dtype: type, shape: tuple[int, ...]) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), np.zeros(shape, dtype))
    with pytest.raises(InputError, match="expected a 16-bit grey PNG"):
        read_disparity_png(tmp_path / "d.png")


@pytest.mark.parametrize("content", [b"", b"no picture"])
def test_damaged_png(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "d.png").write_bytes(content)
    with pytest.raises(InputError, match="not a readable picture"):
        read_disparity_png(tmp_path / "d.png")


def test_ply_returns_what_was_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    cloud = PointCloud(rng.normal(size=(50, 3)).astype(np.float32), rng.integers(0, 256, (50, 3), dtype=np.uint8))
    write_ply(tmp_path / "p.ply", cloud)
    found = read_ply(tmp_path / "p.ply")
    np.testing.assert_array_equal(found.points_m, cloud.points_m)
    np.testing.assert_array_equal(found.colours, cloud.colours)
    head = (tmp_path / "p.ply").read_bytes()[:40]
    assert head.startswith(b"ply\nformat binary_little_endian 1.0\n")


def test_ply_of_no_points(tmp_path: Path) -> None:
    write_ply(tmp_path / "p.ply", PointCloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8)))
    assert len(read_ply(tmp_path / "p.ply").points_m) == 0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a readable PLY"),
        (b"obj\n", "not a readable PLY"),
        (b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "not a readable PLY"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "points lack y, z, red"),
        (
            b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nend_header\n1",
            "not a readable PLY",
        ),
    ],
)
def test_damaged_ply(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "p.ply").write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_ply(tmp_path / "p.ply")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read", [read_pfm, read_disparity_png, read_ply])
def test_missing_file(tmp_path: Path, read) -> None:
    with pytest.raises(InputError, match=r"cannot be read \(No such file or directory\)"):
        read(tmp_path / "none")


@pytest.mark.parametrize("write", [write_pfm, write_disparity_png])
def test_writers_check_shapes_and_keep_existing_files(tmp_path: Path, write) -> None:
    path = tmp_path / "d"
    with pytest.raises(ShapeError, match="expected"):
        write(path, np.zeros(3, np.float32))
    with pytest.raises(ShapeError, match="valid has shape"):
        write(path, np.zeros((2, 2), np.float32), np.ones((1, 2), np.bool_))
    path.write_bytes(b"mine")
    with pytest.raises(OutputError, match="exists already"):
        write(path, np.zeros((2, 2), np.float32))
    assert path.read_bytes() == b"mine"


def test_srgb_closed_form() -> None:
    """IEC 61966-2-1: the straight part, and 0.5 encoded is 0.735357."""
    linear = np.float32([0.0, 0.002, 0.5, 1.0, -3.0, 7.0])
    expected = np.array([0.0, 12.92 * 0.002, 0.735357, 1.0, 0.0, 1.0])
    np.testing.assert_allclose(srgb16(linear) / 65535, expected, atol=1e-5)
    np.testing.assert_array_equal(srgb8(linear), np.rint(expected * 255))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 6, 3), (5, 6)])
def test_picture_file(tmp_path: Path, dtype: type, shape: tuple[int, ...]) -> None:
    picture = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape, dtype=dtype)
    write_png(tmp_path / "p.png", picture)
    found = cv2.imread(str(tmp_path / "p.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found if picture.ndim == 2 else found[..., ::-1], picture)


@pytest.mark.parametrize(
    "picture", [np.zeros((4, 4), np.float32), np.zeros((4, 4, 2), np.uint8), np.zeros(4, np.uint8)]
)
def test_refuses_what_is_no_picture(tmp_path: Path, picture: np.ndarray) -> None:
    with pytest.raises(ShapeError, match="expected 8- or 16-bit RGB or grey"):
        write_png(tmp_path / "p.png", picture)
