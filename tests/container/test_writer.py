"""What the writer makes, read by lfstereo and by imageio's independent reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container import Capture, read_capture, read_container, write_capture
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.writer import reference, write_container
from lfstereo.errors import ContainerError, OutputError, ShapeError


@pytest.mark.parametrize("name", ["a.LFR", "a.lfr", "a.LFP", "MOD_0001.RAW", "mod_0001.raw"])
def test_illum_round_trip(tmp_path: Path, illum_capture: Capture, name: str) -> None:
    write_capture(tmp_path / name, illum_capture)
    found = read_capture(tmp_path / name)
    assert np.array_equal(found.mosaic, illum_capture.mosaic)
    assert found.mosaic.dtype == np.uint16
    assert found.metadata == illum_capture.metadata
    assert found.source == str(tmp_path / name)


@pytest.mark.parametrize("name", ["a.lfp", "a.RAW"])
@pytest.mark.parametrize("white", [False, True])
def test_f01_round_trip_with_tags(tmp_path: Path, f01_capture: Capture, name: str, white: bool) -> None:
    capture = replace(f01_capture, metadata=replace(f01_capture.metadata, is_white_image=white))
    write_capture(tmp_path / name, capture)
    assert read_capture(tmp_path / name).metadata == capture.metadata


def test_white_image_of_an_illum_in_a_container_keeps_its_tag(tmp_path: Path, illum_capture: Capture) -> None:
    white = replace(illum_capture, metadata=replace(illum_capture.metadata, is_white_image=True))
    write_capture(tmp_path / "a.LFR", white)
    assert read_capture(tmp_path / "a.LFR").metadata == white.metadata


def test_bare_frame_and_its_text_file_have_the_same_case(tmp_path: Path, illum_capture: Capture) -> None:
    write_capture(tmp_path / "MOD_0001.RAW", illum_capture)
    write_capture(tmp_path / "b.raw", illum_capture)
    assert {path.name for path in tmp_path.iterdir()} == {"MOD_0001.RAW", "MOD_0001.TXT", "b.raw", "b.txt"}
    assert (tmp_path / "b.raw").stat().st_size == 48 * 40 * 10 // 8


@pytest.mark.parametrize("toc_first", [True, False])
def test_container_of_any_content(tmp_path: Path, toc_first: bool) -> None:
    data = [b"abc", b"", bytes(16)]
    toc = {"views": [], "here": {"thingRef": reference(data[0])}}
    write_container(tmp_path / "a.lfp", toc, data, toc_first=toc_first)
    container = read_container(tmp_path / "a.lfp")
    contents = [section for section in container.sections if section.kind == "content"]
    assert container.toc == toc
    assert [container.read(section) for section in contents] == data
    assert container.find(reference(data[0])) == contents[0]
    assert container.sections[0 if toc_first else -1].kind == "toc"


def test_existing_files_are_kept_without_force(tmp_path: Path, illum_capture: Capture) -> None:
    for name in ("a.LFR", "b.RAW", "c.TXT"):
        (tmp_path / name).write_text("mine")
    for name in ("a.LFR", "b.RAW", "c.RAW"):
        with pytest.raises(OutputError, match="exists already"):
            write_capture(tmp_path / name, illum_capture)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(
        ("a.LFR", "b.RAW", "c.TXT"), "mine"
    )
    write_capture(tmp_path / "a.LFR", illum_capture, force=True)
    assert read_capture(tmp_path / "a.LFR").metadata == illum_capture.metadata


def test_other_suffix_is_refused(tmp_path: Path, illum_capture: Capture) -> None:
    with pytest.raises(ContainerError, match=r"found the suffix '\.png', expected \.LFR, \.LFP or \.RAW"):
        write_capture(tmp_path / "a.png", illum_capture)


def test_mosaic_of_another_size_is_refused(tmp_path: Path, illum_capture: Capture) -> None:
    with pytest.raises(ShapeError, match=r"test: mosaic: found an array of shape \(20, 48\), expected \(40, 48\)"):
        write_capture(tmp_path / "a.LFR", replace(illum_capture, mosaic=illum_capture.mosaic[:20]))


def test_pixels_that_do_not_fit_leave_nothing(tmp_path: Path, illum_capture: Capture) -> None:
    with pytest.raises(ContainerError, match="test: found a mosaic of uint16 up to 5000"):
        write_capture(tmp_path / "a.LFR", replace(illum_capture, mosaic=np.full((40, 48), 5000, np.uint16)))
    assert not list(tmp_path.iterdir())


def full_frame(camera: str) -> Capture:
    metadata = replace(read_camera_profile(camera), serial="B1")
    shape = (metadata.height, metadata.width)
    pixels = np.random.default_rng(3).integers(0, 1 << metadata.bits_per_pixel, shape, dtype=np.uint16)
    return Capture(pixels, metadata, "test")


@pytest.mark.slow
def test_imageio_reads_the_same_full_illum_frame(tmp_path: Path) -> None:
    import imageio.v2 as iio

    capture = full_frame("lytro-illum")
    write_capture(tmp_path / "a.lfr", capture)
    image = iio.imread(tmp_path / "a.lfr", format="LYTRO-LFR")
    assert np.array_equal(np.rint(np.asarray(image) * 1023).astype(np.uint16), capture.mosaic)
    assert image.meta["metadata"]["camera"]["model"] == "ILLUM"
    assert image.meta["privateMetadata"]["camera"]["serialNumber"] == "B1"
    assert image.meta["thumbnail"]["image"].shape == (480, 704, 3)
    assert np.array_equal(read_capture(tmp_path / "a.lfr").mosaic, capture.mosaic)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(  # imageio leaves the text file open
    ("camera", "name", "format_name", "scale"),
    [
        ("lytro-f01", "a.lfp", "LYTRO-LFP", 4095),
        ("lytro-f01", "a.raw", "LYTRO-F01-RAW", 4095),
        ("lytro-illum", "a.raw", "LYTRO-ILLUM-RAW", 1023),
    ],
)
def test_imageio_reads_the_other_forms(tmp_path: Path, camera: str, name: str, format_name: str, scale: int) -> None:
    import imageio.v2 as iio

    capture = full_frame(camera)
    write_capture(tmp_path / name, capture)
    image = iio.imread(tmp_path / name, format=format_name)
    assert np.array_equal(np.rint(np.asarray(image) * scale).astype(np.uint16), capture.mosaic)
    assert np.array_equal(read_capture(tmp_path / name).mosaic, capture.mosaic)
