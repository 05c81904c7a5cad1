"""What the summary shows of a pair: figures of quality and a small picture."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Float32
from lfstereo.lightfield.encoding import srgb8
from lfstereo.pipeline import PairResult
from lfstereo.results import Report

THUMBNAIL = "thumbnail.jpg"
_THUMBNAIL_HEIGHT_PX = 120
_JPEG_QUALITY = 85


def quality_figures(report: Report, result: PairResult) -> dict[str, float]:
    """Return the figures of a finished pair: coverage, ranges, agreement of the two views, errors where truth is known.

    ``view_difference`` is that of :func:`view_difference`: to compare the pairs of a session with each other.
    """
    figures = {
        "valid_share": report.valid_share,
        "disparity_low_px": report.disparity_px[0],
        "disparity_high_px": report.disparity_px[1],
        "depth_low_m": report.depth_m[0],
        "depth_high_m": report.depth_m[1],
        "points": float(report.points),
        "view_difference": view_difference(result),
    }
    figures |= report.errors.get("lfstereo", {})
    return {name: round(float(value), 5) for name, value in figures.items()}


def view_difference(result: PairResult) -> float:
    """Return the mean absolute difference of the left view and the right one moved onto it, sRGB levels 0..255.

    Over the valid pixels, hidden ones too; the right view's colours are brought to the left one's means before.
    """
    left = srgb8(result.left.centre_view).astype(np.float32)
    right = srgb8(result.right.centre_view).astype(np.float32)
    disparity = np.asarray(result.map.disparity, np.float32)
    rows, columns = disparity.shape
    x = np.arange(columns, dtype=np.float32)[None] - disparity
    y = np.repeat(np.arange(rows, dtype=np.float32)[:, None], columns, axis=1)
    moved: Float32 = np.asarray(cv2.remap(right, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
    valid = result.map.valid
    if not valid.any():
        return 0.0
    left, moved = left[valid], moved[valid]
    gain = left.mean(axis=0) / np.maximum(moved.mean(axis=0), 1.0)
    return float(np.abs(left - moved * gain).mean())


def write_thumbnail(folder: Path) -> None:
    """Put the all-in-focus image and the coloured disparity of a result folder side by side, small, without a scale."""
    pictures = [np.asarray(cv2.imread(str(folder / name))) for name in ("all_in_focus.png", "disparity_colour.png")]
    height, width = pictures[0].shape[:2]
    small = max(1, round(width * _THUMBNAIL_HEIGHT_PX / height)), _THUMBNAIL_HEIGHT_PX
    # The scale stands to the right of the coloured map.
    parts = [cv2.resize(picture[:, :width], small, interpolation=cv2.INTER_AREA) for picture in pictures]
    encoded = cv2.imencode(".jpg", np.hstack(parts), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    (folder / THUMBNAIL).write_bytes(encoded.tobytes())
