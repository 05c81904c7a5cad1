"""Decoded light fields of the Light Field Toolbox for MATLAB: ``NAME__Decoded.mat``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from lfstereo import __version__
from lfstereo.develop.colour_spaces import PRIMARIES
from lfstereo.develop.options import Primaries
from lfstereo.errors import ContainerError, InputError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.description import from_text, to_text
from lfstereo.lightfield.interchange.hdf5_guard import stored_dataset
from lfstereo.lightfield.interchange.mat5 import read_array
from lfstereo.lightfield.options import PictureOptions
from lfstereo.outputs import atomic_file, check_absent, check_space
from lfstereo.progress import Progress, silent

SUFFIX = ".mat"
_USER_BLOCK_BYTES = 512
_OWN_TEXT = "lfstereo"
_LONGEST_TEXT = 1 << 16
_LARGEST_VALUES = 4 * 10**9


def write_decoded_mat(path: Path, light_field: LightField, force: bool = False, progress: Progress = silent) -> None:
    """Write a light field as MATLAB's version 7.3 and the toolbox's functions expect it.

    ``LF(j, i, l, k, c)`` is ``uint16``, linear, 65535 = white, with the weight as its last channel where there is one;
    values above 1 are clipped. Where the views lie on the sensor is kept in the text ``lfstereo``.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or it cannot be written, or the disk has no room for it.

    References
    ----------
    MathWorks, "MAT-File Format" (2023): 128 bytes of text and version in front; version 7.3 is HDF5 behind 512 bytes.
    Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), manual: the variables of a decoded light field.
    """
    views, weight = light_field.views, light_field.weight
    rows, columns, height, width = views.shape[:4]
    channels = 3 if weight is None else 4
    check_absent(path, force)
    check_space(path, views.size // 3 * channels * 2)
    with atomic_file(path, force) as scratch:
        with h5py.File(scratch, "w", userblock_size=_USER_BLOCK_BYTES) as file:
            # MATLAB stores the first index fastest, so HDF5 has the axes the other way round.
            shape, chunk = (channels, width, height, columns, rows), (1, width, height, 1, 1)
            stored = file.create_dataset("LF", shape, np.uint16, chunks=chunk)
            stored.attrs["MATLAB_class"] = np.bytes_("uint16")
            for t in range(rows):
                for s in range(columns):
                    scaled = np.clip(views[t, s], 0, 1) * np.float32(65535) + np.float32(0.5)
                    stored[:3, :, :, s, t] = scaled.astype(np.uint16).transpose(2, 1, 0)
                    if weight is not None:
                        stored[3, :, :, s, t] = weight[t, s].T.astype(np.uint16) * np.uint16(257)
                    progress(t * columns + s + 1, rows * columns)
            options = {"NColChans": 3.0, "NWeightChans": float(channels - 3)}
            made = {"mfilename": "lfstereo", "time": time.strftime("%d-%b-%Y %H:%M:%S"), "VersionStr": __version__}
            _put(file, "DecodeOptions", options)
            _put(file, "GeneratedByInfo", made)
            if light_field.serial:
                _put(file, "LFMetadata", {"SerialData": {"camera": {"serialNumber": light_field.serial}}})
            _put(file, _OWN_TEXT, to_text(light_field, PictureOptions(colour_space=light_field.colour_space)))
        with scratch.open("r+b") as plain:
            plain.write(_head())


def read_decoded_mat(path: Path) -> LightField:
    """Read a decoded light field of the toolbox, of any version of MAT-file.

    Returns
    -------
    Three colours, linear, and the weight where there is a fourth channel. Without a place on a sensor, unless lfstereo
    wrote the file.

    Raises
    ------
    ContainerError
        If the file is damaged or holds no light field.
    """
    try:
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                return _read_hdf5(file, path)
        return _read_older(path)
    except InputError:
        raise
    except Exception as error:  # damaged files fail in many ways there
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ContainerError(f"{path}: not a readable MAT-file ({reason}); decode the capture again") from error


def _head() -> bytes:
    text = f"MATLAB 7.3 MAT-file, Platform: lfstereo {__version__}, Created on: {time.strftime('%a %b %d %H:%M:%S %Y')}"
    return f"{text} HDF5 schema 1.00 .".encode("ascii").ljust(116) + bytes(8) + b"\x00\x02IM"


def _put(parent: Any, name: str, value: dict[str, Any] | float | str) -> None:
    """Store a structure, a number or a text as MATLAB does."""
    if isinstance(value, dict):
        group = parent.create_group(name)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, inner in value.items():
            _put(group, field, inner)
    elif isinstance(value, str):
        letters = np.frombuffer(value.encode("utf-16-le"), np.uint16)[:, None]
        stored = parent.create_dataset(name, data=letters)
        stored.attrs["MATLAB_class"], stored.attrs["MATLAB_int_decode"] = np.bytes_("char"), np.int32(2)
    else:
        stored = parent.create_dataset(name, data=np.array([[value]], np.float64))
        stored.attrs["MATLAB_class"] = np.bytes_("double")


def _read_hdf5(file: Any, path: Path) -> LightField:
    stored = stored_dataset(file, "LF", path)
    if stored is None:
        raise ContainerError(f"{path}: found no variable 'LF', expected one; give a file named NAME__Decoded.mat")
    _check_kind(stored.shape[::-1], stored.dtype, path)
    channels, width, height, columns, rows = stored.shape
    views = np.empty((rows, columns, height, width, 3), np.float32)
    for c in range(3):
        views[..., c] = _share(stored[c].transpose(3, 2, 1, 0))
    weight = _weight(stored[3].transpose(3, 2, 1, 0)) if channels == 4 else None
    serial, sampling = "", None
    primaries: Primaries = "srgb"
    own = stored_dataset(file, _OWN_TEXT, path)
    if own is not None and own.dtype == np.uint16 and own.size <= _LONGEST_TEXT:
        text = np.asarray(own[()], np.uint16).tobytes().decode("utf-16-le", "replace")
        found = from_text(text, f"{path}: {_OWN_TEXT}")
        serial, sampling, primaries = found.serial, found.sampling, PRIMARIES[found.colour_space]
    return LightField(_finite(views, path), weight, sampling, serial, str(path), colour_space=primaries)


def _read_older(path: Path) -> LightField:
    found = read_array(path, "LF")
    if found is None:
        raise ContainerError(f"{path}: found no variable 'LF', expected one; give a file named NAME__Decoded.mat")
    stored = found
    _check_kind(stored.shape, stored.dtype, path)
    weight = _weight(stored[..., 3]) if stored.shape[4] == 4 else None
    views = np.ascontiguousarray(_share(stored[..., :3]))
    return LightField(_finite(views, path), weight, None, "", str(path))


def _check_kind(shape: tuple[int, ...], dtype: np.dtype[Any], path: Path) -> None:
    """Refuse a variable that is not ``LF(j, i, l, k, c)``."""
    fits = len(shape) == 5 and shape[4] in (3, 4) and min(shape) > 0 and dtype.name in _KINDS
    if not fits or int(np.prod(np.asarray(shape, np.float64))) > _LARGEST_VALUES:
        raise ContainerError(
            f"{path}: 'LF' is {dtype} of size {' x '.join(map(str, shape))}, expected views of three colours or of "
            "three colours and a weight, LF(j, i, l, k, c); give a light field in colour"
        )


_KINDS = {"uint8": 255, "uint16": 65535, "float32": 1, "float64": 1}


def _share(stored: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    return stored.astype(np.float32) / np.float32(_KINDS[stored.dtype.name])


def _weight(stored: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    share = np.nan_to_num(_share(stored), nan=0.0)
    return np.ascontiguousarray(np.rint(np.clip(share, 0, 1) * np.float32(255)).astype(np.uint8))


def _finite(views: npt.NDArray[np.float32], path: Path) -> npt.NDArray[np.float32]:
    if not all(np.isfinite(row).all() for row in views):
        raise ContainerError(f"{path}: 'LF' holds values that are no numbers; set them to 0 with a weight of 0")
    return views
