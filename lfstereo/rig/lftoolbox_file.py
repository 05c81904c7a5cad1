"""The file in which the Light Field Toolbox keeps a camera's calibration."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from lfstereo.errors import ConfigError
from lfstereo.rig.lftoolbox import ToolboxIntrinsics


def read_calibration(path: Path) -> ToolboxIntrinsics:
    """Read ``CalInfo.json`` as the toolbox's calibration writes it.

    Raises
    ------
    ConfigError
        If the file cannot be read, or holds no intrinsics.
    ShapeError
        If intrinsics or distortion have another shape.
    RigError
        If the intrinsics cannot be inverted.

    References
    ----------
    Dansereau, "Light Field Toolbox for MATLAB" v0.5 (2020), LFUtilDecodeCalRect: the names of the fields.
    """
    try:
        table = json.loads(path.read_text("utf-8"))
        matrix = np.asarray(table["EstCamIntrinsicsH"], np.float64)
        distortion = np.asarray(table["EstCamDistortionV"], np.float64).ravel()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); give the toolbox's CalInfo.json") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{path}: found no EstCamIntrinsicsH and EstCamDistortionV of numbers, expected the toolbox's CalInfo.json"
        ) from error
    return ToolboxIntrinsics(matrix, distortion)
