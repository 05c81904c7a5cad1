"""What the camera wrote down about a frame: levels, colour, lens, lenslet array."""

from __future__ import annotations

from dataclasses import dataclass

Quad = tuple[float, float, float, float]
"""One number per Bayer site, in the order r, gr, gb, b."""


@dataclass(frozen=True, slots=True)
class LensletArray:
    """The micro-lens array as the factory measured it: start values, never to be trusted."""

    pitch_m: float
    rotation_rad: float
    scale_x: float
    scale_y: float
    offset_m: tuple[float, float, float]
    """x, y on the sensor and the distance z from it."""


@dataclass(frozen=True, slots=True)
class MainLens:
    """State of the zoom lens at the exposure."""

    focal_length_m: float
    f_number: float
    zoom_step: int
    focus_step: int
    exit_pupil_offset_m: float
    infinity_lambda: float


@dataclass(frozen=True, slots=True)
class FrameMetadata:
    """Everything later stages need to know of one raw frame."""

    make: str
    model: str
    """``"ILLUM"`` (also written B01) or ``"F01"``."""
    firmware: str
    serial: str
    """Camera serial number; empty where the file does not tell."""
    width: int
    height: int
    bits_per_pixel: int
    """Of the packed frame: 10 (Illum) or 12 (F01)."""
    endianness: str
    """``"little"`` or ``"big"``."""
    bayer: str
    """Colours of the top-left 2 x 2 sites row by row: ``"grbg"`` (Illum) or ``"bggr"`` (F01)."""
    black: Quad
    """Digital numbers."""
    white: Quad
    """Digital numbers."""
    white_balance: Quad
    ccm: tuple[float, ...]
    """Nine numbers, row by row: camera RGB to linear sRGB."""
    exposure_bias_ev: float
    """``modulationExposureBias``."""
    normalized_responses: Quad
    """Response of each site to the white image's illuminant, green = 1."""
    pixel_pitch_m: float
    iso: float
    captured_at: str
    """``zuluTime`` as written."""
    lenslets: LensletArray
    lens: MainLens
    is_white_image: bool
    is_dark_frame: bool
