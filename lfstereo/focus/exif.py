"""What pictures tell of their focus: EXIF of JPEG, PNG, TIFF, DNG and other TIFF-like RAW files, and Adobe's XMP."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

_IN_35MM_DIAGONAL_MM = math.hypot(36.0, 24.0)
_XMP_TAG = 700
_APPROXIMATE = re.compile(rb"ApproximateFocusDistance(?:=\"|>)\s*(\d+)(?:/(\d+))?")
_INFINITE = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class FocusTags:
    """Of one picture; ``None`` where it does not tell."""

    distance_m: float | None = None
    """May be infinite."""
    focal_mm: float | None = None
    focal_35mm_mm: float | None = None
    """Focal length with the same diagonal field of view on 36 x 24 mm."""
    f_number: float | None = None


def read_focus_tags(path: Path) -> FocusTags:
    """Read focus distance and lens; a file without metadata, or with damaged ones, tells nothing.

    References
    ----------
    CIPA DC-008 (Exif 2.32), SubjectDistance: a numerator of FFFFFFFF means infinity, 0 unknown; Adobe, XMP
    specification part 2, ``aux:ApproximateFocusDistance``, which Adobe's converters write.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            tags, xmp = _tags(path)
        except Exception:  # a damaged directory fails in many ways, and never says anything about focus
            return FocusTags()
    return FocusTags(
        distance_m=_distance(tags.get(ExifTags.Base.SubjectDistance), xmp),
        focal_mm=_positive(tags.get(ExifTags.Base.FocalLength)),
        focal_35mm_mm=_positive(tags.get(ExifTags.Base.FocalLengthIn35mmFilm)),
        f_number=_positive(tags.get(ExifTags.Base.FNumber)),
    )


def focal_px_of(focal_35mm_mm: float, size: tuple[int, int]) -> float:
    """Return the focal length in px of a picture of (rows, columns), from the one of equal diagonal on film.

    References
    ----------
    CIPA DCG-001 (2005): the 35 mm equivalent is by the diagonal, 43.27 mm.

    Examples
    --------
    >>> round(focal_px_of(36.0, (2400, 3600)), 6)
    3600.0
    """
    return focal_35mm_mm / _IN_35MM_DIAGONAL_MM * math.hypot(*size)


def _tags(path: Path) -> tuple[dict[int, Any], bytes]:
    """Return the tags of the first directory and of the EXIF directory, and the XMP packet."""
    exif = Image.Exif()
    with path.open("rb") as file:
        tiff_like = file.read(4) in (b"II*\0", b"MM\0*")
        file.seek(0)
        if tiff_like:
            exif.load_from_fp(file)
            first, inner = dict(exif), dict(exif.get_ifd(ExifTags.IFD.Exif))
            return first | inner, _bytes(first.get(_XMP_TAG, b""))
        with Image.open(file) as picture:
            exif = picture.getexif()
            first, inner = dict(exif), dict(exif.get_ifd(ExifTags.IFD.Exif))
            return first | inner, _bytes(picture.info.get("xmp", b""))


def _bytes(value: Any) -> bytes:
    return value.encode() if isinstance(value, str) else bytes(value)


def _distance(tag: Any, xmp: bytes) -> float | None:
    if tag is not None:
        if getattr(tag, "numerator", 0) == _INFINITE:
            return math.inf
        return _positive(tag)
    found = _APPROXIMATE.search(xmp)
    if found is None:
        return None
    above, below = int(found[1]), int(found[2] or 1)
    if above == _INFINITE:
        return math.inf
    return above / below if above > 0 and below > 0 else None


def _positive(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if 0 < number < math.inf else None
