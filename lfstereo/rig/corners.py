"""Find a calibration target in every view of a light field, from the centre view outwards."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Float64, UInt8
from lfstereo.errors import TargetNotFoundError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.options import option
from lfstereo.progress import Progress, silent
from lfstereo.rig.saddle import saddle_points
from lfstereo.rig.sightings import Sightings
from lfstereo.rig.target import Target

Corners = tuple[np.ndarray[tuple[int], np.dtype[np.intp]], Float64]
"""Rows of ``Target.points`` and their places ``(N, 2)`` in px."""
_VIEW_PIXELS = ViewSampling(origin_px=(0.0, 0.0), step_px=(1.0, 1.0), rotation_rad=0.0, view_step_px=1.0)
_LEAST_CORNERS = 8
_SCALES, _LARGEST_PX = (2, 1, 3, 4, 6), 2600
"""The centre view is searched enlarged by each of these in turn, up to this size: no one suits all squares."""
_WINDOW, _WINDOW_CHARUCO = 0.4, 0.22
"""Half a refinement window in sides of a square."""


@dataclass(frozen=True, slots=True)
class CornerOptions:
    """How corners are followed through the views."""

    least_weight: float = option(0.3, "views with less confidence than this at a corner are left out")
    agree_px: float = option(0.5, "a corner farther than this from a straight path through the views is left out", "px")


def find_corners(
    light_field: LightField, target: Target, options: CornerOptions = CornerOptions(), progress: Progress = silent
) -> Sightings:
    """Find a target's inner corners in all usable views.

    The board is searched in the centre view only. Every other view starts from where the views already done, nearer
    to the centre, say that a corner must be, and refines that to a fraction of a px.

    Parameters
    ----------
    light_field
        A capture of the target.
    target
        The board; a charuco board may be seen in part.

    Returns
    -------
    Sightings
        In sensor px where the light field knows its sampling, in px of the views otherwise.

    Raises
    ------
    TargetNotFoundError
        If the board is not in the centre view.

    References
    ----------
    Duda and Frese, "Accurate detection and localization of checkerboard corners for calibration" (BMVC 2018), the
    search.
    """
    t0, s0 = light_field.centre
    number, centre = find_board(grey_view(light_field, t0, s0), target, light_field.source)
    reach = _window(centre, number, target)
    t_count, s_count = light_field.views.shape[:2]
    order = sorted(np.ndindex(t_count, s_count), key=lambda ts: (max(abs(ts[0] - t0), abs(ts[1] - s0)), ts))
    places = np.full((t_count, s_count, len(number), 2), np.nan)
    weight = np.zeros((t_count, s_count, len(number)))
    motion = _Motion(centre)
    for done, (t, s) in enumerate(order):
        offset = np.array([s - s0, t - t0], np.float64)
        guess = motion.at(offset)
        sure = _confidence(light_field, t, s, guess, reach)
        usable = sure >= options.least_weight
        if np.count_nonzero(usable) >= min(_LEAST_CORNERS, len(number)):
            found, certain = saddle_points(grey_view(light_field, t, s), guess, reach)
            good = usable & certain & (np.hypot(*(found - guess).T) < max(2 * options.agree_px, 0.25 * reach))
            places[t, s, good], weight[t, s, good] = found[good], sure[good]
            motion.add(offset, found, good)
        progress(done + 1, len(order))
    miss = np.full(weight.shape, np.inf)
    for t, s in order:
        miss[t, s] = np.hypot(*(places[t, s] - motion.at(np.array([s - s0, t - t0], np.float64))).T)
    weight[~(miss < options.agree_px)] = 0.0
    return _sightings(light_field, number, np.nan_to_num(places), weight)


def find_board(picture: UInt8, target: Target, source: str) -> Corners:
    """Find a target's corners in one picture ``(H, W)``.

    Raises
    ------
    TargetNotFoundError
        If the board is not found, or of a charuco board fewer than eight corners.
    """
    search = _charuco if target.kind == "charuco" else _checkerboard
    scales = [scale for scale in _SCALES if scale == 1 or scale * max(picture.shape) <= _LARGEST_PX]
    found, scale = None, 1
    for scale in scales:
        large = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC) if scale > 1 else picture
        found = search(large, target)
        if found is not None:
            break
    if found is None:
        what = f"{target.kind} of {target.corners[0]} x {target.corners[1]} corners"
        seen = "whole" if target.kind == "checkerboard" else f"with {_LEAST_CORNERS} corners or more"
        raise TargetNotFoundError(
            f"{source}: found no {what} in the centre view, expected it {seen}; photograph it sharp, evenly lit and "
            "larger in the picture, or give the TOML file of the target that was used"
        )
    number, place = found
    # Enlarging keeps the middles of pixels in proportion from their edges, not from their centres.
    place = (place + 0.5) / scale - 0.5
    return number, saddle_points(picture, place, _window(place, number, target))[0]


class _Motion:
    """Straight paths of corners through the views, fitted to all views added so far."""

    def __init__(self, centre: Float64) -> None:
        self._sums = np.zeros((len(centre), 3, 3)) + np.diag([1e-3, 1e-3, 1e-3])
        self._moments = np.zeros((len(centre), 3, 2))
        self._moments[:, 0] = 1e-3 * centre

    def add(self, offset: Float64, found: Float64, good: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> None:
        row = np.array([1.0, *offset])
        self._sums[good] += np.outer(row, row)
        self._moments[good] += row[None, :, None] * found[good][:, None, :]

    def at(self, offset: Float64) -> Float64:
        path = np.linalg.solve(self._sums, self._moments)
        place: Float64 = np.einsum("k,nkc->nc", np.array([1.0, *offset]), path)
        return place


def _checkerboard(picture: UInt8, target: Target) -> Corners | None:
    found, place = cv2.findChessboardCornersSB(picture, target.corners, flags=cv2.CALIB_CB_EXHAUSTIVE)
    if not found:
        found, place = cv2.findChessboardCorners(picture, target.corners)
    if not found:
        return None
    place = place.reshape(-1, 2).astype(np.float64)
    return np.arange(len(place)), _from_black(picture, place, target.corners)


def _charuco(picture: UInt8, target: Target) -> Corners | None:
    place, number, _, _ = cv2.aruco.CharucoDetector(target.charuco_board()).detectBoard(picture)
    if number is None or len(number) < _LEAST_CORNERS:
        return None
    return np.asarray(number).ravel().astype(np.intp), np.asarray(place).reshape(-1, 2).astype(np.float64)


def _from_black(picture: UInt8, place: Float64, corners: tuple[int, int]) -> Float64:
    """Return the corners counted from the end whose square is black."""
    across, down = corners
    grid = place.reshape(down, across, 2)
    inside = [grid[j : j + 2, i : i + 2].mean(axis=(0, 1)) for j in range(down - 1) for i in range(across - 1)]
    even = np.array([(i + j) % 2 == 0 for j in range(down - 1) for i in range(across - 1)])
    x, y = np.rint(np.array(inside)).astype(int).T
    shade = picture[np.clip(y, 0, picture.shape[0] - 1), np.clip(x, 0, picture.shape[1] - 1)].astype(np.float64)
    # The square between the first four corners has the colour of the one before the first corner.
    if shade[even].mean() < shade[~even].mean():
        return place
    return place[::-1].copy()


def _window(place: Float64, number: np.ndarray[tuple[int], np.dtype[np.intp]], target: Target) -> int:
    """Return half the side of the window to refine a corner in, px.

    It stays short of the neighbouring corners, and on a charuco board of the markers' bits: up to there the
    surroundings of a corner look the same when turned by 180 degrees.
    """
    across = target.corners[0]
    share = _WINDOW_CHARUCO if target.kind == "charuco" else _WINDOW
    at = {int(n): p for n, p in zip(number, place, strict=True)}
    gaps = [np.hypot(*(at[n + 1] - p)) for n, p in at.items() if n % across < across - 1 and n + 1 in at]
    gaps += [np.hypot(*(at[n + across] - p)) for n, p in at.items() if n + across in at]
    closest = float(np.percentile(gaps, 10)) if gaps else 5.0
    return max(2, min(8, int(share * closest)))


def _confidence(light_field: LightField, t: int, s: int, place: Float64, reach: int) -> Float64:
    """Return the weight of a view at each place, 0..1; 0 where the refinement would leave the picture."""
    rows, columns = light_field.views.shape[2:4]
    x, y = np.rint(np.nan_to_num(place, nan=-1.0)).astype(int).T
    inside = (x >= reach + 2) & (y >= reach + 2) & (x < columns - reach - 2) & (y < rows - reach - 2)
    sure = np.zeros(len(place))
    if light_field.weight is None:
        sure[inside] = 1.0
    else:
        sure[inside] = light_field.weight[t, s, y[inside], x[inside]] / 255
    return sure


def grey_view(light_field: LightField, t: int, s: int) -> UInt8:
    """Return one view in grey, square root of the light: edges keep their middle, noise is even."""
    light = np.clip(light_field.views[t, s] @ np.array([0.25, 0.5, 0.25], np.float32), 0, None)
    white = float(np.percentile(light, 99.5)) or 1.0
    grey: UInt8 = np.rint(255 * np.clip(light / white, 0, 1)).astype(np.uint8)
    return grey


def _sightings(
    light_field: LightField, number: np.ndarray[tuple[int], np.dtype[np.intp]], places: Float64, weight: Float64
) -> Sightings:
    sampling = light_field.sampling or _VIEW_PIXELS
    t0, s0 = light_field.centre
    t, s, n = np.nonzero(weight)
    c, r = math.cos(sampling.rotation_rad), math.sin(sampling.rotation_rad)
    on_lattice = places[t, s, n] * sampling.step_px
    return Sightings(
        source=light_field.source,
        serial=light_field.serial,
        corner=number[n],
        offset=np.stack([s - s0, t - t0], axis=1).astype(np.float64) * sampling.view_step_px,
        place=on_lattice @ np.array([[c, r], [-r, c]]) + sampling.origin_px,
        weight=weight[t, s, n],
    )
