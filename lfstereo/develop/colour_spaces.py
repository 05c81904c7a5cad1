"""The colour spaces that pictures are written in: primaries, white and transfer curve, by colour-science."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.develop.options import ColourSpace, Primaries

PRIMARIES: dict[ColourSpace, Primaries] = {
    "srgb": "srgb",
    "linear": "srgb",
    "display-p3": "display-p3",
    "prophoto": "prophoto",
}
NAMES: dict[ColourSpace, str] = {
    "srgb": "sRGB",
    "linear": "Linear sRGB",
    "display-p3": "Display P3",
    "prophoto": "ProPhoto RGB",
}
Curve = tuple[float, float, float, float, float]
_SRGB: Curve = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
CURVES: dict[ColourSpace, Curve] = {
    "srgb": _SRGB,
    "linear": (1.0, 1.0, 0.0, 1.0, 0.0),
    "display-p3": _SRGB,
    "prophoto": (1.8, 1.0, 0.0, 1 / 16, 1 / 32),
}
"""``(g, a, b, c, d)``: light is ``(a x + b)^g`` of a code ``x >= d`` and ``c x`` below.

IEC 61966-2-1:1999 (sRGB, also the curve of Display P3) and ISO 22028-2:2013 (ROMM, ProPhoto).
"""
_OF_SCIENCE: dict[Primaries, str] = {"srgb": "sRGB", "display-p3": "Display P3", "prophoto": "ProPhoto RGB"}


def conversion(source: Primaries, target: Primaries) -> Float64:
    """Return ``(3, 3)``: linear RGB of one set of primaries to another; white stays white (Bradford).

    Examples
    --------
    >>> conversion("display-p3", "srgb").sum(axis=1).round(4).tolist()
    [1.0, 1.0, 1.0]
    """
    if source == target:
        return np.eye(3)
    return np.asarray(np.linalg.solve(to_d50(target), to_d50(source)), np.float64)


@cache
def to_d50(primaries: Primaries) -> Float64:
    """Return ``(3, 3)``: linear RGB to XYZ under D50, the connection space of ICC profiles.

    References
    ----------
    ISO 15076-1:2010, annex E: adaptation to D50 by the linear Bradford transform.
    """
    space = _science().RGB_COLOURSPACES[_OF_SCIENCE[primaries]]
    matrix: Float64 = d50_from(primaries) @ np.asarray(space.matrix_RGB_to_XYZ, np.float64)
    # Published matrices are rounded: scale the columns so that white is the connection space's white to the last bit.
    return matrix * np.linalg.solve(matrix, WHITE_D50)


def d50_from(primaries: Primaries) -> Float64:
    """Return ``(3, 3)``: XYZ under the white of the primaries to XYZ under D50."""
    science = _science()
    x, y = science.RGB_COLOURSPACES[_OF_SCIENCE[primaries]].whitepoint
    white = np.array([x / y, 1.0, (1 - x - y) / y])
    adapted: Float64 = science.adaptation.matrix_chromatic_adaptation_VonKries(white, WHITE_D50, transform="Bradford")
    return adapted


WHITE_D50 = np.array([0.9642, 1.0, 0.8249])
"""XYZ of the connection space's white, ISO 15076-1:2010, section 6.3.1."""


def encode(linear: Float32, space: ColourSpace) -> Float32:
    """Return codes 0..1 of linear light by the curve of a colour space; values outside 0..1 are clipped.

    Examples
    --------
    >>> [round(float(v), 3) for v in encode(np.array([0.0, 0.18, 2.0], np.float32), "srgb")]
    [0.0, 0.461, 1.0]
    """
    g, a, b, c, d = (np.float32(v) for v in CURVES[space])
    light = np.clip(linear, 0.0, 1.0).astype(np.float32)
    if space == "linear":
        return light
    coded: Float32 = np.where(light < c * d, light / c, (np.power(light, 1 / g) - b) / a)
    return coded


def decode_table(levels: int, space: ColourSpace) -> Float32:
    """Return ``(levels + 1,)`` float32: the linear light of every integer code."""
    g, a, b, c, d = CURVES[space]
    codes = np.arange(levels + 1) / levels
    table: Float32 = np.where(codes < d, c * codes, (a * codes + b) ** g).astype(np.float32)
    return table


@cache
def _science() -> Any:
    """Import colour-science, which takes a second and warns of plotting libraries that are not needed here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour
