"""Disparity as 16-bit PNG files, as KITTI exchanges it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, check_shape
from lfstereo.container.picture_size import decoded_picture
from lfstereo.errors import InputError, ShapeError
from lfstereo.outputs import atomic_file

STEPS_PER_PX = 256
_LARGEST_PX = 65535 / STEPS_PER_PX


def write_disparity_png(path: Path, disparity: Float32, valid: Bool | None = None, force: bool = False) -> None:
    """Write disparity times 256 as 16-bit grey, 0 where unknown; a known disparity below 1/256 px is stored as 1/256.

    Parameters
    ----------
    path
        The file to write.
    disparity
        ``(V, U)`` px, 0 to 255.99 where valid.
    valid
        ``(V, U)``, or ``None`` where every disparity is known.
    force
        Replace an existing file.

    Raises
    ------
    ShapeError
        If ``disparity`` is no image, or ``valid`` has another shape.
    InputError
        If a valid disparity does not fit the format.
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.

    References
    ----------
    Menze and Geiger, "Object scene flow for autonomous vehicles" (2015), KITTI development kit.
    """
    check_shape(f"{path}: disparity", disparity, (None, None))
    known = np.ones(disparity.shape, np.bool_) if valid is None else valid
    if known.shape != disparity.shape:
        raise ShapeError(f"{path}: valid has shape {known.shape}, expected {disparity.shape} as the disparity")
    values = disparity[known]
    if values.size and not (values.min() >= 0 and values.max() <= _LARGEST_PX):
        raise InputError(
            f"{path}: disparities from {values.min():.2f} to {values.max():.2f} px, a 16-bit PNG holds "
            f"0 to {_LARGEST_PX:.2f}; write PFM instead"
        )
    steps = np.zeros(disparity.shape, np.uint16)
    steps[known] = np.maximum(np.rint(values.astype(np.float64) * STEPS_PER_PX), 1)
    _, coded = cv2.imencode(".png", steps)
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(coded.tobytes())


def read_disparity_png(path: Path) -> tuple[Float32, Bool]:
    """Read a 16-bit PNG of disparity times 256.

    Returns
    -------
    tuple of Float32 and Bool
        Disparity ``(V, U)`` in px, 0 where unknown, and where it is known.

    Raises
    ------
    InputError
        If the file cannot be read, is no picture, or is not 16-bit grey.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a PNG file") from error
    steps = decoded_picture(data, cv2.IMREAD_UNCHANGED, str(path))
    if steps is None:
        raise InputError(f"{path}: not a readable picture, expected a 16-bit grey PNG; copy it again")
    if steps.dtype != np.uint16 or steps.ndim != 2:
        raise InputError(f"{path}: found {steps.dtype} pixels of shape {steps.shape}, expected a 16-bit grey PNG")
    return (steps / np.float32(STEPS_PER_PX)).astype(np.float32), steps > 0
