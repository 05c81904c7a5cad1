"""The page of a calibration: boards and cameras in space, coverage, residuals, shots, and how well all is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfstereo import __version__
from lfstereo.arrays import Float64
from lfstereo.outputs import atomic_file
from lfstereo.rig.adjust import points_in_camera
from lfstereo.rig.bundle import RigSolution, ShotPair
from lfstereo.rig.calibration_report import CELLS, SIDES, board_outline, residual_cells, view_frustum
from lfstereo.rig.rig import PlenopticCamera
from lfstereo.rig.session import Session
from lfstereo.rig.thin_lens import thin_lens_of_camera
from lfstereo.viewer.template import fill_page

_REACH = 0.35
"""How far the drawn fields of view go, of the farthest board's distance."""


def write_calibration_page(
    path: Path, solution: RigSolution, session: Session, points: Float64, files: dict[str, Path], force: bool = False
) -> None:
    """Write the page of a calibration.

    Parameters
    ----------
    path
        The HTML file.
    solution, session
        The rig, and what it was made from.
    points
        ``(N, 3)`` corners in board axes, m.
    files
        What lies beside the page, by what it holds.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    content = calibration_content(solution, session, points)
    content["files"] = [
        {"name": file.name, "href": file.name, "about": about, "bytes": file.stat().st_size}
        for about, file in files.items()
    ]
    with atomic_file(path, force) as scratch:
        scratch.write_text(fill_page(content, "calibration"), "utf-8")


def calibration_content(solution: RigSolution, session: Session, points: Float64) -> dict[str, Any]:
    """Return what the page shows; lengths in m, angles in degrees, places in sensor px.

    Keys
    ----
    ``title``, ``lede``, ``made`` as on every page; ``cameras`` left and right, with the pupil and the corners of the
    field of view in left camera axes, the frame's size, residuals over the frame and the lens; ``shots``; ``rig`` with
    its figures and how well they are known; ``left_out`` by name; ``cells`` of the frame across and down.
    """
    rig, count = solution.rig, len(solution.pairs)
    cameras = [_camera(solution, session, points, side) for side in SIDES]
    rejected = f" {len(solution.rejected)} more contradict them." if solution.rejected else ""
    lede = (
        f"{count} shots of both cameras; a corner lies within {solution.sigma_px:.2f} sensor px of its place.{rejected}"
    )
    turn_deg = np.degrees(rig.rotation_rad)
    return {
        "title": [rig.left.serial or "left", rig.right.serial or "right"],
        "lede": lede,
        "made": f"lfstereo {__version__}",
        "cells": list(CELLS),
        "cameras": cameras,
        "shots": [_shot(solution, points, number) for number in range(count)],
        "rig": {
            "baseline_m": rig.baseline_m,
            "baseline_sd_m": solution.baseline_sd_m,
            "rotation_deg": turn_deg.tolist(),
            "rotation_sd_deg": np.degrees(solution.rotation_sd_rad).tolist(),
            "turn_deg": float(np.linalg.norm(turn_deg)),
            "sigma_px": solution.sigma_px,
            "near_m": rig.near_m,
            "far_m": rig.far_m,
        },
        "left_out": [[name, "contradicts the other shots"] for name in solution.rejected]
        + [[name, reason] for name, reason in session.unusable],
    }


def _camera(solution: RigSolution, session: Session, points: Float64, side: str) -> dict[str, Any]:
    number, rig = SIDES.index(side), solution.rig
    camera: PlenopticCamera = getattr(rig, side)
    state = solution.adjustment.state
    far_m = max(float(points_in_camera(state, points, 0, n)[:, 2].max()) for n in range(len(solution.pairs)))
    seen = view_frustum(camera, _REACH * far_m)
    if side == "right":
        seen = rig.right_centre_m + seen @ rig.right_from_left
    places, medians = residual_cells(solution, side)
    start = session.lenses[number]
    lens = None
    if start is not None:
        found = thin_lens_of_camera(camera, start)
        lens = {
            "focal length, mm": [found.focal_length_m * 1e3, start.focal_length_m * 1e3],
            "lenslets before the sensor, µm": [found.lenslet_gap_m * 1e6, start.lenslet_gap_m * 1e6],
        }
    return {
        "name": side,
        "serial": camera.serial,
        "size_px": list(camera.sensor_px),
        "seen": _rounded(seen, 5),
        "covered": len(places) / (CELLS[0] * CELLS[1]),
        "residual_places": _rounded(places, 1),
        "residuals": _rounded(medians, 4),
        "lens": lens,
        "settings": {
            "focal_px": camera.focal_px,
            "focal_px known to": f"{100 * solution.focal_sd[number]:.2g} %",
            "principal_px": camera.principal_px,
            "focus_distance_m": camera.focus_distance_m,
            "pupil_m_per_px": camera.pupil_m_per_px,
            "distortion": str(", ".join(f"{term:.4g}" for term in camera.distortion)),
            "zoom step": "not known" if camera.zoom_step is None else camera.zoom_step,
            "focus step": "not known" if camera.focus_step is None else camera.focus_step,
        },
    }


def _shot(solution: RigSolution, points: Float64, number: int) -> dict[str, Any]:
    pair, state = solution.pairs[number], solution.adjustment.state
    board = points_in_camera(state, points, 0, number)
    outline = points_in_camera(state, board_outline(points), 0, number)
    errors = [error for error in solution.errors if error.name == pair.name]
    return {
        "name": pair.name,
        "outline": _rounded(outline, 5),
        "rms_px": [error.rms_px for error in errors],
        "corners": [error.corners for error in errors],
        "views": [error.views for error in errors],
        "distance_m": float(np.linalg.norm(board.mean(axis=0))),
        "tilt_deg": float(np.degrees(np.arccos(min(1.0, abs(_normal(outline)[2]))))),
        "places": [_rounded(_places(pair, side), 1) for side in SIDES],
    }


def _places(pair: ShotPair, side: str) -> Float64:
    places: Float64 = getattr(pair, side).centre_view()[1]
    return places


def _normal(outline: Float64) -> Float64:
    """Return the unit vector that stands on a board."""
    normal = np.cross(outline[1] - outline[0], outline[3] - outline[0])
    upright: Float64 = normal / np.linalg.norm(normal)
    return upright


def _rounded(values: Float64, digits: int) -> list[Any]:
    rounded: list[Any] = np.round(values, digits).tolist()
    return rounded
