"""Rigs in the files of other programs: OpenCV YAML out and in, Kalibr camchain YAML and JSON out.

OpenCV and Kalibr know pinhole cameras only: the focus distance and the distance between views are lost on the way
out and must be given on the way in. All px are those of the raw sensor, counted from 0 at the centre of the first.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.errors import ConfigError, RigError
from lfstereo.options import option
from lfstereo.outputs import atomic_file
from lfstereo.rig.pinhole import PinholeCamera, lens_of, pinhole_of
from lfstereo.rig.rig import FORMAT, Pair, PlenopticCamera, StereoRig, read_rig, write_rig

RigFormat = Literal["toml", "opencv", "kalibr", "json"]
SUFFIXES: dict[str, RigFormat] = {".toml": "toml", ".yml": "opencv", ".yaml": "opencv", ".json": "json"}
_NAMES = {"matrix": ("M{}", "K{}", "cameraMatrix{}"), "distortion": ("D{}", "distCoeffs{}")}
_COEFFICIENTS = (4, 5, 8, 12, 14)


@dataclass(frozen=True, slots=True)
class PlenopticPart:
    """What a file of pinhole cameras does not tell of a rig; pairs are left, right."""

    focus_distance_m: Pair | None = option(None, "of an OpenCV file: depth of zero slope, left and right", "m")
    pupil_m_per_px: Pair | None = option(None, "of an OpenCV file: metres on the pupil per sensor px, left and right")
    near_m: float | None = option(None, "of an OpenCV file: near end of the working range", "m")
    far_m: float | None = option(None, "of an OpenCV file: far end of the working range", "m")
    pixel_px: float = option(12.372, "of an OpenCV file: size of a rectified px; an Illum's row pitch", "sensor px")
    unit_m: float = option(1.0, "of an OpenCV file: the unit of T; 0.001 for boards measured in mm", "m")
    serial_left: str = option("", "of an OpenCV file: serial of the left camera; empty = any")
    serial_right: str = option("", "of an OpenCV file: serial of the right camera; empty = any")


def choose_format(path: Path, name: str | None) -> RigFormat:
    """Return the format of a rig file, by name or else by its suffix.

    Raises
    ------
    ConfigError
        If neither tells.
    """
    for known in ("toml", "opencv", "kalibr", "json"):
        if name == known:
            return known
    found = SUFFIXES.get(path.suffix.lower()) if name is None else None
    if found is None:
        raise ConfigError(
            f"{path}: found format {name or path.suffix!r}, expected {', '.join(SUFFIXES)}, or --format toml, opencv, "
            "kalibr or json"
        )
    return found


def export_rig(path: Path, rig: StereoRig, name: RigFormat, force: bool = False) -> None:
    """Write a rig in one of the formats.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    RigError
        If the lenses bend rays as the format cannot tell, or the sensors differ in size and it has one size.
    """
    if name == "toml":
        write_rig(path, rig, force)
        return
    text = {"opencv": _opencv, "kalibr": _kalibr, "json": _json}[name](rig)
    with atomic_file(path, force) as scratch:
        scratch.write_text(text, "utf-8")


def import_rig(path: Path, part: PlenopticPart = PlenopticPart()) -> StereoRig:
    """Read a rig from a rig file or from OpenCV's YAML with ``M1, D1, M2, D2, R, T``.

    ``K1``, ``cameraMatrix1`` and ``distCoeffs1`` are understood too; the size of the pictures is read from
    ``image_width``, ``image_height``.

    Raises
    ------
    ConfigError
        If the file is of another kind, lacks something, or the plenoptic part is not given.
    RigError
        If the lenses cannot be told in lfstereo's model.
    """
    if path.suffix.lower() == ".toml":
        return read_rig(path)
    if SUFFIXES.get(path.suffix.lower()) != "opencv":
        raise ConfigError(
            f"{path}: found the suffix '{path.suffix}', expected a rig file (.toml) or OpenCV's .yml, .yaml"
        )
    near, far = part.near_m, part.far_m
    if part.focus_distance_m is None or part.pupil_m_per_px is None or near is None or far is None:
        raise ConfigError(
            f"{path}: an OpenCV file knows pinhole cameras only, expected --focus-distance-m, --pupil-m-per-px, "
            "--near-m and --far-m beside it; take them from a rig file of these cameras"
        )
    values = (*part.focus_distance_m, *part.pupil_m_per_px, near, part.pixel_px, part.unit_m)
    if not (min(values) > 0 and near < far):
        raise ConfigError(f"{path}: found {part}, expected positive numbers and near_m < far_m; correct the options")
    left, right, rotation, translation = _read_opencv(path)
    turn = [float(v) for v in Rotation.from_matrix(rotation).as_rotvec()]
    move = [float(v) * part.unit_m for v in translation]
    cameras = []
    for side, (camera, serial) in enumerate(((left, part.serial_left), (right, part.serial_right))):
        lens = lens_of(camera, f"{path}: camera {side + 1}")
        cameras.append(
            PlenopticCamera(
                serial=serial,
                sensor_px=camera.size_px,
                focal_px=lens.focal_px,
                principal_px=lens.principal_px,
                focus_distance_m=part.focus_distance_m[side],
                pupil_m_per_px=part.pupil_m_per_px[side],
                distortion=lens.distortion,
            )
        )
    return StereoRig(
        left=cameras[0],
        right=cameras[1],
        rotation_rad=(turn[0], turn[1], turn[2]),
        translation_m=(move[0], move[1], move[2]),
        near_m=near,
        far_m=far,
        pixel_px=part.pixel_px,
    )


def _json(rig: StereoRig) -> str:
    return json.dumps({"format": FORMAT, **dataclasses.asdict(rig)}, indent=2) + "\n"


def _opencv(rig: StereoRig) -> str:
    if rig.left.sensor_px != rig.right.sensor_px:
        raise RigError(
            f"rig: the sensors have {rig.left.sensor_px} and {rig.right.sensor_px} px, expected one size for an OpenCV "
            "file; write it as Kalibr's or as JSON"
        )
    file = cv2.FileStorage("rig.yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    file.writeComment("lfstereo rig: centre views only; px of the raw sensor, m, X2 = R X1 + T", False)
    for number, camera in enumerate((rig.left, rig.right), 1):
        pinhole = pinhole_of(camera)
        if number == 1:
            file.write("image_width", pinhole.size_px[0])
            file.write("image_height", pinhole.size_px[1])
        file.write(f"M{number}", pinhole.matrix)
        file.write(f"D{number}", np.array([pinhole.coefficients]))
    file.write("R", rig.right_from_left)
    file.write("T", np.array(rig.translation_m)[:, None])
    return str(file.releaseAndGetString())


def _kalibr(rig: StereoRig) -> str:
    lines = ["# lfstereo rig: centre views only; px of the raw sensor, m"]
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rig.right_from_left, rig.translation_m
    for number, camera in enumerate((rig.left, rig.right)):
        pinhole = pinhole_of(camera, terms=2)
        lines.append(f"cam{number}:")
        if number:
            lines.append("  T_cn_cnm1:")
            lines += [f"  - {_row(row)}" for row in transform]
        lines += [
            f"  cam_overlaps: [{1 - number}]",
            "  camera_model: pinhole",
            f"  distortion_coeffs: {_row(pinhole.coefficients[:4])}",
            "  distortion_model: radtan",
            f"  intrinsics: {_row((*pinhole.focal_px, *pinhole.principal_px))}",
            f"  resolution: [{pinhole.size_px[0]}, {pinhole.size_px[1]}]",
            f"  rostopic: /cam{number}/image_raw",
        ]
    return "\n".join(lines) + "\n"


def _row(values: Sequence[float] | Float64) -> str:
    return "[" + ", ".join(_number(float(value)) for value in values) + "]"


def _number(value: float) -> str:
    """Return a number that YAML 1.1 reads as one: with a point before any exponent."""
    text = repr(value)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _read_opencv(path: Path) -> tuple[PinholeCamera, PinholeCamera, Float64, Float64]:
    try:
        text = path.read_text("utf-8")
        file = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (OSError, UnicodeDecodeError, cv2.error, SystemError) as error:
        reason = " ".join(str(error).split())[:120]
        raise ConfigError(
            f"{path}: not a readable OpenCV YAML file ({reason}); give a file that OpenCV wrote"
        ) from error
    size = [
        int(file.getNode(name).real()) if file.getNode(name).isInt() else 0 for name in ("image_width", "image_height")
    ]
    if min(size) <= 0:
        raise ConfigError(
            f"{path}: found no image_width and image_height, expected px of the pictures; add these lines"
        )
    cameras = []
    for number in (1, 2):
        matrix = _matrix(file, [name.format(number) for name in _NAMES["matrix"]], (9,), path).reshape(3, 3)
        bend = _matrix(file, [name.format(number) for name in _NAMES["distortion"]], _COEFFICIENTS, path)
        if matrix[0, 1] or matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or np.any(bend[5:]):
            raise ConfigError(
                f"{path}: camera {number} has skew, a focal length of 0 or less, or rational distortion, expected "
                "fx, fy > 0 and k1, k2, p1, p2, k3 alone; calibrate with the plain model"
            )
        k1, k2, p1, p2, k3 = (float(v) for v in (*bend[:5], 0.0)[:5])
        focal, centre = (float(matrix[0, 0]), float(matrix[1, 1])), (float(matrix[0, 2]), float(matrix[1, 2]))
        cameras.append(PinholeCamera(focal, centre, (k1, k2, p1, p2, k3), (size[0], size[1])))
    rotation, translation = _matrix(file, ["R"], (3, 9), path), _matrix(file, ["T"], (3,), path)
    turn = Rotation.from_rotvec(rotation).as_matrix() if rotation.size == 3 else rotation.reshape(3, 3)
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-4 or np.linalg.det(turn) < 0 or not np.any(translation):
        raise ConfigError(f"{path}: found R that is no rotation, or T = 0, expected two cameras apart; calibrate again")
    return cameras[0], cameras[1], turn, translation


def _matrix(file: cv2.FileStorage, names: list[str], sizes: tuple[int, ...], path: Path) -> Float64:
    for name in names:
        node = file.getNode(name)
        try:
            found = node.mat() if not node.empty() and node.isMap() else None
        except cv2.error:
            found = None
        if found is not None and found.size in sizes and np.isfinite(found).all():
            return np.asarray(found, np.float64).ravel()
    expected = " or ".join(map(str, sizes))
    raise ConfigError(f"{path}: found no matrix {names[0]} of {expected} numbers, expected M1, D1, M2, D2, R and T")
