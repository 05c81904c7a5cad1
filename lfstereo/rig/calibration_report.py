"""One picture that shows how good a calibration is: coverage, residuals, errors per shot, where the boards were."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64, UInt8
from lfstereo.outputs import atomic_file
from lfstereo.rig.adjust import points_in_camera
from lfstereo.rig.bundle import RigSolution
from lfstereo.rig.rig import PlenopticCamera

_WIDTH, _PANEL, _GAP = 1400, 440, 30
_INK, _LEFT, _RIGHT, _BAD = (40, 40, 40), (180, 90, 20), (30, 110, 200), (40, 40, 200)
"""Blue-green-red."""
SIDES = ("left", "right")
CELLS = (12, 8)
"""Parts of the frame across and down, over which residuals are told."""
_VIEW_FROM_DEG = (38.0, 24.0)
"""The drawing's turn about the vertical, then about the horizontal."""


def write_report(path: Path, solution: RigSolution, points: Float64, force: bool = False) -> None:
    """Write the report picture as PNG.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    encoded = cv2.imencode(".png", draw_report(solution, points))[1]
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(encoded.tobytes())


def draw_report(solution: RigSolution, points: Float64) -> UInt8:
    """Return the report, ``(H, W, 3)`` blue-green-red."""
    page: UInt8 = np.full((3 * _PANEL + 4 * _GAP + 70, _WIDTH, 3), 255, np.uint8)
    rig = solution.rig
    _text(page, f"baseline {rig.baseline_m * 1e3:.3f} +- {solution.baseline_sd_m * 1e3:.3f} mm", (_GAP, 40), 0.8)
    turns = ", ".join(f"{np.degrees(sd):.4f}" for sd in solution.rotation_sd_rad)
    _text(page, f"rotation known to {turns} deg; residual {solution.sigma_px:.2f} sensor px", (_GAP + 420, 40), 0.6)
    if solution.rejected:
        _text(page, f"rejected: {', '.join(solution.rejected)}", (_GAP, 66), 0.6, _BAD)
    half = (_WIDTH - 3 * _GAP) // 2
    top = 70 + _GAP
    for number, side in enumerate(SIDES):
        x = _GAP + number * (half + _GAP)
        page[top : top + _PANEL, x : x + half] = _coverage(solution, side, half)
        below = top + _PANEL + _GAP
        page[below : below + _PANEL, x : x + half] = _residual_map(solution, side, half)
    below = top + 2 * (_PANEL + _GAP)
    page[below : below + _PANEL, _GAP : _GAP + half] = _bars(solution, half)
    page[below : below + _PANEL, 2 * _GAP + half : 2 * _GAP + 2 * half] = _in_space(solution, points, half)
    return page


def _panel(title: str, width: int) -> UInt8:
    panel: UInt8 = np.full((_PANEL, width, 3), 255, np.uint8)
    _text(panel, title, (4, 18), 0.55)
    return panel


def _frame(panel: UInt8, size: tuple[int, int]) -> tuple[float, Float64]:
    """Draw the sensor's outline; return px of the panel per sensor px and where the sensor begins."""
    scale = min((panel.shape[1] - 10) / size[0], (panel.shape[0] - 40) / size[1])
    origin = np.array([5.0, 30.0])
    end = origin + np.asarray(size) * scale
    cv2.rectangle(panel, (5, 30), (int(end[0]), int(end[1])), _INK, 1)
    return scale, origin


def _coverage(solution: RigSolution, side: str, width: int) -> UInt8:
    panel = _panel(f"{side}: corners in the centre view, one colour per shot", width)
    scale, origin = _frame(panel, getattr(solution.rig, side).sensor_px)
    for number, pair in enumerate(solution.pairs):
        hue = np.array([[[int(number * 47) % 180, 200, 190]]], np.uint8)
        colour = tuple(int(c) for c in cv2.cvtColor(hue, cv2.COLOR_HSV2BGR)[0, 0])
        for x, y in getattr(pair, side).centre_view()[1] * scale + origin:
            cv2.circle(panel, (round(x), round(y)), 2, colour, -1, cv2.LINE_AA)
    return panel


def residual_cells(solution: RigSolution, side: str) -> tuple[Float64, Float64]:
    """Return how the residuals of all shots and views lie in parts of the frame.

    Returns
    -------
    places, medians
        ``(N, 2)`` middles of the cells that hold corners and their median residual, sensor px.
    """
    size = np.array(getattr(solution.rig, side).sensor_px, float)
    places, misses = [], []
    for pair, residual in zip(solution.pairs, solution.adjustment.residuals[SIDES.index(side) :: 2], strict=True):
        shot = getattr(pair, side)
        places.append(shot.place[shot.weight > 0])
        misses.append(residual[shot.weight > 0])
    place, miss = np.concatenate(places), np.concatenate(misses)
    cell = np.clip((place / size * CELLS).astype(int), 0, np.array(CELLS) - 1)
    used = np.unique(cell, axis=0)
    medians = np.array([np.median(miss[np.all(cell == one, axis=1)], axis=0) for one in used])
    return (used + 0.5) * size / CELLS, medians


def _residual_map(solution: RigSolution, side: str, width: int) -> UInt8:
    """Draw the mean residual of each part of the frame as an arrow."""
    size = getattr(solution.rig, side).sensor_px
    longest = max(2 * solution.sigma_px, 1e-9)
    panel = _panel(f"{side}: mean residual, px; a whole cell = {longest:.2f} sensor px", width)
    scale, origin = _frame(panel, size)
    side_px = np.asarray(size) / CELLS * scale
    colour = _RIGHT if side == "right" else _LEFT
    for place, median in zip(*residual_cells(solution, side), strict=True):
        start = origin + place * scale
        end = start + np.clip(median / longest, -1, 1) * side_px.min()
        cv2.arrowedLine(panel, _point(start), _point(end), colour, 2, cv2.LINE_AA, 0, 0.3)
        cv2.circle(panel, _point(start), 2, _INK, -1)
    return panel


def _bars(solution: RigSolution, width: int) -> UInt8:
    errors = solution.errors
    top = max(error.rms_px for error in errors)
    panel = _panel(f"rms residual per shot, sensor px (tallest {top:.2f}); left and right camera", width)
    step = (width - 20) / len(solution.pairs)
    worst = max(errors, key=lambda error: error.rms_px)
    for number, error in enumerate(errors):
        x = 10 + step * (number // 2) + (step * 0.42 if error.side == "right" else 0)
        height = (_PANEL - 70) * error.rms_px / top
        foot = _PANEL - 28
        colour = _RIGHT if error.side == "right" else _LEFT
        cv2.rectangle(panel, _point((x, foot - height)), _point((x + step * 0.36, foot)), colour, -1)
        if error.side == "left":
            _text(panel, error.name[-8:], (int(x), _PANEL - 12), 0.35)
    _text(panel, f"worst: {worst.name} {worst.side}", (4, 38), 0.5, _BAD)
    return panel


def _in_space(solution: RigSolution, points: Float64, width: int) -> UInt8:
    """Draw boards and cameras in space, seen from behind the rig, above and to the left of it."""
    state, count = solution.adjustment.state, len(solution.pairs)
    worst = max(solution.errors, key=lambda error: error.rms_px).name
    outline = board_outline(points)
    boards = [_seen(points_in_camera(state, outline, 0, n)) for n in range(count)]
    reach = 0.3 * max(points_in_camera(state, points, 0, n)[:, 2].max() for n in range(count))
    cameras = []
    for centre, turn, camera in (
        (np.zeros(3), np.eye(3), solution.rig.left),
        (solution.rig.right_centre_m, solution.rig.right_from_left, solution.rig.right),
    ):
        cameras.append(_seen(centre + view_frustum(camera, reach) @ turn))
    everything = np.concatenate([*boards, *cameras])
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = float(min((width - 40) / (high - low)[0], (_PANEL - 60) / (high - low)[1]))
    first = np.array([(width - (high - low)[0] * scale) / 2, 40.0])
    panel = _panel("boards and cameras in space, seen from behind; the worst shot's board in red", width)
    for number, board in enumerate(boards):
        places = np.rint(first + (board - low) * scale).astype(np.int32)
        bad = solution.pairs[number].name == worst
        cv2.polylines(panel, [places], True, _BAD if bad else _INK, 1 + bad, cv2.LINE_AA)
        _text(panel, solution.pairs[number].name[-4:], (int(places[0, 0]), int(places[0, 1])), 0.35)
    for camera_lines, colour in zip(cameras, (_LEFT, _RIGHT), strict=True):
        places = np.rint(first + (camera_lines - low) * scale).astype(np.int32)
        for corner in places[1:]:
            cv2.line(panel, places[0].tolist(), corner.tolist(), colour, 1, cv2.LINE_AA)
        cv2.polylines(panel, [places[1:]], True, colour, 1, cv2.LINE_AA)
    return panel


def _seen(places: Float64) -> Float64:
    """Return where points in left camera axes lie in the drawing, ``(N, 2)``: parallel rays, from behind and above."""
    turned: Float64 = places @ Rotation.from_euler("yx", _VIEW_FROM_DEG, degrees=True).as_matrix().T
    return turned[:, :2]


def board_outline(points: Float64) -> Float64:
    """Return the corners of the rectangle that holds a target's points, ``(4, 3)`` m in board axes."""
    (x, y, _), (right, bottom, _) = points.min(axis=0), points.max(axis=0)
    return np.array([[x, y, 0.0], [right, y, 0.0], [right, bottom, 0.0], [x, bottom, 0.0]])


def view_frustum(camera: PlenopticCamera, reach_m: float) -> Float64:
    """Return the pupil and the corners of the field of view at a depth, ``(5, 3)`` m in camera axes."""
    (width, height), (fx, fy), (cx, cy) = camera.sensor_px, camera.focal_px, camera.principal_px
    ends = [(0, 0), (width, 0), (width, height), (0, height)]
    rays = [[(x - cx) / fx, (y - cy) / fy, 1.0] for x, y in ends]
    return np.array([[0.0, 0.0, 0.0], *rays]) * reach_m


def _point(place: Float64 | tuple[float, float]) -> tuple[int, int]:
    return round(float(place[0])), round(float(place[1]))


def _text(panel: UInt8, text: str, place: tuple[int, int], size: float, colour: tuple[int, int, int] = _INK) -> None:
    cv2.putText(panel, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)
