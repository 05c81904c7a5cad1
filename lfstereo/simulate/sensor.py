"""From light to digital numbers: colour filters, exposure, noise, hot pixels, quantisation.

Colour, so that a decoder that follows the metadata finds neutral greys: a site of a picture reads
``raw = 2^-bias / gain * (ccm^-1 @ rgb)`` of the white level times the vignetting, with the metadata's exposure bias,
white-balance gain and colour matrix; a white image reads ``0.8 * normalizedResponse * vignetting``. So a white
image divided by its normalized responses is the pure vignetting, a picture divided by that and multiplied by its
gains is neutral, the matrix turns it into linear sRGB and ``2^bias`` gives 1.0 to a fully lit white. (The gains
hold for the picture's own illuminant, the responses for the white image's 5100 K.)
"""

from __future__ import annotations

import math
import zlib
from typing import Final

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, Mosaic
from lfstereo.container.metadata import FrameMetadata, Quad
from lfstereo.simulate.compiled import compiled, compiled_parallel
from lfstereo.simulate.options import SimulateOptions

WHITE_IMAGE_LEVEL: Final = 0.8
"""Green of a white image on the axis, share of the white level: well exposed, not clipped."""


def by_site(values: Quad, bayer: str) -> Float64:
    """Spread numbers in the order r, gr, gb, b over the 2 x 2 Bayer cell, ``(2, 2)``.

    Examples
    --------
    >>> by_site((1.0, 2.0, 3.0, 4.0), "grbg").tolist()
    [[2.0, 1.0], [4.0, 3.0]]
    """
    r, gr, gb, b = values
    cell: Float64 = np.empty((2, 2))
    for place, colour in enumerate(bayer):
        row = place // 2
        green = gr if "r" in bayer[2 * row : 2 * row + 2] else gb
        cell[row, place % 2] = {"r": r, "g": green, "b": b}[colour]
    return cell


def picture_filters(metadata: FrameMetadata) -> Float64:
    """Return ``(2, 2, 3)``: what each Bayer site makes of linear sRGB, in shares of the white level."""
    camera_from_srgb = np.linalg.inv(np.reshape(metadata.ccm, (3, 3)))
    colours = by_site((0, 1, 1, 2), metadata.bayer).astype(int)
    gains = by_site(metadata.white_balance, metadata.bayer)
    filters: Float64 = camera_from_srgb[colours] * 2.0**-metadata.exposure_bias_ev / gains[..., None]
    return filters


def white_filters(metadata: FrameMetadata) -> Float64:
    """Return ``(2, 2)``: what each Bayer site of a white image reads on the axis, in shares of the white level."""
    return WHITE_IMAGE_LEVEL * by_site(metadata.normalized_responses, metadata.bayer)


def hot_pixels(serial: str, sensor_px: tuple[int, int], count: int) -> tuple[Mosaic, Float64]:
    """Return the places (``(count, 2)`` x, y) and the extra signal (``(count,)`` of the white level) of hot pixels.

    They belong to the camera and are the same in all its frames.
    """
    rng = np.random.default_rng(zlib.crc32(serial.encode()))
    places = np.column_stack([rng.integers(0, n, count) for n in sensor_px]).astype(np.uint16)
    return places, 10 ** rng.uniform(-1.3, 0.1, count)


def expose(light: Float32, metadata: FrameMetadata, options: SimulateOptions, frame: int) -> Mosaic:
    """Turn light into digital numbers.

    Photon noise has the variance of the electrons collected, ``signal * full well``; the noise is drawn from the
    option ``seed``, the camera's serial number, the frame's number and the pixel.

    Parameters
    ----------
    light
        ``(H, W)`` in shares of the white level.
    frame
        Tells frames of one camera apart.

    Returns
    -------
    Mosaic
        ``(H, W)`` uint16 DN, 0 .. 2^bits - 1.

    References
    ----------
    EMVA Standard 1288 release 4.0 (2021), section 2: linear camera model, Poisson photon noise.
    """
    signal = light
    if options.noise and options.hot_pixels:
        signal = light.copy()
        places, extra = hot_pixels(metadata.serial, (metadata.width, metadata.height), options.hot_pixels)
        signal[places[:, 1], places[:, 0]] += extra.astype(np.float32)
    mosaic = np.empty(light.shape, np.uint16)
    key = np.uint64(zlib.crc32(f"{options.seed} {metadata.serial} {frame}".encode()))
    black = by_site(metadata.black, metadata.bayer)
    white = by_site(metadata.white, metadata.bayer)
    full_well = options.full_well_e if options.noise else math.inf
    read_noise = options.read_noise_dn if options.noise else 0.0
    _digitise(signal, mosaic, black, white, 1 / full_well, read_noise, key, (1 << metadata.bits_per_pixel) - 1)
    return mosaic


@compiled
def _scramble(state: np.uint64) -> np.uint64:
    """Return 64 well mixed bits: one step of SplitMix64 (Steele, Lea and Flood 2014)."""
    state = state + np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))


@compiled_parallel
def _digitise(
    signal: Float32,
    mosaic: Mosaic,
    black: Float64,
    white: Float64,
    variance: float,
    read_noise: float,
    key: np.uint64,
    largest: int,
) -> None:
    for y in numba.prange(signal.shape[0]):
        for x in range(signal.shape[1]):
            low, span = black[y & 1, x & 1], white[y & 1, x & 1] - black[y & 1, x & 1]
            bits = _scramble((key << np.uint64(32)) ^ np.uint64(y * signal.shape[1] + x))
            u = (float(bits >> np.uint64(32)) + 0.5) / 4294967296.0
            v = float(bits & np.uint64(0xFFFFFFFF)) / 4294967296.0
            normal = math.sqrt(-2 * math.log(u)) * math.cos(2 * math.pi * v)
            spread = math.sqrt(signal[y, x] * variance * span * span + read_noise * read_noise)
            value = math.floor(low + span * signal[y, x] + spread * normal + 0.5)
            mosaic[y, x] = np.uint16(min(max(value, 0.0), float(largest)))
