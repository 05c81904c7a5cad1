"""Point clouds as PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfstereo.depth.points import PointCloud
from lfstereo.errors import InputError
from lfstereo.outputs import atomic_file

_VERTEX = np.dtype([(n, "<f4") for n in ("x", "y", "z")] + [(n, "u1") for n in ("red", "green", "blue")])


def write_ply(path: Path, cloud: PointCloud, force: bool = False) -> None:
    """Write points as binary little-endian PLY: x y z float in metres, red green blue uchar in sRGB.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.

    References
    ----------
    Turk, "The PLY polygon file format" (1994).
    """
    from plyfile import PlyData, PlyElement

    vertices = np.empty(len(cloud.points_m), _VERTEX)
    for i, name in enumerate(("x", "y", "z")):
        vertices[name] = cloud.points_m[:, i]
    for i, name in enumerate(("red", "green", "blue")):
        vertices[name] = cloud.colours[:, i]
    comments = ["metres; x right, y down, z forward from the rectified left camera; sRGB"]
    with atomic_file(path, force) as scratch:
        element = PlyElement.describe(vertices, "vertex")
        PlyData([element], text=False, byte_order="<", comments=comments).write(str(scratch))


def read_ply(path: Path) -> PointCloud:
    """Read points with colours from a PLY file of any byte order.

    Raises
    ------
    InputError
        If the file cannot be read, is no PLY file, or lacks positions or colours.
    """
    from plyfile import PlyData, PlyParseError

    try:
        vertices = PlyData.read(str(path))["vertex"].data
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a PLY file") from error
    except (PlyParseError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not a readable PLY file of points ({error}); write it again") from error
    found = vertices.dtype.names or ()
    missing = [name for name in _VERTEX.names or () if name not in found]
    if missing:
        raise InputError(
            f"{path}: points lack {', '.join(missing)}, found {', '.join(found)}; expected x y z and colours"
        )
    points = np.stack([vertices[n] for n in ("x", "y", "z")], axis=-1).astype(np.float32)
    colours = np.stack([vertices[n] for n in ("red", "green", "blue")], axis=-1).astype(np.uint8)
    return PointCloud(points, colours)
