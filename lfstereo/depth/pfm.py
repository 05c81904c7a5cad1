"""Disparity as PFM files, as Middlebury, HCI and SceneFlow exchange it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfstereo.arrays import Bool, Float32, check_shape
from lfstereo.errors import InputError, ShapeError
from lfstereo.outputs import atomic_file

_MAX_HEADER_BYTES = 4096
_MAX_SIDE = 1 << 16


def write_pfm(path: Path, values: Float32, valid: Bool | None = None, force: bool = False) -> None:
    """Write one float per pixel, little-endian, unknown pixels as infinity.

    Parameters
    ----------
    path
        The file to write.
    values
        ``(V, U)`` float32.
    valid
        ``(V, U)``, or ``None`` where every value is known.
    force
        Replace an existing file.

    Raises
    ------
    ShapeError
        If ``values`` is no image, or ``valid`` has another shape.
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.

    References
    ----------
    Debevec, "PFM portable float map" (2001): ``Pf``, width height, scale (negative = little-endian), rows from
    the bottom up; Scharstein and Szeliski, Middlebury stereo evaluation: infinity = unknown.
    """
    check_shape(f"{path}: values", values, (None, None))
    if valid is not None and valid.shape != values.shape:
        raise ShapeError(f"{path}: valid has shape {valid.shape}, expected {values.shape} as the values")
    known = values if valid is None else np.where(valid, values, np.inf)
    rows, columns = values.shape
    with atomic_file(path, force) as scratch:
        payload = np.ascontiguousarray(np.flipud(known), dtype="<f4").tobytes()
        scratch.write_bytes(f"Pf\n{columns} {rows}\n-1.0\n".encode("ascii") + payload)


def read_pfm(path: Path) -> tuple[Float32, Bool]:
    """Read a PFM file of one channel.

    Returns
    -------
    tuple of Float32 and Bool
        Values ``(V, U)``, 0 where unknown, and where they are known (finite).

    Raises
    ------
    InputError
        If the file cannot be read, its header is damaged, it has three channels, or pixels are missing.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a PFM file") from error
    magic, size, scale, start = _header_lines(path, content)
    if magic != "Pf":
        raise InputError(f"{path}: starts with {magic[:12]!r}, expected 'Pf' (PFM of one channel)")
    columns, rows = _size(path, size)
    order = _byte_order(path, scale)
    found, wanted = len(content) - start, rows * columns * 4
    if found != wanted:
        raise InputError(f"{path}: {columns} x {rows} px need {wanted} bytes of pixels, found {found}; copy it again")
    image = np.frombuffer(content, order + "f4", offset=start).reshape(rows, columns)[::-1]
    valid = np.isfinite(image)
    return np.where(valid, image, 0).astype(np.float32), valid


def _header_lines(path: Path, content: bytes) -> tuple[str, str, str, int]:
    """Return magic, size, scale and where the pixels start; comment lines are skipped."""
    lines: list[str] = []
    start = 0
    while len(lines) < 3:
        end = content.find(b"\n", start, _MAX_HEADER_BYTES)
        if end < 0:
            raise InputError(f"{path}: the PFM header ends after {len(lines)} of 3 lines; copy the file again")
        line = content[start:end].decode("latin-1").strip()
        start = end + 1
        if not line.startswith("#"):
            lines.append(line)
    return lines[0], lines[1], lines[2], start


def _size(path: Path, line: str) -> tuple[int, int]:
    parts = line.split()
    if len(parts) != 2 or not all(p.isascii() and p.isdigit() and 0 < int(p) <= _MAX_SIDE for p in parts):
        raise InputError(f"{path}: PFM size is {line[:40]!r}, expected width and height of 1 to {_MAX_SIDE} px")
    return int(parts[0]), int(parts[1])


def _byte_order(path: Path, line: str) -> str:
    try:
        scale = float(line)
    except ValueError:
        scale = 0.0
    if scale == 0 or not np.isfinite(scale):
        raise InputError(f"{path}: PFM scale is {line[:40]!r}, expected a number below 0 (little-endian) or above 0")
    return "<" if scale < 0 else ">"
