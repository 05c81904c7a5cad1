"""Raw mosaics as DNG, which raw converters open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from lfstereo.arrays import Float64
from lfstereo.container.capture import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.errors import MetadataError
from lfstereo.outputs import atomic_file, check_absent, check_space

SUFFIX = ".dng"
_BYTE, _ASCII, _SHORT, _RATIONAL, _SRATIONAL = 1, 2, 3, 5, 10
_CFA_PHOTOMETRIC = 32803
_D65_ILLUMINANT = 21
_COLOUR_CODES = {"r": 0, "g": 1, "b": 2}
_XYZ_TO_SRGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
_DENOMINATOR = 10000


def write_dng(path: Path, capture: Capture, force: bool = False) -> None:
    """Write the raw mosaic of a capture as an uncompressed DNG; the digital numbers stay as they are.

    Bayer pattern, black and white levels, white balance, colour matrix and exposure bias of the camera go along, so
    that a raw converter shows the lenslet image in the camera's colours.

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
        (50778, _SHORT, 1, _D65_ILLUMINANT, True),
    ]
    if m.serial:
        tags.append((50735, _ASCII, 0, m.serial, True))
    return tags


def _fractions(values: Any) -> tuple[int, ...]:
    """Return numerators and denominators in turn."""
    return tuple(n for value in values for n in (round(float(value) * _DENOMINATOR), _DENOMINATOR))
