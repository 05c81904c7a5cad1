"""The small files that come with a camera's white images: serial number, factory lattices, hot pixels, manifest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import UInt16
from lfstereo.container.fields import LARGEST, LONGEST_TEXT, Json
from lfstereo.container.reader import parse_json
from lfstereo.errors import ContainerError, MetadataError

UNIT_INFO = "unit_info.json"
"""States the camera's serial number, which the text files beside the white images sometimes get wrong."""
HOT_PIXELS = "hotpixel.bin"
FACTORY_LATTICES = ("mla_calibration.json", "mlacalibration.txt")
"""Of the Illum and of the first camera."""
MANIFEST = "cal_file_manifest.json"
_COUNT_BYTES = 4


@dataclass(frozen=True, slots=True)
class FactoryLattice:
    """The lenslet lattice that the factory noted for one zoom and focus: a start value, never to be trusted."""

    zoom_step: int
    focus_step: int
    origin_px: tuple[float, float]
    """(x, y) of the lenslet in the middle of the sensor."""
    step_x_px: tuple[float, float]
    """(x, y) to the right neighbour."""
    step_y_px: tuple[float, float]
    """(x, y) to the neighbour 60 degrees from it."""


def parse_serial(data: bytes, where: str) -> str:
    """Read the serial number from ``unit_info.json``.

    References
    ----------
    Light Field Toolbox v0.5.1, LFGatherCamInfo: ``camera.serialNumber`` goes before the white images' own.

    Raises
    ------
    ContainerError
        If the file is not JSON.
    MetadataError
        If it names no serial number.
    """
    camera = parse_json(data, where).get("camera")
    serial = camera.get("serialNumber") if isinstance(camera, dict) else None
    if not isinstance(serial, str) or not 0 < len(serial) <= LONGEST_TEXT or not serial.isprintable():
        raise MetadataError(
            f"{where}: field camera.serialNumber: found {repr(serial)[:60]}, expected the camera's serial number; copy "
            "the file again"
        )
    return serial


def parse_hot_pixels(data: bytes, where: str) -> UInt16:
    """Read the list of bad pixels from ``HOTPIXEL.BIN``.

    The file holds the number of pixels as little-endian uint32, then their x, then their y as uint16, counted from 0.

    Returns
    -------
    ``(N, 2)`` uint16 (x, y).

    References
    ----------
    Light Field Toolbox, branch develop0.6, LFReadHotPixels.

    Raises
    ------
    ContainerError
        If the number of bytes does not fit the number of pixels.

    Examples
    --------
    >>> parse_hot_pixels(bytes([2, 0, 0, 0, 5, 0, 6, 0, 7, 0, 8, 0]), "HOTPIXEL.BIN").tolist()
    [[5, 7], [6, 8]]
    """
    count = int.from_bytes(data[:_COUNT_BYTES], "little")
    expected = _COUNT_BYTES + 4 * count
    if len(data) != expected:
        raise ContainerError(
            f"{where}: found {len(data)} bytes, expected {expected} for {count} hot pixels; copy it again"
        )
    columns = np.frombuffer(data, "<u2", offset=_COUNT_BYTES).reshape(2, count)
    return np.ascontiguousarray(columns.T.astype(np.uint16))


def parse_factory_lattices(data: bytes, where: str) -> tuple[FactoryLattice, ...]:
    """Read the lattices of all zoom and focus steps from ``mla_calibration.json``.

    References
    ----------
    M. Le Pendu, LFToolbox-CLIM, load_mla_calib and SHLFBuildCalibGrid: ``zoomPosition[i]``,
    ``focusPosition[i][j]``, ``xDiskOriginPixels[i][j]``, ``xDiskStepPixelsX[i][j]`` and so on.

    Raises
    ------
    ContainerError
        If the file is not JSON.
    MetadataError
        If a table is missing, or the tables differ in shape.
    """
    table = parse_json(data, where)
    zooms = _numbers(table, "zoomPosition", where)
    focuses = _rows(table, "focusPosition", len(zooms), where)
    names = ["xDiskOriginPixels", "yDiskOriginPixels"]
    names += ["xDiskStepPixelsX", "xDiskStepPixelsY", "yDiskStepPixelsX", "yDiskStepPixelsY"]
    columns = [_rows(table, name, len(zooms), where) for name in names]
    found = []
    for i, zoom in enumerate(zooms):
        if any(len(column[i]) != len(focuses[i]) for column in columns):
            raise MetadataError(f"{where}: found tables of different lengths at zoom {zoom:g}; copy the file again")
        for j, focus in enumerate(focuses[i]):
            x, y, xx, xy, yx, yy = (column[i][j] for column in columns)
            found.append(FactoryLattice(round(zoom), round(focus), (x, y), (xx, xy), (yx, yy)))
    return tuple(found)


def parse_manifest(data: bytes, where: str) -> dict[str, str]:
    """Read which white image belongs to which reference that pictures carry, from ``cal_file_manifest.json``.

    References
    ----------
    C. Hahne, PlenoptiCam, cali_finder: ``calibrationFiles[]`` with ``hash`` (a picture's geometryCorrectionRef)
    and ``name``, such as ``MOD_0015.GCT``, which stands beside ``MOD_0015.RAW``.

    Returns
    -------
    SHA-1 reference in lower case -> name without suffix, such as ``MOD_0015``.

    Raises
    ------
    ContainerError
        If the file is not JSON.
    MetadataError
        If it has no list of files.
    """
    files = parse_json(data, where).get("calibrationFiles")
    if not isinstance(files, list):
        raise MetadataError(f"{where}: field calibrationFiles: found {type(files).__name__}, expected a list")
    pairs = ((entry.get("hash"), entry.get("name")) for entry in files if isinstance(entry, dict))
    return {
        reference.lower(): name.rpartition(".")[0] or name
        for reference, name in pairs
        if isinstance(reference, str) and isinstance(name, str)
    }


def _numbers(table: Json, name: str, where: str) -> list[float]:
    values = table.get(name)
    if not isinstance(values, list) or not all(_is_number(value) for value in values):
        raise MetadataError(f"{where}: field {name}: found no list of numbers, expected one; copy the file again")
    return [float(value) for value in values]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST


def _rows(table: Json, name: str, count: int, where: str) -> list[list[float]]:
    """Return the rows of a table, one per zoom; a row of one focus may be a plain number."""
    rows = table.get(name)
    if not isinstance(rows, list) or len(rows) != count:
        raise MetadataError(f"{where}: field {name}: found no table of {count} rows, expected one; copy the file again")
    found: list[list[float]] = []
    for row in rows:
        values = row if isinstance(row, list) else [row]
        if not all(_is_number(value) for value in values):
            raise MetadataError(f"{where}: field {name}: found something else than numbers; copy the file again")
        found.append([float(value) for value in values])
    return found
