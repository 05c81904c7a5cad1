"""Dual focal stack data sets on disk, in the layout in which the authors of the networks publish theirs.

``binocular_focal_stack_noise/train/[scene]_[slice]_[L/R]_image.png`` (``..._clean`` without noise),
``color_depth_pair/train/[scene]_color_[L/R].png`` and ``[scene]_depth_[L/R].png``, and the same below ``test``; 8 bits,
255 in a depth picture = 100 px of disparity. Beyond that layout there are ``[scene]_disparity_L.pfm``, the disparity
unrounded, infinite where unknown, and ``stacks.toml`` beside ``train`` and ``test``: lens, focus and noise.

References
----------
Chen, Guo, Li, Yang, Yu, "Deep eyes: joint depth inference using monocular and binocular cues" (Neurocomputing 2020),
README of the data set Binocular-Focal-Stack.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb, UInt8
from lfstereo.container.picture_size import picture_in
from lfstereo.depth.pfm import read_pfm, write_pfm
from lfstereo.errors import ConfigError, InputError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.encoding import srgb8
from lfstereo.options import from_mapping, read_toml, to_toml
from lfstereo.outputs import atomic_file
from lfstereo.simulate.photograph import PhotographOptions, focus_disparities
from lfstereo.simulate.stereo_scenes import read_picture
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions

Part: TypeAlias = Literal["train", "test"]
CARD = "stacks.toml"
PAIRS = "color_depth_pair"
DEPTH_RANGE_PX = 100.0
"""Disparity of the grey value 255."""
_SLICE = re.compile(r"(.+)_(\d+)_([LR])_image\.png")


@dataclass(frozen=True, slots=True)
class DualStack:
    """Two focal stacks of a scene, its sharp views and its disparity."""

    name: str
    left: FocalStack
    right: FocalStack
    sharp: Rgb
    """``(H, W, 3)`` linear RGB of the left view."""
    sharp_right: Rgb
    disparity: Float32
    """``(H, W)`` px of the left view."""
    known: Bool
    """``(H, W)``: where the left disparity is the truth."""
    right_disparity: Float32
    """``(H, W)`` px of the right view."""


def stack_folder(root: Path, noisy: bool) -> Path:
    """Return the folder of the slices with or without noise."""
    return root / f"binocular_focal_stack_{'noise' if noisy else 'clean'}"


def open_dataset(root: Path, options: PhotographOptions, dslr: VirtualDslrOptions) -> None:
    """Begin a data set, or go on with one that was begun with the same options.

    Raises
    ------
    ConfigError
        If the folder holds a data set made with other options.
    OutputError
        If the folder cannot be written.
    """
    focus_disparities(options)
    card = stack_folder(root, dslr.noise) / CARD
    shared = [line for line in to_toml(dslr).splitlines() if not line.startswith("threads")]
    text = "\n".join(["[stacks]", *to_toml(options).splitlines(), "", "[camera]", *shared, ""])
    if card.exists():
        if card.read_text("utf-8") != text:
            raise ConfigError(f"{card}: was made with other options; give the same ones, or another output folder")
        return
    with atomic_file(card) as scratch:
        scratch.parent.mkdir(parents=True, exist_ok=True)
        scratch.write_text(text, "utf-8")


def is_complete(root: Path, part: Part, name: str, slices: int, noisy: bool) -> bool:
    """Say whether every file of a scene has been written."""
    stacks, pairs = stack_folder(root, noisy) / part, root / PAIRS / part
    wanted = [stacks / _slice_name(name, k, side) for k in range(slices) for side in "LR"]
    wanted += [pairs / f"{name}_{kind}_{side}.png" for kind in ("color", "depth") for side in "LR"]
    return all(path.is_file() for path in [*wanted, pairs / f"{name}_disparity_L.pfm"])


def write_dual_stack(root: Path, part: Part, sample: DualStack, noisy: bool) -> None:
    """Write one scene; every file appears whole, files of an earlier, interrupted run are replaced.

    Raises
    ------
    InputError
        If the name cannot be part of a file name, or a disparity does not fit the layout's 0 to 100 px.
    OutputError
        If a file cannot be written.
    """
    if not re.fullmatch(r"[\w.-]+", sample.name):
        raise InputError(f"scene name {sample.name!r}: expected letters, digits, '-', '_' and '.' only; rename it")
    largest = float(max(sample.disparity.max(), sample.right_disparity.max()))
    if not 0 <= min(sample.disparity.min(), sample.right_disparity.min()) <= largest <= DEPTH_RANGE_PX:
        raise InputError(
            f"{sample.name}: disparities up to {largest:.1f} px, the layout holds 0 to 100 px; leave it out"
        )
    stacks, pairs = stack_folder(root, noisy) / part, root / PAIRS / part
    for folder in (stacks, pairs):
        folder.mkdir(parents=True, exist_ok=True)
    for side, picture, disparity in (
        ("L", sample.sharp, sample.disparity),
        ("R", sample.sharp_right, sample.right_disparity),
    ):
        _write_png(pairs / f"{sample.name}_color_{side}.png", srgb8(picture)[..., ::-1])
        _write_png(
            pairs / f"{sample.name}_depth_{side}.png", np.rint(disparity * (255 / DEPTH_RANGE_PX)).astype(np.uint8)
        )
    write_pfm(pairs / f"{sample.name}_disparity_L.pfm", sample.disparity, sample.known, force=True)
    for side, stack in (("L", sample.left), ("R", sample.right)):
        for k, slice_ in enumerate(stack.slices):
            _write_png(stacks / _slice_name(sample.name, k, side), srgb8(slice_)[..., ::-1])


def list_dual_stacks(root: Path, part: Part, noisy: bool) -> list[str]:
    """Return the names of the scenes of which there are slices.

    Raises
    ------
    InputError
        If there are none.
    """
    folder = stack_folder(root, noisy) / part
    found = (_SLICE.fullmatch(path.name) for path in sorted(folder.glob("*_image.png")))
    names = list(dict.fromkeys(match[1] for match in found if match))
    if not names:
        raise InputError(f"{folder}: holds no [scene]_[slice]_[L/R]_image.png; give the folder of a data set")
    return names


def read_dual_stack(
    root: Path, part: Part, name: str, noisy: bool, lens: PhotographOptions | None = None, far_first: bool = False
) -> DualStack:
    """Read one scene.

    Parameters
    ----------
    root
        Folder that holds ``binocular_focal_stack_noise`` or ``..._clean``.
    part
        Train or test.
    name
        The scene.
    noisy
        Read the slices with noise.
    lens
        Focus range and aperture, for data sets without ``stacks.toml``; the number of slices is counted.
    far_first
        Slice 0 is the farthest one, in data sets without ``stacks.toml``.

    Raises
    ------
    InputError
        If a file is missing or damaged, or nothing tells focus and aperture.
    ShapeError
        If the pictures differ in size, or the two stacks in slices.
    """
    stacks, pairs = stack_folder(root, noisy) / part, root / PAIRS / part
    card = stacks.parent / CARD
    if card.is_file():
        lens, far_first = from_mapping(PhotographOptions, read_toml(card).get("stacks", {}), f"{card} [stacks]"), False
    if lens is None:
        raise InputError(f"{card}: not there; say at which disparities the slices are focused, and the aperture ratio")
    both = [_read_slices(stacks, name, side) for side in "LR"]
    sharp, sharp_right = (read_picture(pairs / f"{name}_color_{side}.png") for side in "LR")
    disparity, right_disparity = (_read_depth(pairs / f"{name}_depth_{side}.png") for side in "LR")
    known = np.ones(disparity.shape, np.bool_)
    if (exact := pairs / f"{name}_disparity_L.pfm").is_file():
        unrounded, known = read_pfm(exact)
        disparity = np.where(known, unrounded, disparity).astype(np.float32)
    shapes = {a.shape[-3:-1] for a in (*both, sharp, sharp_right)} | {disparity.shape, right_disparity.shape}
    if len(shapes) != 1 or both[0].shape != both[1].shape:
        raise ShapeError(f"{stacks / name}: pictures of sizes {sorted(shapes)}, expected one size and as many slices")
    foci = np.linspace(lens.near_px, lens.far_px, len(both[0]), dtype=np.float32)
    left, right = (
        FocalStack(slices[::-1] if far_first else slices, foci, lens.aperture_ratio, f"{name} {side}")
        for slices, side in zip(both, ("left", "right"), strict=True)
    )
    return DualStack(name, left, right, sharp, sharp_right, disparity, known, right_disparity)


def _slice_name(name: str, k: int, side: str) -> str:
    return f"{name}_{k:02d}_{side}_image.png"


def _read_slices(folder: Path, name: str, side: str) -> Float32:
    matches = [_SLICE.fullmatch(path.name) for path in folder.glob(f"*_{side}_image.png")]
    own = {int(match[2]): folder / match[0] for match in matches if match and match[1] == name}
    if not own or sorted(own) != list(range(min(own), min(own) + len(own))):
        raise InputError(f"{folder}: slices {sorted(own)} of {name} {side}, expected a row without gaps; copy it again")
    slices = [read_picture(own[k]) for k in sorted(own)]
    if len({s.shape for s in slices}) != 1:
        raise ShapeError(f"{folder}: slices of {name} {side} differ in size, expected one size; copy them again")
    return np.stack(slices)


def _read_depth(path: Path) -> Float32:
    codes = picture_in(path, cv2.IMREAD_GRAYSCALE)
    if codes is None:
        raise InputError(f"{path}: not there or no picture; expected 8-bit disparity, 255 = 100 px")
    return np.asarray(codes * np.float32(DEPTH_RANGE_PX / 255), np.float32)


def _write_png(path: Path, coded: UInt8) -> None:
    _, content = cv2.imencode(".png", np.ascontiguousarray(coded))
    with atomic_file(path, force=True) as scratch:
        scratch.write_bytes(content.tobytes())
