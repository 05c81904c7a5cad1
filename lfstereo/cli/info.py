"""The command ``lfstereo info``: what a capture holds."""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lfstereo.container.serials import camera_mark

if TYPE_CHECKING:
    from lfstereo.container.describe import Description
    from lfstereo.container.metadata import FrameMetadata


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help=".LFR or .LFP container, or .RAW with its .TXT beside it"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Print what the file holds.

    Raises
    ------
    ContainerError
        If the file is no Lytro file or is cut off; after printing, if a section is damaged.
    MetadataError
        If the metadata lack a field or hold a value that cannot be.
    """
    from lfstereo.container.describe import describe
    from lfstereo.errors import ContainerError

    found = describe(arguments.file)
    print(json.dumps(dataclasses.asdict(found)) if arguments.json else "\n".join(_lines(found)))
    damaged = [section for section in found.sections if not section.intact]
    if damaged:
        raise ContainerError(
            f"{found.path}: byte {damaged[0].offset}: found {damaged[0].what} whose SHA-1 differs, expected "
            f"{damaged[0].sha1} ({len(damaged)} damaged in all); copy the file again from the camera"
        )
    return 0


def _lines(found: Description) -> Iterator[str]:
    yield f"{found.path}: {found.what}"
    if found.metadata is not None:
        yield ""
        width = max(len(label) for label, _ in _rows(found.metadata))
        for label, text in _rows(found.metadata):
            yield f"  {label:<{width}}  {text}"
    if found.sections:
        yield ""
        yield f"  {'section':<7}  {'byte':>10}  {'bytes':>10}  {'SHA-1':<5}  holds"
        for section in found.sections:
            intact = "ok" if section.intact else "BAD"
            yield f"  {section.kind:<7}  {section.offset:>10}  {section.length:>10}  {intact:<5}  {section.what}"
    for path in found.missing:
        yield f"  not in this file: {path}"
    if not found.has_raw:
        yield "  no raw lenslet image, so it cannot be decoded: give the original LFR or LFP"


def _rows(m: FrameMetadata) -> Iterator[tuple[str, str]]:
    x, y, z = (1e6 * value for value in m.lenslets.offset_m)
    pitch_px = m.lenslets.pitch_m / m.pixel_pitch_m
    exposure = "" if m.exposure_s is None else f", {1e3 * m.exposure_s:.3g} ms"
    cct = "" if m.awb_cct_k is None else f" ({m.awb_cct_k:.0f} K)"
    yield "camera", f"{m.make} {m.model}, serial {_serial(m.serial)}, firmware {m.firmware or 'not told'}"
    yield "taken", m.captured_at or "not told"
    yield "frame", f"{m.width} x {m.height} px, {m.bits_per_pixel} bits {m.endianness}-endian, Bayer {m.bayer}"
    yield "levels", f"black {_four(m.black)}, white {_four(m.white)} (r, gr, gb, b)"
    yield "exposure", f"ISO {m.iso:g}{exposure}, bias {m.exposure_bias_ev:+.3f} EV"
    yield "white balance", f"{_four(m.white_balance)} (r, gr, gb, b){cct}"
    steps = f"zoom step {m.lens.zoom_step}, focus step {m.lens.focus_step}"
    yield "lens", f"{1e3 * m.lens.focal_length_m:.2f} mm f/{m.lens.f_number:.2f}, {steps}"
    yield (
        "lenslets",
        f"pitch {1e6 * m.lenslets.pitch_m:.2f} um ({pitch_px:.4f} px of {1e6 * m.pixel_pitch_m:.2f} um), rotation "
        f"{1e3 * m.lenslets.rotation_rad:+.3f} mrad, scale {m.lenslets.scale_x:.6f} {m.lenslets.scale_y:.6f}, offset "
        f"{x:.2f} {y:.2f} {z:.2f} um",
    )


def _four(values: tuple[float, float, float, float]) -> str:
    return " ".join(f"{value:.4g}" for value in values)


def _serial(serial: str) -> str:
    return f"{serial} (mark {camera_mark(serial)})" if serial else "not told"
