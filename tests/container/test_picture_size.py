"""Pictures that say they are larger than their bytes can be."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.container.expansion import ALWAYS_ALLOWED_BYTES, LARGEST_RATIO, check_expansion
from lfstereo.container.picture_size import decoded_picture, is_picture
from lfstereo.depth.png16 import read_disparity_png
from lfstereo.errors import ContainerError
from lfstereo.focus.importers import read_sweep
from lfstereo.simulate.stereo_scenes import read_picture
from lfstereo.training.atlas import read_atlas
from lfstereo.viewer.embedding import picture_from_uri


def encoded(suffix: str) -> bytes:
    picture = np.random.default_rng(0).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    return bytes(cv2.imencode(suffix, picture)[1])


def png_of(width: int, height: int) -> bytes:
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))


def jpeg_of(width: int, height: int) -> bytes:
    data = bytearray(encoded(".jpg"))
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".bmp", ".ppm"])
def test_known_pictures_are_decoded(suffix: str) -> None:
    assert decoded_picture(encoded(suffix), cv2.IMREAD_COLOR, "a").shape == (12, 16, 3)


@pytest.mark.parametrize("data", [png_of(60_000, 60_000), jpeg_of(65_000, 65_000)])
def test_bombs_are_refused_before_they_are_decoded(data: bytes) -> None:
    with pytest.raises(ContainerError, match=r"a: says that its \d+ bytes hold \d+, expected at most 268435456"):
        decoded_picture(data, cv2.IMREAD_COLOR, "a")


def test_every_reader_of_pictures_refuses_them(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.png"
    bomb.write_bytes(png_of(60_000, 60_000))
    (tmp_path / "other.png").write_bytes(bomb.read_bytes())
    readers: list[Callable[[], object]] = [
        lambda: read_disparity_png(bomb),
        lambda: read_sweep(tmp_path),
        lambda: read_atlas(str(tmp_path)),
        lambda: read_picture(bomb),
        lambda: picture_from_uri("data:image/jpeg;base64," + base64.b64encode(bomb.read_bytes()).decode()),
    ]
    for read in readers:
        with pytest.raises(ContainerError, match="made to fill the memory"):
            read()


def test_large_tiff_head(tmp_path: object) -> None:
    data = bytearray(encoded(".tif"))
    order = "<" if data[:2] == b"II" else ">"
    (start,) = struct.unpack(f"{order}I", data[4:8])
    (count,) = struct.unpack(f"{order}H", data[start : start + 2])
    for at in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind = struct.unpack(f"{order}HH", data[at : at + 4])
        if tag in (256, 257):
            data[at : at + 12] = struct.pack(f"{order}HHII", tag, 4, 1, 100_000)
            assert kind in (3, 4)
    with pytest.raises(ContainerError, match="says that its"):
        is_picture(bytes(data), "a")


@pytest.mark.parametrize("data", [b"", b"GIF89a", b"\xff\xd8\xff", b"BM", b"II*\0", png_of(0, 5)])
def test_what_is_no_picture(data: bytes) -> None:
    assert not is_picture(data, "a")
    assert decoded_picture(data, cv2.IMREAD_COLOR, "a") is None


def test_damaged_content_gives_no_picture() -> None:
    assert decoded_picture(png_of(12, 16), cv2.IMREAD_COLOR, "a") is None


def test_the_limit_is_256_mib_or_a_hundred_times_the_file() -> None:
    check_expansion(1, ALWAYS_ALLOWED_BYTES, "a")
    check_expansion(ALWAYS_ALLOWED_BYTES, LARGEST_RATIO * ALWAYS_ALLOWED_BYTES, "a")
    with pytest.raises(ContainerError, match="made to fill the memory"):
        check_expansion(1, ALWAYS_ALLOWED_BYTES + 1, "a")
