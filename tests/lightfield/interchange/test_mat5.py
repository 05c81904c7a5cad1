"""Arrays of MAT-files of version 5 as SciPy writes them, and files that lie."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from lfstereo.lightfield.interchange.mat5 import read_array

ARRAY = np.arange(24, dtype=np.uint16).reshape(2, 3, 4)


def saved(path: Path, compressed: bool = False, **arrays: object) -> Path:
    target = io.BytesIO()
    scipy.io.savemat(target, arrays, do_compression=compressed)
    path.write_bytes(target.getvalue())
    return path


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"])
def test_as_scipy_wrote_it(tmp_path: Path, kind: str, compressed: bool) -> None:
    path = saved(tmp_path / "a.mat", compressed, other="text", LF=ARRAY.astype(kind), later={"x": 1.0})
    found = read_array(path, "LF")
    assert found is not None and found.dtype == kind
    np.testing.assert_array_equal(found, ARRAY)
    assert read_array(path, "none") is None


def test_the_other_byte_order_and_numbers_in_fewer_bytes(tmp_path: Path) -> None:
    """As MATLAB stores whole doubles: class double, type uint8; here big-endian."""
    body = struct.pack(">IIII", 6, 8, 6, 0) + struct.pack(">IIii", 5, 8, 1, 3)
    body += struct.pack(">HH4s", 2, 1, b"LF\0\0") + struct.pack(">HH4s", 3, 2, b"\x01\x02\x03\0")
    (tmp_path / "a.mat").write_bytes(bytes(126) + b"MI" + struct.pack(">II", 14, len(body)) + body)
    found = read_array(tmp_path / "a.mat", "LF")
    assert found is not None and found.dtype == np.float64
    assert found.tolist() == [[1.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (126, b"??", "no head of a MAT-file"),
        (132, b"\xff\xff\xff\x7f", "an element of 2147483647 bytes where"),
        (144, b"\x01", "is no array of real numbers"),
        (145, b"\x08", "is no array of real numbers"),
        (160, b"\xff\xff\xff\x7f", "LF of size 2147483647 x 3 x 4 holds 48 bytes"),
        (160, b"\xff\xff\xff\xff", "LF of size -1 x 3 x 4 holds 48 bytes"),
        (140, b"\x04", "LF without flags or dimensions"),
    ],
)
def test_heads_that_lie(tmp_path: Path, at: int, value: bytes, message: str) -> None:
    path = saved(tmp_path / "a.mat", LF=ARRAY)
    data = bytearray(path.read_bytes())
    assert data[160:172] == struct.pack("<3i", 2, 3, 4)
    data[at : at + len(value)] = value
    path.write_bytes(data)
    with pytest.raises(ValueError, match=message):
        read_array(path, "LF")


def test_damaged_and_cut_off_compression(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mat", True, LF=ARRAY)
    data = path.read_bytes()
    path.write_bytes(data[:140] + b"\xff" + data[141:])
    with pytest.raises(ValueError, match="damaged compression"):
        read_array(path, "LF")
    short = data[136:-12]
    path.write_bytes(data[:132] + struct.pack("<I", len(short)) + short)
    with pytest.raises(ValueError, match="cut off in a compressed part"):
        read_array(path, "LF")
    path.write_bytes(data + b"\0\0\0")
    with pytest.raises(ValueError, match="cut off in the head of an element"):
        read_array(path, "none")
