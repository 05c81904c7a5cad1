"""Linear light to 16-bit codes and to sRGB pictures, and back."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32, UInt8, UInt16

CODE_MAX = 65535


def to_codes(values: Float32, peak: float) -> UInt16:
    """Store linear light as the square root of its share of ``peak``: finer where it is darker.

    Examples
    --------
    >>> to_codes(np.array([0.0, 0.25, 1.0, 4.0], np.float32), 4.0).tolist()
    [0, 16384, 32768, 65535]
    """
    share = np.maximum(values, 0) * np.float32(1 / peak)
    return (np.sqrt(np.minimum(share, 1)) * np.float32(CODE_MAX) + np.float32(0.5)).astype(np.uint16)


def from_codes(codes: UInt16, peak: float) -> Float32:
    """Return the linear light that codes stand for."""
    root = codes.astype(np.float32)
    root *= np.float32(np.sqrt(peak) / CODE_MAX)
    return np.multiply(root, root, out=root)


def srgb8(linear: Float32) -> UInt8:
    """Return 8-bit sRGB of linear RGB, 1.0 = 255; values outside 0..1 are clipped.

    Examples
    --------
    >>> srgb8(np.array([0.0, 0.18, 1.0, 2.0], np.float32)).tolist()
    [0, 118, 255, 255]
    """
    coded: UInt8 = np.rint(_encoded(linear) * np.float32(255)).astype(np.uint8)
    return coded


def srgb16(linear: Float32) -> UInt16:
    """Return 16-bit sRGB of linear RGB, 1.0 = 65535; values outside 0..1 are clipped."""
    coded: UInt16 = np.rint(_encoded(linear) * np.float32(65535)).astype(np.uint16)
    return coded


def srgb_to_linear(coded: UInt8 | UInt16) -> Float32:
    """Decode 8-bit or 16-bit sRGB to linear light, 1.0 = white.

    References
    ----------
    IEC 61966-2-1:1999, transfer function.

    Examples
    --------
    >>> [round(float(v), 3) for v in srgb_to_linear(np.array([0, 188, 255], np.uint8))]
    [0.0, 0.503, 1.0]
    """
    levels = np.iinfo(coded.dtype).max
    ramp = np.arange(levels + 1) / levels
    table = np.where(ramp <= 0.04045, ramp / 12.92, ((ramp + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return np.asarray(table[coded], np.float32)


def _encoded(linear: Float32) -> Float32:
    """IEC 61966-2-1 (1999), sRGB transfer curve."""
    clipped = np.clip(linear, 0.0, 1.0).astype(np.float32)
    bent = np.float32(1.055) * np.power(clipped, np.float32(1 / 2.4)) - np.float32(0.055)
    encoded: Float32 = np.where(clipped <= 0.0031308, np.float32(12.92) * clipped, bent)
    return encoded
