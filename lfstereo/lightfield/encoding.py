"""Linear light to 16-bit codes and to pictures in a colour space, and back."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, UInt8, UInt16
from lfstereo.develop.colour_spaces import PRIMARIES, conversion, decode_table, encode
from lfstereo.develop.options import ColourSpace, Primaries
from lfstereo.lightfield.options import PictureOptions

CODE_MAX = 65535
_KNEE = 0.8
"""Level from which the soft clip bends."""


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
    coded: UInt8 = np.rint(encode(linear, "srgb") * np.float32(255)).astype(np.uint8)
    return coded


def srgb16(linear: Float32) -> UInt16:
    """Return 16-bit sRGB of linear RGB, 1.0 = 65535; values outside 0..1 are clipped."""
    coded: UInt16 = np.rint(encode(linear, "srgb") * np.float32(65535)).astype(np.uint16)
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
    return from_picture(coded)


def to_picture(linear: Float32, primaries: Primaries, options: PictureOptions) -> Float32:
    """Return the codes 0..1 of a picture.

    Parameters
    ----------
    linear
        ``(..., 3)`` linear RGB.
    primaries
        What its three numbers stand for.
    options
        Colour space, exposure and highlights of the picture. Soft highlights scale all three colours alike, so that
        the hue stays: from the knee ``k = 0.8`` on, the largest of the three ``m`` becomes
        ``k + (1 - k)(1 - exp(-(m - k) / (1 - k)))``, which never quite reaches 1.
    """
    light = np.ascontiguousarray(linear, np.float32)
    target = PRIMARIES[options.colour_space]
    if target != primaries:
        flat = light.reshape(-1, 1, 3)
        light = np.asarray(cv2.transform(flat, conversion(primaries, target)), np.float32).reshape(linear.shape)
    if options.exposure_ev:
        light = light * np.float32(2.0**options.exposure_ev)
    if options.highlights == "soft":
        largest = light.max(axis=-1, keepdims=True)
        rest = np.float32(1 - _KNEE)
        bent = 1 - rest * np.exp(np.minimum(_KNEE - largest, 0) / rest)
        light = np.where(largest > _KNEE, light * (bent / np.maximum(largest, _KNEE)), light)
    return encode(light, options.colour_space)


def from_picture(coded: UInt8 | UInt16, colour_space: ColourSpace = "srgb", exposure_ev: float = 0.0) -> Float32:
    """Decode integer codes to the linear light they stand for, in the primaries of their colour space."""
    table = decode_table(int(np.iinfo(coded.dtype).max), colour_space)
    return np.asarray((table * np.float32(2.0**-exposure_ev))[coded], np.float32)
