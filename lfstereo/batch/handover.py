"""Focal stacks on their way from the worker that rendered them to the one with the network."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfstereo.errors import ContainerError
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.samples import ViewSamples
from lfstereo.outputs import atomic_file
from lfstereo.pipeline import FocusedPair, SideResult
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import StereoRig


def write_focused(path: Path, focused: FocusedPair) -> None:
    """Write what both cameras contribute, float32 as it is.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    arrays = _arrays("left", focused.left) | _arrays("right", focused.right)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path, force=True) as scratch, scratch.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


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
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ContainerError(f"{path}: focal stacks cannot be read ({error}); start the batch again") from error
    return FocusedPair(left, right, rectified_geometry(rig))


def _arrays(side: str, part: SideResult) -> dict[str, Any]:
    arrays = {
        "slices": part.stack.slices,
        "disparities_px": part.stack.disparities_px,
        "aperture_ratio": np.asarray(part.stack.aperture_ratio),
        "centre_view": part.centre_view,
        "seen": part.seen,
        "texts": np.asarray([part.stack.source, part.serial]),
        "slope_from_disparity": np.asarray(part.slope_from_disparity),
    }
    if part.samples is not None:
        arrays["pictures"] = part.samples.pictures
        arrays["places"] = np.asarray(part.samples.places)
        arrays["steps"] = np.asarray([part.samples.step, part.samples.views_in_all])
    return {f"{side}_{name}": array for name, array in arrays.items()}


def _side(arrays: Mapping[str, Any], side: str) -> SideResult:
    source, serial = (str(text) for text in arrays[f"{side}_texts"])
    stack = FocalStack(
        arrays[f"{side}_slices"], arrays[f"{side}_disparities_px"], float(arrays[f"{side}_aperture_ratio"]), source
    )
    samples = None
    if f"{side}_pictures" in arrays:
        step, views_in_all = (int(number) for number in arrays[f"{side}_steps"])
        places = tuple((int(s), int(t)) for s, t in arrays[f"{side}_places"])
        samples = ViewSamples(arrays[f"{side}_pictures"], places, step, views_in_all)
    per_px, at_zero = (float(number) for number in arrays[f"{side}_slope_from_disparity"])
    return SideResult(
        stack=stack,
        centre_view=arrays[f"{side}_centre_view"],
        seen=arrays[f"{side}_seen"],
        serial=serial,
        slope_from_disparity=(per_px, at_zero),
        samples=samples,
    )
