"""Give a mosaic that was stored as JPEG the Bayer pattern back that the compression rounded away.

The pattern is the highest spatial frequency there is, and JPEG stores that in steps of up to fifty digital numbers.
What a file says of a coefficient is an interval. Of all mosaics that would have been stored as the same file, the one
is taken whose pattern is that of the colours around it, and of the light's own white where nothing else is known.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, UInt8

_BLOCK = 8
_REACH_PX = 8.0
"""Standard deviation over which colours are gathered, px of the mosaic: about the size of a micro-image."""
_ROUNDS = 4
_TRUST = 3.0
"""Digital numbers of light at which the colours around count as much as the light's own white."""


def restore_mosaic(
    pixels: UInt8, steps: npt.NDArray[np.integer], black: float, white_of_sites: tuple[float, float, float, float]
) -> Float32:
    """Return the mosaic with its Bayer pattern restored, within what the file allows.

    Each round takes the brightness without the pattern (a filter that is blind to it), multiplies it by the colour of
    each site, and moves every coefficient of the cosine transform to the nearest value of its interval. The colours
    are then gathered again, from coefficients that the file does tell (not 0) as they are told.

    Parameters
    ----------
    pixels
        ``(H, W)`` mosaic as decompressed; sides that no block of 8 px divides are mirrored.
    steps
        ``(8, 8)`` quantisation table of the file, lowest frequency first.
    black
        Black level, digital numbers.
    white_of_sites
        What the four Bayer sites, row by row, make of white light; only their ratios count.

    Returns
    -------
    ``(H, W)`` float32 digital numbers; may leave 0 to 255.

    References
    ----------
    ITU-T T.81 (1992), sections A.3.3 (cosine transform) and A.3.4 (quantisation).
    Zakhor, "Iterative procedures for reduction of blocking effects in transform image coding" (IEEE TCSVT 1992): the
    projection onto what the quantisation allows.
    """
    height, width = pixels.shape
    padding = (0, -height % _BLOCK, 0, -width % _BLOCK)
    padded = cv2.copyMakeBorder(pixels, *padding, cv2.BORDER_REFLECT_101).astype(np.float32)
    step = np.tile(np.asarray(steps, np.float32), (padded.shape[0] // _BLOCK, padded.shape[1] // _BLOCK))
    told = np.rint(_cosine(padded - 128) / step) * step
    white = np.asarray(white_of_sites, np.float32) * np.float32(4 / sum(white_of_sites))
    colours = [np.full((padded.shape[0] // 2, padded.shape[1] // 2), share, np.float32) for share in white]
    mosaic = padded
    for turn in range(_ROUNDS):
        brightness = _brightness(mosaic, black)
        wanted = np.empty_like(mosaic)
        for site, colour in enumerate(colours):
            place = np.s_[site // 2 :: 2, site % 2 :: 2]
            wanted[place] = black + brightness[place] * colour
        nearest = told + np.clip(_cosine(wanted - 128) - told, -step / 2, step / 2)
        if turn == _ROUNDS - 1:
            return _inverse(nearest)[:height, :width] + np.float32(128)
        mosaic = _inverse(np.where(told == 0, nearest, told)) + np.float32(128)
        colours = _colours(mosaic, _brightness(mosaic, black), black, white)
    raise AssertionError("there is a last round")


def _brightness(mosaic: Float32, black: float) -> Float32:
    """Return the light without the Bayer pattern: weights of 1 2 1 in both directions sum to the same for each site."""
    kernel = np.array([0.25, 0.5, 0.25], np.float32)
    smooth = cv2.sepFilter2D(mosaic, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(np.maximum(smooth - np.float32(black), 0), np.float32)


def _colours(mosaic: Float32, brightness: Float32, black: float, white: Float32) -> list[Float32]:
    """Return for each site the share of its colour in the light around, ``(H/2, W/2)`` each."""
    shares: list[Float32] = []
    for site in range(4):
        place = np.s_[site // 2 :: 2, site % 2 :: 2]
        own = cv2.GaussianBlur(mosaic[place] - np.float32(black), (0, 0), _REACH_PX / 2)
        light = cv2.GaussianBlur(np.ascontiguousarray(brightness[place]), (0, 0), _REACH_PX / 2)
        share = (np.maximum(own, 0) + np.float32(_TRUST) * white[site]) / (light + np.float32(_TRUST))
        shares.append(np.asarray(share, np.float32))
    return shares


def _basis() -> Float32:
    """Return the cosine transform of 8 numbers, ``(8, 8)``, orthonormal."""
    k = np.arange(_BLOCK)
    basis = np.cos(math.pi * (2 * k + 1) * k[:, None] / (2 * _BLOCK)) * math.sqrt(2 / _BLOCK)
    basis[0] /= math.sqrt(2)
    return basis.astype(np.float32)


def _cosine(picture: Float32) -> Float32:
    """Transform every block of 8 x 8 px in place of its pixels."""
    return _both_ways(picture, _basis())


def _inverse(coefficients: Float32) -> Float32:
    return _both_ways(coefficients, np.ascontiguousarray(_basis().T))


def _both_ways(picture: Float32, basis: Float32) -> Float32:
    height, width = picture.shape
    down = np.matmul(basis, picture.reshape(height // _BLOCK, _BLOCK, width))
    across: Float32 = down.reshape(-1, _BLOCK) @ basis.T
    return across.reshape(height, width)
