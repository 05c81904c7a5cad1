"""Packed bytes: known values, exact round trips, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.container.packing import PACKINGS, pack, packed_size, unpack
from lfstereo.errors import ContainerError, ShapeError


def test_known_bytes_of_ten_bits() -> None:
    # Byte 4 = 0b11_10_01_00: pixel 0 takes its low bits from bits 0-1, pixel 3 from bits 6-7.
    data = bytes([0x00, 0x01, 0x80, 0xFF, 0b11_10_01_00])
    assert unpack(data, 4, 1, 10, "little", "x").tolist() == [[0, 5, 0x202, 1023]]
    assert pack(np.array([[0, 5, 0x202, 1023]], np.uint16), 10, "little", "x").tobytes() == data


def test_known_bytes_of_twelve_bits() -> None:
    data = bytes([0xAB, 0xCD, 0xEF])
    assert unpack(data, 2, 1, 12, "big", "x").tolist() == [[0xABC, 0xDEF]]
    assert pack(np.array([[0xABC, 0xDEF]], np.uint16), 12, "big", "x").tobytes() == data


def test_known_bytes_of_eight_and_sixteen_bits() -> None:
    assert unpack(b"\x01\xff", 2, 1, 8, "little", "x").tolist() == [[1, 255]]
    assert unpack(b"\x01\x02", 1, 1, 16, "little", "x").tolist() == [[0x201]]
    assert unpack(b"\x01\x02", 1, 1, 16, "big", "x").tolist() == [[0x102]]


@pytest.mark.parametrize(("bits", "endianness"), list(PACKINGS))
@pytest.mark.parametrize(("width", "height"), [(4, 1), (60, 34), (1024, 300)])
def test_round_trip_is_exact(bits: int, endianness: str, width: int, height: int) -> None:
    pixels = np.random.default_rng(bits).integers(0, 1 << bits, (height, width), dtype=np.uint16)
    packed = pack(pixels, bits, endianness, "x")
    assert packed.size == packed_size(width, height, bits, endianness, "x") == width * height * bits // 8
    assert np.array_equal(unpack(packed.data, width, height, bits, endianness, "x"), pixels)


def test_a_view_of_a_larger_mosaic_packs_the_same() -> None:
    large = np.random.default_rng(0).integers(0, 1024, (20, 40), dtype=np.uint16)
    view = large[2:18, 4:36]
    assert np.array_equal(pack(view, 10, "little", "x"), pack(view.copy(), 10, "little", "x"))


def test_unknown_packing_is_refused() -> None:
    with pytest.raises(
        ContainerError, match=r"A\.RAW: found pixels of 10 bits big-endian, expected one of .*12 bits big"
    ):
        unpack(bytes(5), 4, 1, 10, "big", "A.RAW")


def test_part_of_a_group_is_refused() -> None:
    with pytest.raises(ContainerError, match="found 3 x 1 pixels of 10 bits, expected a multiple of 4 pixels"):
        packed_size(3, 1, 10, "little", "A.RAW")


def test_wrong_number_of_bytes_is_refused() -> None:
    with pytest.raises(ContainerError, match="found a raw frame of 6 bytes, expected 5 for 4 x 1 pixels of 10 bits"):
        unpack(bytes(6), 4, 1, 10, "little", "A.RAW")


@pytest.mark.parametrize(
    "mosaic", [np.full((1, 4), 1024, np.uint16), np.zeros((1, 4), np.float32), np.full((1, 4), -1, np.int32)]
)
def test_pixels_that_do_not_fit_are_refused(mosaic: np.ndarray) -> None:
    with pytest.raises(ContainerError, match="expected uint16 digital numbers below 1024; round and clip it first"):
        pack(mosaic, 10, "little", "A.RAW")


def test_mosaic_with_colours_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"mosaic: found an array of shape \(4, 4, 3\)"):
        pack(np.zeros((4, 4, 3), np.uint16), 10, "little", "A.RAW")
