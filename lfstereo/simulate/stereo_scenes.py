"""Stereo pairs of known disparity: Middlebury folders, the FlyingThings3D layout, a user's own files.

References
----------
Scharstein, Szeliski, Pal, Hirschmüller et al., Middlebury stereo datasets 2001 to 2014: grey-coded disparities times
8 (2001; tsukuba 16), 4 (2003 at quarter size), full-size disparities at full, half and third size (2005, 2006), PFM
(2014). Mayer, Ilg, Häusser, Fischer, Cremers, Dosovitskiy, Brox, "A large dataset to train convolutional networks for
disparity, optical flow, and scene flow estimation" (2016): FlyingThings3D.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb, UInt8, UInt16
from lfstereo.container.picture_size import decoded_picture
from lfstereo.depth.baselines import fill_from_background
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.pfm import read_pfm
from lfstereo.errors import InputError, ShapeError
from lfstereo.lightfield.encoding import srgb_to_linear

_PICTURES = (".png", ".ppm", ".jpg", ".jpeg")
_GREYS = (".png", ".pgm")
_MIDDLEBURY = (
    ("im0", "im1", ("disp0GT", "disp0"), ("disp1GT", "disp1"), (".pfm",)),
    ("view1", "view5", ("disp1",), ("disp5",), _GREYS),
    ("im2", "im6", ("disp2",), ("disp6",), _GREYS),
)
"""Left picture, right picture, left disparity, right disparity, endings of the disparities."""
_THIRD_BELOW_PX, _HALF_BELOW_PX = 540, 900
KITTI_SCALE = 256.0


@dataclass(frozen=True, slots=True)
class SceneFiles:
    """Where the parts of one scene lie."""

    name: str
    left: Path
    right: Path
    disparity: Path
    right_disparity: Path | None = None
    scale: float | None = None
    """What grey codes of the disparity are divided by; ``None``: told by names and size."""
    part: Literal["train", "test"] | None = None
    """Where the data set itself puts the scene."""


@dataclass(frozen=True, slots=True)
class StereoScene:
    """A rectified pair with the disparity of either view."""

    name: str
    left: Rgb
    """``(H, W, 3)`` linear RGB."""
    right: Rgb
    disparity: Float32
    """``(H, W)`` px of the left view, ``x_right = x_left - d``; filled from the background where not known."""
    known: Bool
    """``(H, W)``: where the truth is given."""
    right_disparity: Float32
    """``(H, W)`` px of the right view, likewise filled."""


def find_scenes(folder: Path, scale: float | None = None) -> list[SceneFiles]:
    """List the scenes in a folder, in the order of their names.

    Parameters
    ----------
    folder
        A Middlebury scene (``im0 im1 disp0GT.pfm``, ``view1 view5 disp1``, ``im2 im6 disp2``), a folder of such
        scenes, or FlyingThings3D (``frames_cleanpass`` or ``frames_finalpass`` beside ``disparity``).
    scale
        What grey-coded disparities are divided by; told by names and size where not given.

    Raises
    ------
    InputError
        If the folder holds no scene.
    """
    for frames in ("frames_cleanpass", "frames_finalpass"):
        if (folder / frames).is_dir() and (folder / "disparity").is_dir():
            found = list(_flying_things(folder, frames))
            break
    else:
        candidates = [folder, *sorted(p for p in folder.glob("**/*") if p.is_dir())] if folder.is_dir() else []
        found = [scene for place in candidates if (scene := _middlebury(place, folder, scale))]
    if not found:
        raise InputError(
            f"{folder}: holds no stereo scene; expected a folder with im0, im1, disp0GT.pfm or view1, view5, disp1 or "
            "im2, im6, disp2, a folder of such folders, or FlyingThings3D's frames_cleanpass and disparity"
        )
    return found


def read_scene(files: SceneFiles) -> StereoScene:
    """Read one scene.

    Raises
    ------
    InputError
        If a file cannot be read, or no disparity is known.
    ShapeError
        If pictures and disparity differ in size.
    """
    left, right = read_picture(files.left), read_picture(files.right)
    disparity, known = read_disparity(files.disparity, files.scale)
    for path, shape in ((files.right, right.shape[:2]), (files.disparity, disparity.shape)):
        if shape != left.shape[:2]:
            raise ShapeError(
                f"{path}: {shape[1]} x {shape[0]} px, expected {left.shape[1]} x {left.shape[0]} as {files.left.name}"
            )
    if not known.any():
        raise InputError(f"{files.disparity}: no disparity is known (all 0 or infinite); give another file")
    filled = _filled(disparity, known)
    if files.right_disparity:
        from_right, right_known = read_disparity(files.right_disparity, files.scale)
        if from_right.shape != disparity.shape or not right_known.any():
            raise ShapeError(f"{files.right_disparity}: expected known disparities of the size of {files.left.name}")
        right_filled = _filled(from_right, right_known)
    else:
        right_filled = right_from_left(filled)
    return StereoScene(files.name, left, right, filled, known, right_filled)


def right_from_left(disparity: Float32) -> Float32:
    """Move the left view's disparity to the right view: the nearest wins, gaps take the background.

    Examples
    --------
    >>> right_from_left(np.float32([[0, 0, 2, 2, 0, 0]])).tolist()
    [[2.0, 2.0, 0.0, 0.0, 0.0, 0.0]]
    """
    rows, columns = np.indices(disparity.shape)
    order = np.argsort(disparity, axis=None, kind="stable")
    target = np.rint(columns.ravel() - disparity.ravel()).astype(np.intp)[order]
    inside = (target >= 0) & (target < disparity.shape[1])
    moved, known = np.zeros_like(disparity), np.zeros(disparity.shape, np.bool_)
    place = rows.ravel()[order][inside], target[inside]
    moved[place] = disparity.ravel()[order][inside]
    known[place] = True
    return _filled(moved, known)


def read_picture(path: Path) -> Rgb:
    """Read an 8-bit or 16-bit sRGB picture as linear RGB, ``(H, W, 3)``; grey becomes three equal channels.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    linear = srgb_to_linear(_decoded(path))
    if linear.ndim == 2:
        linear = np.repeat(linear[..., None], 3, axis=2)
    return np.ascontiguousarray(linear[..., 2::-1])


def read_disparity(path: Path, scale: float | None = None) -> tuple[Float32, Bool]:
    """Read a disparity map in px and where it is known.

    PFM holds px, infinite or 0 where unknown; its sign, in which data sets differ for right views, is dropped. Grey
    pictures hold px times ``scale``, 0 where unknown; where ``scale`` is not given: 16 bits are times 256 (KITTI),
    8 bits as Middlebury publishes them, told by names and size.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    if path.suffix.lower() == ".pfm":
        values, known = read_pfm(path)
        return np.abs(values), known & (values != 0)
    codes = _decoded(path)
    codes = codes if codes.ndim == 2 else codes[..., 0]
    factor = scale or (KITTI_SCALE if codes.dtype == np.uint16 else grey_scale(path, codes.shape[1]))
    return (codes / np.float32(factor)).astype(np.float32), np.asarray(codes > 0)


def grey_scale(path: Path, width: int) -> float:
    """Return what the grey codes of a Middlebury disparity picture are divided by.

    Examples
    --------
    >>> grey_scale(Path("Art/disp1.png"), 463), grey_scale(Path("cones/disp2.png"), 450)
    (3.0, 4.0)
    """
    if path.stem in ("disp1", "disp5"):
        return 3.0 if width < _THIRD_BELOW_PX else 2.0 if width < _HALF_BELOW_PX else 1.0
    name = path.parent.name.lower()
    if name in ("cones", "teddy"):
        return max(1.0, float(round(4 * 450 / width)))
    return 16.0 if name == "tsukuba" else 8.0


def _filled(disparity: Float32, known: Bool) -> Float32:
    blank = np.broadcast_to(np.float32(0), (*disparity.shape, 3))
    return fill_from_background(DisparityMap(disparity, known, blank)).disparity


def _decoded(path: Path) -> UInt8 | UInt16:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a picture") from error
    coded: UInt8 | UInt16 | None = decoded_picture(content, cv2.IMREAD_UNCHANGED, str(path))
    if coded is None or coded.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: not a picture of 8 or 16 bits; give a PNG, PPM or JPEG file")
    return coded


def _middlebury(folder: Path, root: Path, scale: float | None) -> SceneFiles | None:
    for left, right, disparities, right_disparities, endings in _MIDDLEBURY:
        pictures = [_first(folder, (stem,), _PICTURES) for stem in (left, right)]
        disparity = _first(folder, disparities, endings)
        if pictures[0] and pictures[1] and disparity:
            name = folder.resolve().name if folder == root else "-".join(folder.relative_to(root).parts)
            other = _first(folder, right_disparities, endings)
            return SceneFiles(name, pictures[0], pictures[1], disparity, other, scale)
    return None


def _first(folder: Path, stems: tuple[str, ...], endings: tuple[str, ...]) -> Path | None:
    return next((p for stem in stems for end in endings if (p := folder / f"{stem}{end}").is_file()), None)


def _flying_things(folder: Path, frames: str) -> Iterator[SceneFiles]:
    """``frames_cleanpass/TRAIN/A/0000/left/0006.png`` with ``disparity/TRAIN/A/0000/left/0006.pfm``."""
    for left in sorted((folder / frames).glob("*/*/*/left/*")):
        split, letter, sequence = left.relative_to(folder / frames).parts[:3]
        right = left.parents[1] / "right" / left.name
        maps = folder / "disparity" / split / letter / sequence
        disparity, other = (maps / side / f"{left.stem}.pfm" for side in ("left", "right"))
        if left.suffix.lower() in (".png", ".webp") and right.is_file() and disparity.is_file():
            name = f"{letter}-{sequence}-{left.stem}"
            part: Literal["train", "test"] = "test" if split.upper() == "TEST" else "train"
            yield SceneFiles(name, left, right, disparity, other if other.is_file() else None, part=part)
