"""Focus sweeps from files that the test writes itself: pictures, RAW, EXIF, tables, and everything wrong with them."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, TiffImagePlugin

from lfstereo.container import Capture
from lfstereo.container.dng import write_dng
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.errors import ConfigError, ContainerError, ShapeError
from lfstereo.focus.exif import read_focus_tags
from lfstereo.focus.importers import ImportOptions, find_pictures, read_sweep
from lfstereo.focus.sweep import depth_at, vergence
from lfstereo.lightfield.encoding import srgb8, srgb16, srgb_to_linear

SIZE = (40, 60)
CODE_8 = 0.02
"""Linear light: two steps of 8-bit sRGB near white, which JPEG may be off by in smooth pictures."""
INFINITE = 0xFFFFFFFF


def picture(k: int) -> np.ndarray:
    """Smooth, so that JPEG keeps it; brighter from picture to picture."""
    v, u = np.mgrid[: SIZE[0], : SIZE[1]] / 60
    return np.stack([0.1 + 0.1 * k + 0.2 * u, 0.2 + 0.2 * v, 0.3 + 0 * u], -1).astype(np.float32)


def write_jpeg(path: Path, k: int, distance: tuple[int, int] | None, **tags: float) -> None:
    exif = Image.Exif()
    inner = exif.get_ifd(0x8769)
    if distance is not None:
        inner[37382] = TiffImagePlugin.IFDRational(*distance)
    for code, value in {"focal": 37386, "film": 41989, "stop": 33437}.items():
        if code in tags:
            inner[value] = int(tags[code]) if code == "film" else TiffImagePlugin.IFDRational(Fraction(tags[code]))
    Image.fromarray(srgb8(picture(k))).save(path, quality=98, subsampling=0, exif=exif)


def write_raw(path: Path, level: float, gains: tuple[float, float, float, float], distance_m: float) -> None:
    """A flat grey frame as DNG, its focus distance as TIFF/EP stores it."""
    metadata = replace(
        read_camera_profile("lytro-illum"),
        width=SIZE[1],
        height=SIZE[0],
        white_balance=gains,
        ccm=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0),
    )
    mosaic = np.full(SIZE, 64 + 959 * level, np.uint16)
    write_dng(path, Capture(mosaic, metadata, "flat"))
    with tifffile.TiffFile(path) as tiff:
        tags = [(t.code, t.dtype, t.count, t.value, True) for t in tiff.pages[0].tags.values() if t.code > 33000]
    extra = [(271, 2, 0, "Maker", True), (37382, 5, 1, (round(1000 * distance_m), 1000), True), *tags]
    tifffile.imwrite(path, mosaic, photometric=32803, metadata=None, extratags=extra)


def test_jpeg_with_exif_comes_near_to_far(tmp_path: Path) -> None:
    for k, distance in enumerate([(INFINITE, 1), (3, 2), (1, 2)]):
        write_jpeg(tmp_path / f"a{k}.jpg", k, distance, focal=50.0, film=75, stop=2.0)
    sweep = read_sweep(tmp_path)
    assert sweep.names == ("a2.jpg", "a1.jpg", "a0.jpg")
    assert sweep.distances_m is not None
    np.testing.assert_allclose(sweep.distances_m, [0.5, 1.5, np.inf])
    np.testing.assert_allclose(sweep.slices[0], picture(2), atol=CODE_8)
    assert sweep.lens.aperture_m == pytest.approx(0.025)
    assert sweep.lens.focal_px == pytest.approx(75 / np.hypot(36, 24) * np.hypot(*SIZE))


def test_names_count_where_exif_does_not_tell_all(tmp_path: Path) -> None:
    for name, distance in (("s10.jpg", (1, 1)), ("s9.jpg", None), ("s1.jpg", (2, 1))):
        write_jpeg(tmp_path / name, 0, distance)
    sweep = read_sweep(tmp_path)
    assert sweep.names == ("s1.jpg", "s9.jpg", "s10.jpg") and sweep.distances_m is None
    with pytest.raises(ConfigError, match="do not tell their focus distances"):
        vergence(sweep)


def test_equal_distances_in_exif_are_no_distances(tmp_path: Path) -> None:
    for k in range(3):
        write_jpeg(tmp_path / f"{k}.jpg", k, (1, 1))
    assert read_sweep(tmp_path).distances_m is None


def test_adobe_xmp_tells_the_distance(tmp_path: Path) -> None:
    xmp = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><d aux:ApproximateFocusDistance="125/100"/></x:xmpmeta>'
    Image.fromarray(srgb8(picture(0))).save(tmp_path / "a.jpg", xmp=xmp)
    assert read_focus_tags(tmp_path / "a.jpg").distance_m == 1.25


def test_png_tiff_grey_and_float(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), srgb16(picture(0))[..., ::-1])
    tifffile.imwrite(tmp_path / "b.tif", srgb16(picture(0)), photometric="rgb")
    tifffile.imwrite(tmp_path / "c.tif", picture(0), photometric="rgb")
    Image.fromarray(srgb8(picture(0))[..., 0]).save(tmp_path / "d.png")
    sweep = read_sweep(tmp_path)
    for k in range(3):
        np.testing.assert_allclose(sweep.slices[k], picture(0), atol=1e-4)  # 16 bits
    grey = srgb_to_linear(srgb8(picture(0))[..., :1]).repeat(3, -1)
    np.testing.assert_array_equal(sweep.slices[3], grey)


def test_wide_pictures_are_reduced(tmp_path: Path) -> None:
    for k in range(2):
        write_jpeg(tmp_path / f"{k}.jpg", k, None, film=75)
    sweep = read_sweep(tmp_path, ImportOptions(width_px=30))
    assert sweep.slices.shape == (2, 20, 30, 3) and sweep.full_size == SIZE and sweep.reduction == 2
    np.testing.assert_allclose(sweep.slices[1], cv2.resize(picture(1), (30, 20)), atol=CODE_8)
    assert sweep.lens.focal_px == pytest.approx(75 / np.hypot(36, 24) * np.hypot(20, 30))


def test_raw_pictures_share_the_first_one_s_white_balance(tmp_path: Path) -> None:
    """The same light with other gains written by the camera comes out the same, and twice the light twice."""
    write_raw(tmp_path / "a.dng", 0.2, (1.5, 1.0, 1.0, 1.2), 0.5)
    write_raw(tmp_path / "b.dng", 0.2, (1.0, 1.0, 1.0, 2.0), 2.0)
    write_raw(tmp_path / "c.dng", 0.4, (1.5, 1.0, 1.0, 1.2), 1.0)
    sweep = read_sweep(tmp_path)
    assert sweep.names == ("a.dng", "c.dng", "b.dng")
    assert sweep.distances_m is not None
    np.testing.assert_allclose(sweep.distances_m, [0.5, 1.0, 2.0])
    middle = sweep.slices[:, 20, 30]
    np.testing.assert_allclose(middle[2], middle[0], atol=2e-3)
    np.testing.assert_allclose(middle[1] / middle[0], 2.0, rtol=0.02)


def test_table_of_distances(tmp_path: Path) -> None:
    for k in range(3):
        write_jpeg(tmp_path / f"{k}.jpg", k, None)
    table = tmp_path / "focus.csv"
    texts = "file;distance_m\n0.jpg;inf\n2.jpg;2\n1.jpg;0.5\n", "inf\n0.5\n2\n", "# m\n0.jpg\tinf\n1.jpg\t.5\n2.jpg\t2"
    for text in texts:
        table.write_text(text, "utf-8")
        sweep = read_sweep(tmp_path, ImportOptions(distances=table))
        assert sweep.names == ("1.jpg", "2.jpg", "0.jpg")
        np.testing.assert_allclose(vergence(sweep), [2.0, 0.5, 0.0])
    depth = depth_at(np.float32([[0.0, 0.5, 2.0]]), sweep)
    np.testing.assert_allclose(depth, [[0.5, 0.8, 0.0]])  # 0: infinitely far, which is no depth


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1\n2\n", "found 2 distances, expected 3"),
        ("1\n2\n2\n", "found the distance 2 m twice"),
        ("0.jpg,1\n1.jpg,2\n3.jpg,3\n", "found no line for 2.jpg"),
        ("0.jpg,1\n1.jpg,2\n2.jpg,far\n", "found the line '2.jpg,far'"),
        ("0.jpg,1\n1.jpg,2\n2.jpg,-1\n", "found the line '2.jpg,-1'"),
        ("0.jpg,1,2\n", "found the line '0.jpg,1,2'"),
        (None, "cannot be read"),
    ],
)
def test_refuses_tables_that_do_not_fit(tmp_path: Path, text: str | None, message: str) -> None:
    for k in range(3):
        write_jpeg(tmp_path / f"{k}.jpg", k, None)
    table = tmp_path / "focus.csv"
    if text is not None:
        table.write_text(text, "utf-8")
    with pytest.raises(ConfigError, match=message):
        read_sweep(tmp_path, ImportOptions(distances=table))


def test_refuses_folders_that_are_no_sweeps(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="cannot be read"):
        find_pictures(tmp_path / "none")
    write_jpeg(tmp_path / "a.jpg", 0, None)
    with pytest.raises(ContainerError, match="found 1 pictures, expected two or more"):
        read_sweep(tmp_path)
    write_raw(tmp_path / "b.dng", 0.2, (1.0, 1.0, 1.0, 1.0), 1.0)
    with pytest.raises(ContainerError, match="found 1 RAW files beside 1 other"):
        read_sweep(tmp_path)


def test_refuses_pictures_that_do_not_fit(tmp_path: Path) -> None:
    write_jpeg(tmp_path / "a.jpg", 0, None)
    Image.fromarray(srgb8(picture(0))[:20]).save(tmp_path / "b.jpg")
    with pytest.raises(ShapeError, match="found 60 x 20 px, expected 60 x 40"):
        read_sweep(tmp_path)
    (tmp_path / "b.jpg").write_bytes((tmp_path / "a.jpg").read_bytes()[:600])
    with pytest.raises(ContainerError, match=r"b.jpg: cannot be read as a picture"):
        read_sweep(tmp_path)
    (tmp_path / "b.jpg").unlink()
    tifffile.imwrite(tmp_path / "b.tif", np.zeros((*SIZE, 2), np.uint8), photometric="minisblack")
    with pytest.raises(ContainerError, match="expected one picture, grey or RGB"):
        read_sweep(tmp_path)
    with pytest.raises(ConfigError, match="width_px = -1"):
        read_sweep(tmp_path, ImportOptions(width_px=-1))


def test_refuses_raw_that_libraw_does_not_know(tmp_path: Path) -> None:
    for name in ("a.nef", "b.nef"):
        (tmp_path / name).write_bytes(b"II*\0" + bytes(100))
    with pytest.raises(ContainerError, match=r"a.nef: cannot be developed"):
        read_sweep(tmp_path)
