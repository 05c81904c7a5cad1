"""Packing of any frame, and unpacking of any bytes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lfstereo.container.packing import PACKINGS, pack, packed_size, unpack

packings = st.sampled_from(sorted(PACKINGS))
sides = st.integers(1, 9)


@given(packings, sides, sides, st.data())
def test_pixels_come_back_from_their_bytes(
    packing: tuple[int, str], groups: int, rows: int, data: st.DataObject
) -> None:
    bits, endianness = packing
    width = groups * PACKINGS[packing][1]
    pixels = data.draw(arrays(np.uint16, (rows, width), elements=st.integers(0, (1 << bits) - 1)))
    packed = pack(pixels, bits, endianness, "a")
    assert packed.size == packed_size(width, rows, bits, endianness, "a")
    np.testing.assert_array_equal(unpack(packed.tobytes(), width, rows, bits, endianness, "a"), pixels)


@given(packings, sides, sides, st.data())
def test_bytes_come_back_from_their_pixels(
    packing: tuple[int, str], groups: int, rows: int, data: st.DataObject
) -> None:
    """No two bytes mean the same pixels: nothing of a file is thrown away."""
    bits, endianness = packing
    width = groups * PACKINGS[packing][1]
    size = packed_size(width, rows, bits, endianness, "a")
    packed = data.draw(st.binary(min_size=size, max_size=size))
    assert pack(unpack(packed, width, rows, bits, endianness, "a"), bits, endianness, "a").tobytes() == packed
