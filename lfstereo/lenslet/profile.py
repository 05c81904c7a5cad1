"""The mean micro-image of a frame, far finer than its pixels: every lenslet samples it at another phase."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.lenslet.lattice import Lattice

BINS_PER_PIXEL = 4
_BORDER_WIDTH_PX = 0.16
"""Scale of the zone in which the light of two neighbouring lenslets mixes: two discs that end half a px before
their border, blurred by half a px, have shares that follow a logistic curve of this width."""


@dataclass(frozen=True, slots=True)
class MicroImage:
    """Mean micro-image around a lenslet's centre, its neighbours' edges included."""

    brightness: Float32
    """``(N, N)`` relative brightness; bin ``(N//2, N//2)`` is the lenslet's centre."""

    matrix: Float64
    """``(2, 2)`` lattice steps (columns) that repeat it, px."""

    def fit_terms(self) -> Float32:
        """Return ``(N, N, 5)``: brightness, its derivatives along x and y per px, its shading along x and y.

        Shading is the brightness times the offset in px from the centre of the lenslet that the light came
        through: near the border of two micro-images the share of each is a smooth function of the two distances.
        """
        smooth = cv2.GaussianBlur(self.brightness, (0, 0), 0.35 * BINS_PER_PIXEL)
        along_x = 0.5 * BINS_PER_PIXEL * (np.roll(smooth, -1, 1) - np.roll(smooth, 1, 1))
        along_y = 0.5 * BINS_PER_PIXEL * (np.roll(smooth, -1, 0) - np.roll(smooth, 1, 0))
        half = smooth.shape[0] // 2
        y, x = np.mgrid[-half : half + 1, -half : half + 1] / BINS_PER_PIXEL
        sharpness = 1 / (2 * _BORDER_WIDTH_PX * np.hypot(*self.matrix[:, 0]))
        share, shading_x, shading_y = np.zeros(x.shape), np.zeros(x.shape), np.zeros(x.shape)
        for i, j in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1)):
            near_x, near_y = np.array([x, y]) - (self.matrix @ (i, j))[:, None, None]
            part = np.exp(-sharpness * (near_x**2 + near_y**2 - x**2 - y**2).clip(-700 / sharpness, 700 / sharpness))
            share += part
            shading_x += part * near_x
            shading_y += part * near_y
        terms = [smooth, along_x, along_y, smooth * shading_x / share, smooth * shading_y / share]
        return np.ascontiguousarray(np.stack(terms, axis=2), np.float32)


def mean_micro_image(flat: Float32, lattice: Lattice, symmetric: bool = True, share: float = 1.0) -> MicroImage:
    """Average the micro-images of a frame on a grid of a quarter of a pixel.

    Parameters
    ----------
    flat
        ``(H, W)`` evened-out frame.
    lattice
        Where the micro-images lie.
    symmetric
        Average with the copy turned by 180 degrees, which makes the lattice point the centre.
    share
        Part of the frame's width and height to use, about its centre.
    """
    half = int(np.ceil(0.75 * lattice.pitch * BINS_PER_PIXEL)) + BINS_PER_PIXEL
    cut_y, cut_x = (int(0.5 * (1 - share) * side) for side in flat.shape)
    part = flat[cut_y : flat.shape[0] - cut_y, cut_x : flat.shape[1] - cut_x]
    origin = lattice.origin - np.array([cut_x, cut_y], np.float64)
    total, count = _fold(part, lattice.matrix, lattice.reciprocal, origin, half)
    total = cv2.GaussianBlur(total, (0, 0), 0.6)
    count = cv2.GaussianBlur(count, (0, 0), 0.6)
    brightness = (total / np.maximum(count, 1e-6)).astype(np.float32)
    if symmetric:
        brightness = np.ascontiguousarray(0.5 * (brightness + brightness[::-1, ::-1]))
    return MicroImage(brightness, lattice.matrix)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _fold(
    flat: Float32, matrix: Float64, reciprocal: Float64, origin: Float64, half: int
) -> tuple[Float64, Float64]:  # pragma: no cover
    """Sum pixels by their offset from each of the four lattice points around them."""
    size = 2 * half + 1
    total = np.zeros((size, size))
    count = np.zeros((size, size))
    height, width = flat.shape
    a, b, c, d = matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1]
    for y in range(height):
        for x in range(width):
            qx, qy = x - origin[0], y - origin[1]
            i = reciprocal[0, 0] * qx + reciprocal[0, 1] * qy
            j = reciprocal[1, 0] * qx + reciprocal[1, 1] * qy
            i -= np.floor(i)
            j -= np.floor(j)
            for di in range(2):
                for dj in range(2):
                    ox = a * (i - di) + b * (j - dj)
                    oy = c * (i - di) + d * (j - dj)
                    column = int(np.floor(ox * BINS_PER_PIXEL + 0.5)) + half
                    row = int(np.floor(oy * BINS_PER_PIXEL + 0.5)) + half
                    if 0 <= row < size and 0 <= column < size:
                        total[row, column] += flat[y, x]
                        count[row, column] += 1.0
    return total, count
