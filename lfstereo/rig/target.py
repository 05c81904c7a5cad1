"""Calibration targets: checkerboards and ChArUco boards, and their TOML files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float64
from lfstereo.errors import ConfigError
from lfstereo.options import from_mapping, option, read_toml, to_toml
from lfstereo.outputs import atomic_file

FORMAT = "lfstereo target 1"
TargetKind = Literal["checkerboard", "charuco"]
Dictionary = Literal["4x4_250", "5x5_250", "6x6_250"]
_DICTIONARIES = {
    "4x4_250": cv2.aruco.DICT_4X4_250,
    "5x5_250": cv2.aruco.DICT_5X5_250,
    "6x6_250": cv2.aruco.DICT_6X6_250,
}
_MARKERS = 250


@dataclass(frozen=True, slots=True)
class Target:
    """A flat board of squares; its inner corners are the points that cameras are calibrated with.

    Board axes: origin at the first inner corner, x along a row of corners, y down, z away from the viewer. The
    square before the first inner corner is black: that tells the board from itself turned by 180 degrees, and is
    why one of the two numbers of corners must be odd and the other even.
    """

    kind: TargetKind = option("checkerboard", "checkerboard, or charuco, which may be seen in part")
    corners: tuple[int, int] = option((13, 8), "inner corners across and down, one number odd and one even")
    square_m: float = option(0.020, "side of one square, measured on the print", "m")
    marker_m: float = option(0.0, "side of one marker of a charuco board; 0 = three quarters of a square", "m")
    dictionary: Dictionary = option("4x4_250", "markers of a charuco board")

    def __post_init__(self) -> None:
        across, down = self.corners
        if self.kind not in get_args(TargetKind):
            raise ConfigError(f"target: kind = {self.kind!r}, expected {' or '.join(get_args(TargetKind))}")
        if not (3 <= across <= 60 and 3 <= down <= 60):
            raise ConfigError(f"target: corners = {across} x {down}, expected 3 to 60 each; correct the numbers")
        if (across + down) % 2 == 0:
            raise ConfigError(
                f"target: corners = {across} x {down}, expected one number odd and one even, or the board looks the "
                "same upside down; leave one row of squares out"
            )
        if not 0.0005 <= self.square_m <= 1.0:
            raise ConfigError(f"target: square_m = {self.square_m}, expected 0.0005 to 1 m; give the side in metres")
        if self.kind == "charuco" and not 0 <= self.marker_m < self.square_m:
            raise ConfigError(f"target: marker_m = {self.marker_m}, expected 0, or less than square_m {self.square_m}")
        if self.kind == "charuco" and (across + 1) * (down + 1) // 2 > _MARKERS:
            raise ConfigError(f"target: corners = {across} x {down} need more than {_MARKERS} markers; give fewer")

    @property
    def points(self) -> Float64:
        """Inner corners row by row in board axes, ``(N, 3)`` m, z = 0."""
        across, down = self.corners
        points = np.zeros((across * down, 3))
        points[:, 0] = np.tile(np.arange(across), down) * self.square_m
        points[:, 1] = np.repeat(np.arange(down), across) * self.square_m
        return points

    def charuco_board(self) -> cv2.aruco.CharucoBoard:
        """Return OpenCV's description of a charuco board."""
        across, down = self.corners
        marker = self.marker_m or 0.75 * self.square_m
        markers = cv2.aruco.getPredefinedDictionary(_DICTIONARIES[self.dictionary])
        return cv2.aruco.CharucoBoard((across + 1, down + 1), self.square_m, marker, markers)

    def black_squares(self) -> Bool:
        """Return which squares are black, ``(rows, columns)``; the one at the top left is."""
        across, down = self.corners
        rows, columns = np.mgrid[: down + 1, : across + 1]
        black: Bool = (rows + columns) % 2 == 0
        return black


def write_target(path: Path, target: Target, force: bool = False) -> None:
    """Write a target's TOML file.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    head = f'# Measure square_m on the print: everything that the rig measures scales with it.\nformat = "{FORMAT}"\n'
    with atomic_file(path, force) as scratch:
        scratch.write_text(head + to_toml(target), "utf-8")


def read_target(path: Path) -> Target:
    """Read a target's TOML file.

    Raises
    ------
    ConfigError
        If the file is missing, is no target file, or describes no usable board.
    """
    table = read_toml(path)
    if table.pop("format", None) != FORMAT:
        raise ConfigError(f"{path}: found no format = {FORMAT!r}; give a TOML file written by 'lfstereo target'")
    missing = {"kind", "corners", "square_m"} - table.keys()
    if missing:
        raise ConfigError(f"{path}: {', '.join(sorted(missing))} missing; write the file with 'lfstereo target'")
    try:
        return from_mapping(Target, table, str(path))
    except ConfigError as error:
        raise ConfigError(str(error) if str(path) in str(error) else f"{path}: {error}") from error
