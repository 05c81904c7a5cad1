"""Focal stacks on their way from the worker that rendered them to the one with the network."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from lfstereo.errors import ContainerError
from lfstereo.focus.stack import FocalStack
from lfstereo.outputs import atomic_file
from lfstereo.pipeline import FocusedPair, SideResult
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import StereoRig


def write_focused(path: Path, focused: FocusedPair) -> None:
    """Write both cameras' stacks, centre views and fields of view, float32 as they are.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    arrays = {}
    for side, part in (("left", focused.left), ("right", focused.right)):
        arrays[f"{side}_slices"] = part.stack.slices
        arrays[f"{side}_disparities_px"] = part.stack.disparities_px
        arrays[f"{side}_aperture_ratio"] = np.asarray(part.stack.aperture_ratio)
        arrays[f"{side}_centre_view"] = part.centre_view
        arrays[f"{side}_seen"] = part.seen
        arrays[f"{side}_texts"] = np.asarray([part.stack.source, part.serial])
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path, force=True) as scratch, scratch.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def read_focused(path: Path, rig: StereoRig) -> FocusedPair:
    """Read what :func:`write_focused` wrote.

    Raises
    ------
    ContainerError
        If it is missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            left, right = (_side(arrays, side) for side in ("left", "right"))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ContainerError(f"{path}: focal stacks cannot be read ({error}); start the batch again") from error
    return FocusedPair(left, right, rectified_geometry(rig))


def _side(arrays: np.lib.npyio.NpzFile, side: str) -> SideResult:
    source, serial = (str(text) for text in arrays[f"{side}_texts"])
    stack = FocalStack(
        arrays[f"{side}_slices"], arrays[f"{side}_disparities_px"], float(arrays[f"{side}_aperture_ratio"]), source
    )
    return SideResult(stack, arrays[f"{side}_centre_view"], arrays[f"{side}_seen"], serial)
