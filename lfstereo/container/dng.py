"""Raw mosaics as DNG, which raw converters open, and back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from lfstereo.arrays import Float64
from lfstereo.container.capture import Capture
from lfstereo.container.expansion import check_expansion
from lfstereo.container.layouts import frame_parameters, private_metadata, public_metadata
from lfstereo.container.metadata import FrameMetadata, parse_metadata
from lfstereo.container.reader import parse_json
from lfstereo.container.serials import is_mark
from lfstereo.errors import ContainerError, InputError, MetadataError
from lfstereo.outputs import atomic_file, check_absent, check_space

_BYTE, _ASCII, _SHORT, _RATIONAL, _SRATIONAL = 1, 2, 3, 5, 10
_CFA_PHOTOMETRIC = 32803
_D65_ILLUMINANT = 21
_COLOUR_CODES = {"r": 0, "g": 1, "b": 2}
_XYZ_TO_SRGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
_SRGB_TO_D50 = np.array(
    [[0.4360747, 0.3850649, 0.1430804], [0.2225045, 0.7168786, 0.0606169], [0.0139322, 0.0971045, 0.7141733]]
)
_DENOMINATOR = 10000
_PRIVATE_DATA = 50740
_PRIVATE_NAME = b"lfstereo\0"


def write_dng(path: Path, capture: Capture, force: bool = False) -> None:
    """Write the raw mosaic of a capture as an uncompressed DNG; the digital numbers stay as they are.

    Bayer pattern, black and white levels, white balance, colour matrices and exposure bias of the camera go along, so
    that a raw converter shows the lenslet image in the camera's colours; and all of the metadata as the camera writes
    them, for :func:`read_dng`.

    Raises
    ------
    MetadataError
        If the colour matrix cannot be inverted or a gain of the white balance is not positive.
    OutputError
        If the file exists and ``force`` is not set, or it cannot be written, or the disk has no room for it.

    References
    ----------
    Adobe, "Digital Negative (DNG) Specification" 1.4.0.0 (2012), chapter 4: the tags and their types.
    """
    check_absent(path, force)
    tags = _tags(capture.metadata, capture.source)
    check_space(path, capture.mosaic.size * 2)
    with atomic_file(path, force) as scratch:
        tifffile.imwrite(
            scratch,
            capture.mosaic,
            photometric=_CFA_PHOTOMETRIC,
            subfiletype=0,
            rowsperstrip=capture.mosaic.shape[0],
            metadata=None,
            software="lfstereo",
            extratags=tags,
        )


def read_dng(path: Path) -> Capture:
    """Read a capture from a DNG that :func:`write_dng` wrote.

    Raises
    ------
    ContainerError
        If the file is damaged, or another program wrote it: then it lacks what a decode needs to know of the lens.
    MetadataError
        If the metadata in it hold a value that cannot be.
    """
    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages.first
            check_expansion(path.stat().st_size, int(page.nbytes), str(path))
            private = page.tags.valueof(_PRIVATE_DATA)
            mosaic = np.asarray(page.asarray()) if isinstance(private, bytes) else None
    except InputError:
        raise
    except Exception as error:  # damaged files fail in many ways there
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ContainerError(f"{path}: not a readable DNG ({reason}); export the capture again") from error
    if mosaic is None or not private.startswith(_PRIVATE_NAME):
        raise ContainerError(
            f"{path}: found a DNG without a light-field camera's metadata, expected one that lfstereo wrote; give the "
            "camera's own file"
        )
    stored = parse_json(private[len(_PRIVATE_NAME) :], f"{path}: private data")
    public, own = stored.get("public"), stored.get("private")
    if not isinstance(public, dict) or not isinstance(own, dict):
        raise ContainerError(f"{path}: found private data without metadata, expected both; export the capture again")
    metadata = parse_metadata(public, own, str(path))
    if mosaic.dtype != np.uint16 or mosaic.shape != (metadata.height, metadata.width):
        raise ContainerError(
            f"{path}: found a mosaic of {mosaic.dtype} with shape {mosaic.shape}, expected uint16 of "
            f"{metadata.height} x {metadata.width} as its metadata say; export the capture again"
        )
    return Capture(mosaic, metadata, str(path))


def colour_matrix(metadata: FrameMetadata, where: str) -> Float64:
    """Return ``(3, 3)`` XYZ of a D65 white to the camera's own RGB, as DNG's ``ColorMatrix1`` has it.

    Raises
    ------
    MetadataError
        If the colour matrix cannot be inverted or a gain of the white balance is not positive.
    """
    ccm = np.asarray(metadata.ccm, np.float64).reshape(3, 3)
    gains = _gains(metadata)
    if abs(float(np.linalg.det(ccm))) < 1e-3 or not (gains > 0).all():
        raise MetadataError(
            f"{where}: found the colour matrix {ccm.round(3).tolist()} and white balance {gains.tolist()}, expected a "
            "matrix with an inverse and positive gains; check the metadata"
        )
    return np.asarray(np.linalg.inv(ccm) / gains[:, None] @ _XYZ_TO_SRGB, np.float64)


def _gains(metadata: FrameMetadata) -> Float64:
    red, green_r, green_b, blue = metadata.white_balance
    return np.array([red, (green_r + green_b) / 2, blue])


def _tags(metadata: FrameMetadata, where: str) -> list[tuple[int, int, int, Any, bool]]:
    """Return the tags of a DNG: code, TIFF type, count, value, for the first page only."""
    m = metadata
    by_site = dict(zip(("r", "gr", "gb", "b"), zip(m.black, m.white, strict=True), strict=True))
    red_row = m.bayer.index("r") // 2
    sites = [c if c != "g" else ("gr" if k // 2 == red_row else "gb") for k, c in enumerate(m.bayer)]
    black = [by_site[site][0] for site in sites]
    matrix = colour_matrix(m, where)
    neutral = 1 / _gains(m)
    ccm = np.asarray(m.ccm, np.float64).reshape(3, 3)
    forward = _SRGB_TO_D50 @ (ccm / ccm.sum(1, keepdims=True))
    public = public_metadata(m) | {"parameters": frame_parameters(m)}
    private = _PRIVATE_NAME + json.dumps({"public": public, "private": private_metadata(m)}).encode("utf-8")
    name = f"Lytro {m.model}"
    tags: list[tuple[int, int, int, Any, bool]] = [
        (271, _ASCII, 0, m.make or "Lytro, Inc.", True),
        (272, _ASCII, 0, m.model, True),
        (274, _SHORT, 1, 1, True),
        (33421, _SHORT, 2, (2, 2), True),
        (33422, _BYTE, 4, bytes(_COLOUR_CODES[c] for c in m.bayer), True),
        (50706, _BYTE, 4, bytes((1, 4, 0, 0)), True),
        (50707, _BYTE, 4, bytes((1, 1, 0, 0)), True),
        (50708, _ASCII, 0, name, True),
        (50713, _SHORT, 2, (2, 2), True),
        (50714, _RATIONAL, 4, _fractions(black), True),
        (50717, _SHORT, 1, round(min(m.white)), True),
        (50721, _SRATIONAL, 9, _fractions(matrix.ravel()), True),
        (50728, _RATIONAL, 3, _fractions(neutral), True),
        (50730, _SRATIONAL, 1, _fractions([m.exposure_bias_ev]), True),
        (_PRIVATE_DATA, _BYTE, len(private), private, True),
        (50778, _SHORT, 1, _D65_ILLUMINANT, True),
        (50964, _SRATIONAL, 9, _fractions(forward.ravel()), True),
    ]
    if m.serial and not is_mark(m.serial):
        tags.append((50735, _ASCII, 0, m.serial, True))
    return tags


def _fractions(values: Any) -> tuple[int, ...]:
    """Return numerators and denominators in turn."""
    return tuple(n for value in values for n in (round(float(value) * _DENOMINATOR), _DENOMINATOR))
