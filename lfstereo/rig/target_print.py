"""Draw a calibration target to scale: SVG or PDF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Bool
from lfstereo.errors import ConfigError
from lfstereo.outputs import atomic_file
from lfstereo.rig.target import Target

_MARGIN_MM = 8.0
_FOOT_MM = 14.0
_POINTS_PER_MM = 72 / 25.4
Box = tuple[float, float, float, float]
"""x, y, width, height in mm from the top left of the page."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A page of filled boxes, black or white, drawn in order, and a caption."""

    width_mm: float
    height_mm: float
    boxes: tuple[tuple[Box, bool], ...]
    """Each with True for black."""
    caption: str
    caption_mm: tuple[float, float]


def print_target(path: Path, target: Target, force: bool = False) -> Sheet:
    """Write a target as ``.svg`` or ``.pdf`` in its true size, with a ruler and its size below the board.

    Raises
    ------
    ConfigError
        If the file name has another suffix.
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    sheet = lay_out(target)
    check_print_suffix(path)
    drawn = _svg(sheet) if path.suffix.lower() == ".svg" else _pdf(sheet)
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(drawn)
    return sheet


def check_print_suffix(path: Path) -> None:
    """Refuse a file name that is neither SVG nor PDF.

    Raises
    ------
    ConfigError
        If the suffix is another.
    """
    if path.suffix.lower() not in (".svg", ".pdf"):
        raise ConfigError(f"{path}: found the suffix '{path.suffix}', expected .svg or .pdf; give such a file name")


def lay_out(target: Target) -> Sheet:
    """Place squares, markers, ruler and caption on a page just large enough."""
    side = target.square_m * 1e3
    black = target.black_squares()
    rows, columns = black.shape
    boxes = [(box, True) for box in _runs(black, _MARGIN_MM, _MARGIN_MM, side)]
    if target.kind == "charuco":
        boxes += _markers(target)
    foot = 2 * _MARGIN_MM + rows * side
    ruler = 10.0 * max(1, int(min(100.0, columns * side) // 10))
    boxes += [((_MARGIN_MM, foot - 0.15, ruler, 0.3), True)]
    boxes += [((_MARGIN_MM + x - 0.1, foot - 1.5, 0.2, 3.0), True) for x in np.arange(0, ruler + 1, 10.0)]
    across, down = target.corners
    kind = f"charuco {target.dictionary}" if target.kind == "charuco" else target.kind
    caption = f"lfstereo {kind}, {across} x {down} corners, square {side:g} mm; ruler {ruler:g} mm, print at 100 %"
    return Sheet(
        width_mm=2 * _MARGIN_MM + columns * side,
        height_mm=foot + _FOOT_MM,
        boxes=tuple(boxes),
        caption=caption,
        caption_mm=(_MARGIN_MM, foot + 6.0),
    )


def _runs(black: Bool, left: float, top: float, side: float) -> list[Box]:
    """Return each row's runs of black cells as boxes."""
    boxes = []
    for row, cells in enumerate(black):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], cells.astype(np.int8), [0]])))
        for start, stop in edges.reshape(-1, 2).tolist():
            boxes.append((left + start * side, top + row * side, (stop - start) * side, side))
    return boxes


def _markers(target: Target) -> list[tuple[Box, bool]]:
    board = target.charuco_board()
    cells = board.getDictionary().markerSize + 2
    boxes: list[tuple[Box, bool]] = []
    numbers, outlines = np.asarray(board.getIds()).ravel(), np.asarray(board.getObjPoints())
    for number, outline in zip(numbers, outlines, strict=True):
        bits = cv2.aruco.generateImageMarker(board.getDictionary(), int(number), cells, borderBits=1)
        x, y = outline[0, :2] * 1e3 + _MARGIN_MM
        side = float(outline[1, 0] - outline[0, 0]) * 1e3
        boxes += [(box, True) for box in _runs(bits == 0, float(x), float(y), side / cells)]
    return boxes


def _svg(sheet: Sheet) -> bytes:
    size = f'width="{sheet.width_mm:g}mm" height="{sheet.height_mm:g}mm"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {sheet.width_mm:g} {sheet.height_mm:g}">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for (x, y, width, height), black in sheet.boxes:
        fill = "black" if black else "white"
        lines.append(f'<rect x="{x:.4f}" y="{y:.4f}" width="{width:.4f}" height="{height:.4f}" fill="{fill}"/>')
    x, y = sheet.caption_mm
    lines += [f'<text x="{x:g}" y="{y:g}" font-family="sans-serif" font-size="3">{sheet.caption}</text>', "</svg>", ""]
    return "\n".join(lines).encode()


def _pdf(sheet: Sheet) -> bytes:
    """Return a one-page PDF 1.4 (ISO 32000-1, sections 7.5 and 8.5)."""
    k, height = _POINTS_PER_MM, sheet.height_mm
    drawn = []
    for (x, y, w, h), black in sheet.boxes:
        drawn.append(f"{0 if black else 1} g {x * k:.4f} {(height - y - h) * k:.4f} {w * k:.4f} {h * k:.4f} re f")
    x, y = sheet.caption_mm
    drawn.append(f"0 g BT /F1 {3 * k:.3f} Tf {x * k:.3f} {(height - y) * k:.3f} Td ({sheet.caption}) Tj ET")
    stream = "\n".join(drawn).encode("ascii")
    box = f"/MediaBox [0 0 {sheet.width_mm * k:.4f} {height * k:.4f}]"
    font = "/Resources << /Font << /F1 5 0 R >> >>"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R {box} /Contents 4 0 R {font} >>".encode(),
        b"<< /Length " + str(len(stream)).encode() + b" >>\nstream\n" + stream + b"\nendstream",
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    out = bytearray(b"%PDF-1.4\n")
    places = []
    for number, content in enumerate(objects, 1):
        places.append(len(out))
        out += f"{number} 0 obj\n".encode() + content + b"\nendobj\n"
    table = len(out)
    out += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n".encode()
    out += b"".join(f"{place:010d} 00000 n \n".encode() for place in places)
    out += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n".encode()
    return bytes(out)
