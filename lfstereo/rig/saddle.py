"""Place the corners of a checkerboard to a fraction of a pixel: where four squares meet, the picture is a saddle."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Bool, Float64, UInt8

_STEPS = 8
_STILL_PX = 1e-3
_UNKNOWNS = 6
_WIDER, _WIDER_PX = 1.2, 1.0
"""Radius of the window, where the weights are 0, in reaches and px on top."""


def saddle_points(picture: UInt8, guess: Float64, reach: int) -> tuple[Float64, Bool]:
    """Find the saddle points nearest to guesses.

    A polynomial of second order is fitted to the pixels around the guess, with weights that fall to 0 smoothly and
    whose centre is the guess itself, not the pixel it lies in; its saddle is the next guess. Nothing is interpolated
    and nothing cut off, so the result does not favour any place within a pixel.

    Parameters
    ----------
    picture
        ``(H, W)`` grey.
    guess
        ``(N, 2)`` (x, y) px.
    reach
        How far the surroundings look like a corner, px.

    Returns
    -------
    Places ``(N, 2)`` px, and ``(N,)`` whether they are saddles: where the surroundings are none, the saddle lies
    farther from the guess than the reach or the window leaves the picture, the guess is returned.

    References
    ----------
    Lucchese and Mitra, "Using saddle points for subpixel feature detection in camera calibration targets" (2002).
    """
    found: Float64 = guess.astype(np.float64, copy=True)
    good = np.zeros(len(found), np.bool_)
    _follow(picture, found, good, float(reach), _WIDER * reach + _WIDER_PX)
    return found, good


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _follow(picture: UInt8, places: Float64, found: Bool, reach: float, radius: float) -> None:  # pragma: no cover
    rows, columns = picture.shape
    normal = np.empty((_UNKNOWNS, _UNKNOWNS))
    moment, term = np.empty(_UNKNOWNS), np.empty(_UNKNOWNS)
    side = int(np.ceil(radius))
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1]
        good = np.isfinite(x) and np.isfinite(y)
        for _ in range(_STEPS):
            if not good:
                break
            left, top = int(np.floor(x)) - side, int(np.floor(y)) - side
            if left < 0 or top < 0 or left + 2 * side + 1 >= columns or top + 2 * side + 1 >= rows:
                good = False
                break
            normal[:] = 0.0
            moment[:] = 0.0
            for row in range(top, top + 2 * side + 2):
                for column in range(left, left + 2 * side + 2):
                    dx, dy = column - x, row - y
                    weight = max(0.0, 1.0 - (dx * dx + dy * dy) / (radius * radius)) ** 2
                    if weight == 0.0:
                        continue
                    term[0], term[1], term[2] = 1.0, dx, dy
                    term[3], term[4], term[5] = dx * dx, dx * dy, dy * dy
                    for a in range(_UNKNOWNS):
                        moment[a] += weight * term[a] * picture[row, column]
                        for b in range(a + 1):
                            normal[a, b] += weight * term[a] * term[b]
            for a in range(_UNKNOWNS):
                for b in range(a):
                    normal[b, a] = normal[a, b]
            fit = np.linalg.solve(normal, moment)
            # Gradient zero: (2 f3, f4; f4, 2 f5) step = -(f1, f2), a saddle where the determinant is negative.
            volume = 4 * fit[3] * fit[5] - fit[4] * fit[4]
            if volume >= 0:
                good = False
                break
            step_x = -(2 * fit[5] * fit[1] - fit[4] * fit[2]) / volume
            step_y = -(2 * fit[3] * fit[2] - fit[4] * fit[1]) / volume
            x, y = x + step_x, y + step_y
            good = abs(x - places[n, 0]) < reach and abs(y - places[n, 1]) < reach
            if step_x * step_x + step_y * step_y < _STILL_PX * _STILL_PX:
                break
        found[n] = good
        if good:
            places[n, 0], places[n, 1] = x, y
