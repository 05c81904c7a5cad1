"""Disparity as a colour picture with a scale that can be read in px and in metres."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64, UInt8, check_shape
from lfstereo.errors import InputError, ShapeError

_UNKNOWN = (58, 58, 58)
_PAPER, _INK, _FAINT = (255, 255, 255), (32, 32, 32), (120, 120, 120)
_BAR_WIDTH, _GAP, _LEGEND_WIDTH = 18, 14, 124
_MIN_HEIGHT = 96
_OVERSAMPLING = 4
"""The legend is drawn larger and reduced: OpenCV's strokes look smoother so."""


@dataclass(frozen=True, slots=True)
class DisparityScale:
    """Range of the colours, and what turns px into metres on the scale."""

    near_px: float
    """Disparity of the warm end."""
    far_px: float = 0.0
    """Disparity of the cold end."""
    focal_px: float | None = None
    """Focal length of the rectified views; without it, or without a baseline, the scale shows px alone."""
    baseline_m: float | None = None
    doffs_px: float = 0.0
    unit: str = "px"
    """Heading of the scale, for maps of something else than disparity."""

    def __post_init__(self) -> None:
        if not (np.isfinite([self.near_px, self.far_px]).all() and self.near_px > self.far_px):
            raise InputError(
                f"colour scale: found {self.far_px} to {self.near_px} px, expected the near end to be larger"
            )


def colour_disparity(disparity: Float32, valid: Bool | None, scale: DisparityScale) -> UInt8:
    """Return disparity as colours, near warm and far cold, unknown pixels dark grey.

    Parameters
    ----------
    disparity
        ``(V, U)`` px.
    valid
        ``(V, U)``, or ``None`` where every disparity is known.
    scale
        Range of the colours; values outside take the colour of the nearer end.

    Returns
    -------
    UInt8
        ``(V, U, 3)`` sRGB.

    Raises
    ------
    ShapeError
        If ``disparity`` is no image, or ``valid`` has another shape.

    References
    ----------
    Mikhailov, "Turbo, an improved rainbow colormap for visualization" (2019), as OpenCV's COLORMAP_TURBO.
    """
    check_shape("disparity", disparity, (None, None))
    if valid is not None and valid.shape != disparity.shape:
        raise ShapeError(f"valid: found shape {valid.shape}, expected {disparity.shape} as the disparity")
    colours = _turbo((disparity.astype(np.float64) - scale.far_px) / (scale.near_px - scale.far_px))
    if valid is not None:
        colours[~valid] = _UNKNOWN
    return colours


def picture_disparity(disparity: Float32, valid: Bool | None, scale: DisparityScale) -> UInt8:
    """Return the coloured disparity with a labelled colour bar to its right.

    Parameters
    ----------
    disparity
        ``(V, U)`` px.
    valid
        ``(V, U)``, or ``None`` where every disparity is known.
    scale
        Range of the colours; with focal length and baseline the bar is labelled in metres too.

    Returns
    -------
    UInt8
        ``(max(V, 96), U + legend, 3)`` sRGB, the coloured disparity in the upper left corner.

    Raises
    ------
    ShapeError
        If ``disparity`` is no image, or ``valid`` has another shape.
    """
    colours = colour_disparity(disparity, valid, scale)
    rows, columns = disparity.shape
    legend = _legend(max(rows, _MIN_HEIGHT), scale)
    picture = np.full((legend.shape[0], columns + legend.shape[1], 3), _PAPER, np.uint8)
    picture[:rows, :columns] = colours
    picture[:, columns:] = legend
    return picture


def round_ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most ``most`` round numbers, steps of 1, 2 or 5 times a power of ten, within a range.

    Examples
    --------
    >>> round_ticks(0.0, 92.0, 6)
    [0.0, 20.0, 40.0, 60.0, 80.0]
    """
    power = 10.0 ** np.floor(np.log10((high - low) / most))
    for step in (power * m for m in (1.0, 2.0, 5.0, 10.0, 20.0)):
        first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
        if last - first + 1 <= most:
            break
    return [float(round(step * n, 9)) for n in range(first, last + 1)]


def _turbo(share: Float64 | Float32) -> UInt8:
    """Colours ``(..., 3)`` of shares 0 (cold) to 1 (warm)."""
    table = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    index = np.rint(np.clip(np.nan_to_num(share), 0.0, 1.0) * 255).astype(np.uint8)
    colours: UInt8 = table[index]
    return colours


def _legend(rows: int, scale: DisparityScale) -> UInt8:
    n = _OVERSAMPLING
    canvas = np.full((rows * n, _LEGEND_WIDTH * n, 3), _PAPER, np.uint8)
    top, bottom = 30, rows - 13
    share = 1.0 - (np.arange((bottom - top) * n) + 0.5) / ((bottom - top) * n)
    left, right = _GAP * n, (_GAP + _BAR_WIDTH) * n
    canvas[top * n : bottom * n, left:right] = _turbo(share)[:, None]
    metric = scale.focal_px is not None and scale.baseline_m is not None
    _write(canvas, scale.unit, _GAP + _BAR_WIDTH + 10, 15, _FAINT)
    if metric:
        _write(canvas, "m", _GAP + _BAR_WIDTH + 48, 15, _FAINT)
    for tick in round_ticks(scale.far_px, scale.near_px, max(2, min(11, (bottom - top) // 34))):
        y = bottom - (tick - scale.far_px) / (scale.near_px - scale.far_px) * (bottom - top)
        row = round(y * n)
        cv2.line(canvas, (right, row), (right + 5 * n, row), _INK, n)
        _write(canvas, f"{tick:g}", _GAP + _BAR_WIDTH + 10, y, _INK)
        if metric:
            _write(canvas, _metres(tick, scale), _GAP + _BAR_WIDTH + 48, y, _INK)
    reduced: UInt8 = cv2.resize(canvas, (_LEGEND_WIDTH, rows), interpolation=cv2.INTER_AREA)
    return reduced


def _metres(disparity_px: float, scale: DisparityScale) -> str:
    shift = disparity_px + scale.doffs_px
    if shift <= 0 or scale.focal_px is None or scale.baseline_m is None:
        return "far"
    depth = scale.focal_px * scale.baseline_m / shift
    return f"{depth:.2f}" if depth < 10 else f"{depth:.1f}" if depth < 100 else f"{depth:.0f}"


def _write(canvas: UInt8, text: str, x: float, middle_y: float, colour: tuple[int, int, int]) -> None:
    n = _OVERSAMPLING
    size = 0.42 * n
    (_, height), _ = cv2.getTextSize("0", cv2.FONT_HERSHEY_SIMPLEX, size, n)
    origin = (round(x * n), round(middle_y * n + height / 2))
    cv2.putText(canvas, text, origin, cv2.FONT_HERSHEY_SIMPLEX, size, colour, n, cv2.LINE_AA)
