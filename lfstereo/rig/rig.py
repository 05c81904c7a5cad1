"""A calibrated pair of light-field cameras and its file."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.container.fields import LONGEST_TEXT
from lfstereo.container.serials import camera_mark
from lfstereo.errors import ConfigError
from lfstereo.options import read_toml, toml_value
from lfstereo.outputs import atomic_file

FORMAT = "lfstereo rig 1"
_LARGEST = 1e9
"""No length in px or m comes near it."""
Pair = tuple[float, float]
Triple = tuple[float, float, float]
Five = tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class SensorGrid:
    """How the rows of micro-images lay on the sensor while a camera was calibrated."""

    origin_px: Pair
    """(x, y) of the first micro-image's centre."""
    step_px: Pair
    """Row pitch of a regular hexagonal lattice of the micro-images' pitch, and the row pitch found."""
    rotation_rad: float
    """Of the rows on the sensor, x towards y."""


@dataclass(frozen=True, slots=True)
class PlenopticCamera:
    """One light-field camera in front of its main lens: a pinhole per point of the pupil.

    A scene point ``(X, Y, Z)`` in camera axes (m; x right, y down, z forward, origin = pupil centre) is seen from
    pupil point ``(p, q)`` at the lattice of micro-image centres at
    ``x = fx X/Z + cx - fx p (1/Z - 1/Zf)``, ``y = fy Y/Z + cy - fy q (1/Z - 1/Zf)``, in sensor px.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013): the same rays, there as a 5 x 5 matrix.
    """

    serial: str
    """Empty: fits any camera."""
    sensor_px: tuple[int, int]
    """(width, height) of the raw frame."""
    focal_px: Pair
    """(fx, fy) in sensor px."""
    principal_px: Pair
    """(cx, cy) in sensor px, 0-based."""
    focus_distance_m: float
    """Zf: depth of the plane of zero slope."""
    pupil_m_per_px: float
    """Metres on the pupil per sensor px of offset inside a micro-image."""
    distortion: Five = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1, k2, k3, b1, b2: where the lens, sharp on the plane of zero slope, moves the ideal picture ``(x - cx)/fx``;
    see :func:`lfstereo.rig.distortion.distort`."""
    zoom_step: int | None = None
    """State of the zoom lens that this holds for, as the camera writes it; ``None``: not known."""
    focus_step: int | None = None
    """Likewise of its focus."""
    grid: SensorGrid | None = None
    """The lattice of micro-images; ``None``: not known."""


@dataclass(frozen=True, slots=True)
class StereoRig:
    """Two plenoptic cameras, the transform between them and the working range."""

    left: PlenopticCamera
    right: PlenopticCamera
    rotation_rad: Triple
    """Rotation vector of ``right_from_left``: ``X_right = R X_left + t``."""
    translation_m: Triple
    """``t`` of ``right_from_left``."""
    near_m: float
    far_m: float
    """Depths between which the rectification places the disparities 0..100 px."""
    pixel_px: float
    """Sensor px per px of a rectified view: for a hexagonal array the row pitch, lenslet pitch * sqrt(3)/2."""

    @property
    def right_from_left(self) -> Float64:
        """Rotation matrix ``(3, 3)``."""
        matrix: Float64 = Rotation.from_rotvec(self.rotation_rad).as_matrix()
        return matrix

    @property
    def right_centre_m(self) -> Float64:
        """Pupil centre of the right camera in left camera axes, ``(3,)``, m."""
        centre: Float64 = -self.right_from_left.T @ np.asarray(self.translation_m)
        return centre

    @property
    def baseline_m(self) -> float:
        """Distance between the two pupil centres."""
        return math.sqrt(sum(c * c for c in self.translation_m))


def without_serials(rig: StereoRig) -> StereoRig:
    """Return a rig that knows its cameras by their marks (`camera_mark`)."""
    left, right = (replace(camera, serial=camera_mark(camera.serial)) for camera in (rig.left, rig.right))
    return replace(rig, left=left, right=right)


def write_rig(path: Path, rig: StereoRig, force: bool = False) -> None:
    """Write a rig file: TOML, metres and radians, px of the raw sensor.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    lines = [f"format = {toml_value(FORMAT)}"]
    lines += [f"{name} = {toml_value(getattr(rig, name))}" for name in ("near_m", "far_m", "pixel_px")]
    for side, camera in (("left", rig.left), ("right", rig.right)):
        lines += ["", f"[{side}]"]
        values = [(name, getattr(camera, name)) for name in PlenopticCamera.__slots__ if name != "grid"]
        lines += [f"{name} = {toml_value(value)}" for name, value in values if value is not None]
        if camera.grid is not None:
            lines += ["", f"[{side}.grid]"]
            lines += [f"{name} = {toml_value(getattr(camera.grid, name))}" for name in SensorGrid.__slots__]
    lines += ["", "[right_from_left]", f"rotation_rad = {toml_value(rig.rotation_rad)}"]
    lines += [f"translation_m = {toml_value(rig.translation_m)}", ""]
    with atomic_file(path, force) as scratch:
        scratch.write_text("\n".join(lines), "utf-8")


def read_rig(path: Path) -> StereoRig:
    """Read a rig file and check every value.

    Raises
    ------
    ConfigError
        If the file is missing, is no rig file, or a value is missing, of the wrong type or impossible.
    """
    table = read_toml(path)
    if table.get("format") != FORMAT:
        raise ConfigError(
            f"{path}: format is {repr(table.get('format'))[:60]}, expected {FORMAT!r}; give a rig file of lfstereo"
        )
    transform = _table(table, "right_from_left", path)
    near, far = _numbers(table, "near_m", 1, path)[0], _numbers(table, "far_m", 1, path)[0]
    if not 0 < near < far:
        raise ConfigError(f"{path}: near_m = {near}, far_m = {far}, expected 0 < near_m < far_m; correct the range")
    rotation = _numbers(transform, "rotation_rad", 3, path)
    translation = _numbers(transform, "translation_m", 3, path)
    if not any(translation):
        raise ConfigError(f"{path}: translation_m is zero, expected two cameras apart; calibrate the rig again")
    return StereoRig(
        left=_camera(_table(table, "left", path), f"{path} [left]"),
        right=_camera(_table(table, "right", path), f"{path} [right]"),
        rotation_rad=(rotation[0], rotation[1], rotation[2]),
        translation_m=(translation[0], translation[1], translation[2]),
        near_m=near,
        far_m=far,
        pixel_px=_positive(table, "pixel_px", path),
    )


def _camera(table: dict[str, Any], where: str) -> PlenopticCamera:
    serial = table.get("serial", "")
    if not isinstance(serial, str) or len(serial) > LONGEST_TEXT or not serial.isprintable():
        raise ConfigError(f"{where}: serial = {repr(serial)[:60]}, expected text in quotes")
    width, height = _numbers(table, "sensor_px", 2, where)
    fx, fy = _numbers(table, "focal_px", 2, where)
    if min(width, height, fx, fy) <= 0:
        raise ConfigError(f"{where}: sensor_px and focal_px must be positive, found {table['sensor_px']} and {fx, fy}")
    cx, cy = _numbers(table, "principal_px", 2, where)
    k1, k2, k3, b1, b2 = _numbers(table, "distortion", 5, where) if "distortion" in table else (0.0,) * 5
    return PlenopticCamera(
        serial=serial,
        sensor_px=(int(width), int(height)),
        focal_px=(fx, fy),
        principal_px=(cx, cy),
        focus_distance_m=_positive(table, "focus_distance_m", where),
        pupil_m_per_px=_positive(table, "pupil_m_per_px", where),
        distortion=(k1, k2, k3, b1, b2),
        zoom_step=_step(table, "zoom_step", where),
        focus_step=_step(table, "focus_step", where),
        grid=_grid(table, where),
    )


def _grid(table: dict[str, Any], where: str) -> SensorGrid | None:
    if "grid" not in table:
        return None
    found, where = _table(table, "grid", where), f"{where[:-1]}.grid]"
    x, y = _numbers(found, "origin_px", 2, where)
    step_x, step_y = _numbers(found, "step_px", 2, where)
    if min(step_x, step_y) <= 0:
        raise ConfigError(f"{where}: step_px = {found['step_px']}, expected positive numbers")
    return SensorGrid((x, y), (step_x, step_y), _numbers(found, "rotation_rad", 1, where)[0])


def _step(table: dict[str, Any], name: str, where: str) -> int | None:
    found = table.get(name)
    if found is not None and (isinstance(found, bool) or not isinstance(found, int) or abs(found) > _LARGEST):
        raise ConfigError(
            f"{where}: {name} = {repr(found)[:60]}, expected a whole number; leave the line out if it is not known"
        )
    return found


def _table(table: dict[str, Any], name: str, where: Path | str) -> dict[str, Any]:
    value = table.get(name)
    if not isinstance(value, dict):
        raise ConfigError(f"{where}: the table [{name}] is missing; give a complete rig file")
    return value


def _positive(table: dict[str, Any], name: str, where: Path | str) -> float:
    value = _numbers(table, name, 1, where)[0]
    if value <= 0:
        raise ConfigError(f"{where}: {name} = {value}, expected a positive number")
    return value


def _numbers(table: dict[str, Any], name: str, count: int, where: Path | str) -> tuple[float, ...]:
    found = table.get(name)
    values = found if isinstance(found, list) else [found]
    good = [float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool) and abs(v) <= _LARGEST]
    if len(good) != len(values) or len(good) != count:
        raise ConfigError(f"{where}: {name} = {repr(found)[:60]}, expected {count} finite number{'s' * (count > 1)}")
    return tuple(good)
