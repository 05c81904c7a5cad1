"""Write containers and captures that Lytro's own layouts allow and other programs open."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfstereo.arrays import Mosaic, check_shape
from lfstereo.container.capture import Capture
from lfstereo.container.fields import Json
from lfstereo.container.format import ALIGNMENT, DATA_START, FILE_HEAD, Payload, section_bytes
from lfstereo.container.layouts import (
    GENERATOR,
    f01_toc,
    illum_toc,
    private_metadata,
    public_metadata,
    sidecar_metadata,
)
from lfstereo.container.metadata import FrameMetadata
from lfstereo.container.packing import pack
from lfstereo.errors import ContainerError
from lfstereo.outputs import atomic_file

THUMBNAIL_SIZE_PX = (704, 480)
"""(width, height) of the preview in an Illum's files."""
_EXTRA_REFERENCES = (
    "aberrationCorrectionMetadataRef",
    "aberrationCorrectionRef",
    "exposureHistogramRef",
    "geometryCorrectionRef",
    "reconstructionFilterMetadataRef",
    "reconstructionFilterRef",
)
"""Factory data of an Illum whose contents are not public; written as JSON objects that say they are empty."""
_NO_HOT_PIXELS = bytes(4)
"""As HOTPIXEL.BIN: the number of hot pixels as uint32, then none."""


def write_container(
    path: Path, toc: Json, sections: Sequence[Payload], toc_first: bool = False, force: bool = False
) -> None:
    """Write a Lytro container; it appears whole or not at all.

    Parameters
    ----------
    path
        File to write.
    toc
        Table of contents; it refers to sections by `reference`.
    sections
        Data of the content sections, in order.
    toc_first
        Put the table of contents before the sections, as the F01 does; the Illum puts it last.
    force
        Replace an existing file.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    contents = [section_bytes("content", data) for data in sections]
    table = section_bytes("toc", _toc_bytes(toc))
    with atomic_file(path, force) as scratch, scratch.open("wb") as file:
        file.write(FILE_HEAD)
        for pieces in [table, *contents] if toc_first else [*contents, table]:
            for piece in pieces:
                file.write(piece)


def reference(data: Payload) -> str:
    """Return the name by which a table of contents refers to a section.

    Examples
    --------
    >>> reference(b"abc")
    'sha1-a9993e364706816aba3e25717850c26c9cd0d89d'
    """
    return f"sha1-{hashlib.sha1(data, usedforsecurity=False).hexdigest()}"


def write_capture(path: Path, capture: Capture, force: bool = False) -> None:
    """Write a raw frame as a camera would.

    The suffix chooses the form, upper or lower case: ``.LFR`` or ``.LFP`` a container with raw frame, metadata and
    serial number in the layout of the capture's camera; ``.RAW`` the bare packed frame with its text file
    (``MOD_0001.RAW`` and ``MOD_0001.TXT``) beside it, as white images come.

    Parameters
    ----------
    path
        File to write.
    capture
        The frame; its metadata give the packing.
    force
        Replace existing files.

    Raises
    ------
    ContainerError
        If the suffix is another, or a pixel does not fit the packing.
    ShapeError
        If the mosaic does not have the size that the metadata tell.
    OutputError
        If a file exists and ``force`` is not set, or cannot be written.
    """
    metadata = capture.metadata
    check_shape(f"{capture.source}: mosaic", capture.mosaic, (metadata.height, metadata.width))
    if path.suffix.lower() not in (".lfr", ".lfp", ".raw"):
        raise ContainerError(
            f"{path}: found the suffix '{path.suffix}', expected .LFR, .LFP or .RAW; rename the output"
        )
    raw = pack(capture.mosaic, metadata.bits_per_pixel, metadata.endianness, capture.source).data
    if path.suffix.lower() == ".raw":
        _write_bare(path, raw, metadata, force)
    elif metadata.model == "F01":
        _write_f01(path, raw, metadata, force)
    else:
        _write_illum(path, raw, capture, force)


def _write_bare(path: Path, raw: Payload, metadata: FrameMetadata, force: bool) -> None:
    sidecar = path.with_suffix(".TXT" if path.suffix.isupper() else ".txt")
    with atomic_file(path, force) as scratch, atomic_file(sidecar, force) as scratch_sidecar:
        scratch.write_bytes(raw)
        scratch_sidecar.write_bytes(_json_bytes(sidecar_metadata(metadata)))


def _write_f01(path: Path, raw: Payload, metadata: FrameMetadata, force: bool) -> None:
    parts = {
        "imageRef": raw,
        "metadataRef": _json_bytes(public_metadata(metadata)),
        "privateMetadataRef": _json_bytes(private_metadata(metadata)),
    }
    toc = f01_toc(metadata, {key: reference(data) for key, data in parts.items()})
    write_container(path, toc, list(parts.values()), toc_first=True, force=force)


def _write_illum(path: Path, raw: Payload, capture: Capture, force: bool) -> None:
    metadata = capture.metadata
    preview = _thumbnail(capture.mosaic, metadata)
    parts: dict[str, Payload] = {
        "imageRef": raw,
        "metadataRef": _json_bytes(public_metadata(metadata)),
        "privateMetadataRef": _json_bytes(private_metadata(metadata)),
        "hotPixelRef": _NO_HOT_PIXELS,
    }
    parts |= {key: _json_bytes({"generator": GENERATOR, "empty": key}) for key in _EXTRA_REFERENCES}
    width, height = THUMBNAIL_SIZE_PX
    thumbnail: Json = {
        "imageRef": reference(preview),
        "width": width,
        "height": height,
        "colorSpace": "sRGB",
        "representation": "jpeg",
    }
    toc = illum_toc(metadata, {key: reference(data) for key, data in parts.items()}, thumbnail)
    write_container(path, toc, [*parts.values(), preview], force=force)


def _json_bytes(value: Json) -> bytes:
    return json.dumps(value, indent="\t", allow_nan=False).encode("ascii")


def _toc_bytes(toc: Json) -> bytes:
    """Return the table as JSON whose section ends with 5 zero bytes of padding, which imageio's reader counts on."""
    text = _json_bytes(toc)
    return text + b"\n" * (-(DATA_START + len(text) + 5) % ALIGNMENT)


def _thumbnail(mosaic: Mosaic, metadata: FrameMetadata) -> bytes:
    """Return a JPEG preview: the 2 x 2 Bayer cells reduced to the preview's size, white-balanced."""
    import cv2

    gains = dict(zip(("r", "gr", "gb", "b"), metadata.white_balance, strict=True))
    cells: dict[str, list[np.ndarray]] = {"r": [], "g": [], "b": []}
    for place, colour in enumerate(metadata.bayer):
        small = cv2.resize(mosaic[place // 2 :: 2, place % 2 :: 2], THUMBNAIL_SIZE_PX, interpolation=cv2.INTER_AREA)
        level = (small.astype(np.float32) - metadata.black[0]) / (metadata.white[0] - metadata.black[0])
        cells[colour].append(level * gains["gr" if colour == "g" else colour])
    bgr = np.stack([np.mean(cells[colour], axis=0) for colour in "bgr"], axis=-1)
    _, data = cv2.imencode(".jpg", np.round(255 * np.clip(bgr, 0, 1) ** (1 / 2.2)).astype(np.uint8))
    return bytes(data)
