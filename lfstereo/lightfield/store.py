"""Light fields on disk: one HDF5 file, or read from a folder of views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from lfstereo.develop.colour_spaces import PRIMARIES
from lfstereo.develop.options import Primaries
from lfstereo.errors import ContainerError, InputError
from lfstereo.lightfield.encoding import from_codes, to_codes
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.lightfield.interchange import eslf, lftoolbox_mat
from lfstereo.lightfield.interchange.hdf5_guard import stored_dataset
from lfstereo.lightfield.interchange.picture_folders import read_picture_folder
from lfstereo.outputs import atomic_file, check_absent, check_space

SUFFIXES = (".h5", ".hdf5")
FORMAT_NAME = "lfstereo light field"
FORMAT_VERSION = 1
_ENCODING = "square root"
_FOREIGN = {lftoolbox_mat.SUFFIX: lftoolbox_mat.read_decoded_mat, eslf.SUFFIX: eslf.read_eslf}
_STEPS = ("zoom_step", "focus_step")
_SAMPLING = {"origin_px": 2, "step_px": 2, "rotation_rad": 1, "view_step_px": 1}


def read_light_field(path: Path) -> LightField:
    """Read a light field: a ``.h5`` file of lfstereo, a folder with one image per view, or another program's file.

    Other programs' files are the Light Field Toolbox's ``.mat`` and lenslet-packed ``.png`` pictures (ESLF).

    Raises
    ------
    ContainerError
        If there is no such file, or it is damaged, of another kind or of a later version.
    ShapeError
        If views or weights do not fit together.
    """
    if path.is_dir():
        return read_picture_folder(path)
    if not path.is_file():
        raise ContainerError(f"{path}: found no such file, expected a light field (.h5) or a folder of views")
    if path.suffix.lower() in _FOREIGN:
        return _FOREIGN[path.suffix.lower()](path)
    if path.suffix.lower() not in SUFFIXES:
        raise ContainerError(
            f"{path}: found the suffix '{path.suffix}', expected .h5, .mat, .png (ESLF) or a folder of views; "
            "decode a raw capture with 'lfstereo decode' first"
        )
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path)
    except InputError:
        raise
    except Exception as error:  # damaged files fail in many ways there
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ContainerError(f"{path}: not a readable HDF5 file ({reason}); decode the capture again") from error


def write_light_field(path: Path, light_field: LightField, force: bool = False) -> None:
    """Write a light field to one HDF5 file; it appears whole or not at all.

    The dataset ``views`` holds the square root of the linear values as 16-bit codes, so that values above 1
    survive and dark ones keep at least 13 bits: ``peak * (code / 65535)^2``. ``weight`` is stored as it is. Both are
    chunked per view. MATLAB and Octave read them with the axes the other way round.

    Parameters
    ----------
    path
        File name ending in ``.h5``.
    light_field
        What to write.
    force
        Replace an existing file.

    Raises
    ------
    ContainerError
        If the file name has another suffix.
    OutputError
        If the file exists and ``force`` is not set, or it cannot be written, or the disk has no room for it.
    """
    check_suffix(path)
    views = light_field.views
    check_absent(path, force)
    check_space(path, views.size * 2 + (0 if light_field.weight is None else light_field.weight.size))
    peak = max(1.0, float(views.max(initial=0.0)))
    with atomic_file(path, force) as scratch, h5py.File(scratch, "w") as file:
        stored = file.create_dataset("views", views.shape, np.uint16, chunks=(1, 1, *views.shape[2:]))
        stored.attrs["encoding"], stored.attrs["peak"] = _ENCODING, peak
        for t in range(views.shape[0]):
            stored[t] = to_codes(views[t], peak)
        if light_field.weight is not None:
            chunks = (1, 1, *views.shape[2:4])
            file.create_dataset("weight", data=light_field.weight, chunks=chunks)
        file.attrs["format"], file.attrs["version"] = FORMAT_NAME, FORMAT_VERSION
        file.attrs["colour_space"] = light_field.colour_space
        # For programs that read no attributes, such as Octave: views = peak * (codes / 65535)^2.
        file.create_dataset("peak", data=np.float64(peak))
        file.attrs["serial"], file.attrs["source"] = light_field.serial, light_field.source
        for name in _STEPS:
            if getattr(light_field, name) is not None:
                file.attrs[name] = getattr(light_field, name)
        if light_field.sampling is not None:
            group = file.create_group("sampling")
            for name in _SAMPLING:
                group.attrs[name] = np.asarray(getattr(light_field.sampling, name), np.float64)


def check_suffix(path: Path) -> None:
    """Refuse a file name that does not say HDF5.

    Raises
    ------
    ContainerError
        If the suffix is not ``.h5`` or ``.hdf5``.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ContainerError(f"{path}: found the suffix '{path.suffix}', expected .h5; give such a file name")


def _read(file: Any, path: Path) -> LightField:
    kind, version = _text(file, "format", path), file.attrs.get("version")
    if kind != FORMAT_NAME:
        raise ContainerError(f"{path}: found an HDF5 file of format '{kind}', expected '{FORMAT_NAME}'")
    if not isinstance(version, int | np.integer) or int(version) != FORMAT_VERSION:
        raise ContainerError(
            f"{path}: found format version {version}, expected {FORMAT_VERSION}; decode the capture again with this "
            "version of lfstereo"
        )
    views = _dataset(file, "views", np.dtype(np.uint16), 5, path)
    if views.shape[4] != 3:
        raise ContainerError(f"{path}: 'views' has shape {views.shape}, expected three colours last")
    peak = views.attrs.get("peak")
    if not np.array_equal(views.attrs.get("encoding"), _ENCODING) or not _is_number(peak) or not peak > 0:
        raise ContainerError(
            f"{path}: 'views' has encoding {views.attrs.get('encoding')!r} and peak {peak}, expected '{_ENCODING}' and "
            "a positive number; decode the capture again"
        )
    weight = None
    if "weight" in file:
        weight = _dataset(file, "weight", np.dtype(np.uint8), 4, path)[()]
    linear = np.empty(views.shape, np.float32)
    for t in range(views.shape[0]):
        linear[t] = from_codes(views[t], float(peak))
    return LightField(
        views=linear,
        weight=weight,
        sampling=_sampling(file, path),
        serial=_text(file, "serial", path),
        source=str(path),
        zoom_step=_step(file, "zoom_step", path),
        focus_step=_step(file, "focus_step", path),
        colour_space=_primaries(file, path),
    )


def _dataset(file: Any, name: str, dtype: np.dtype[Any], axes: int, path: Path) -> Any:
    found = stored_dataset(file, name, path)
    if found is None:
        raise ContainerError(f"{path}: found no dataset '{name}', expected one; decode the capture again")
    if found.dtype != dtype or found.ndim != axes or min(found.shape) < 1:
        raise ContainerError(
            f"{path}: '{name}' is {found.dtype} of shape {found.shape}, expected {dtype} with {axes} axes"
        )
    return found


def _sampling(file: Any, path: Path) -> ViewSampling | None:
    group = file.get("sampling")
    if group is None:
        return None
    values: dict[str, tuple[float, ...]] = {}
    for name, count in _SAMPLING.items():
        found = np.asarray(group.attrs.get(name, []))
        if found.size != count or found.dtype.kind not in "fi" or not np.isfinite(found).all():
            raise ContainerError(f"{path}: sampling '{name}' is {found.tolist()}, expected {count} finite numbers")
        values[name] = tuple(float(v) for v in found.ravel())
    if not (min(values["step_px"]) > 0 and values["view_step_px"][0] > 0):
        raise ContainerError(
            f"{path}: sampling steps are {values['step_px']} and {values['view_step_px'][0]} px, expected positive ones"
        )
    return ViewSampling(
        origin_px=(values["origin_px"][0], values["origin_px"][1]),
        step_px=(values["step_px"][0], values["step_px"][1]),
        rotation_rad=values["rotation_rad"][0],
        view_step_px=values["view_step_px"][0],
    )


def _primaries(file: Any, path: Path) -> Primaries:
    found: Any = file.attrs.get("colour_space", "srgb")
    if not isinstance(found, str) or found not in PRIMARIES.values():
        raise ContainerError(
            f"{path}: found colour space {found!r}, expected {', '.join(sorted(set(PRIMARIES.values())))}; decode the "
            "capture again with this version of lfstereo"
        )
    primaries: Primaries = found  # type: ignore[assignment]
    return primaries


def _step(file: Any, name: str, path: Path) -> int | None:
    found = file.attrs.get(name)
    if found is not None and not isinstance(found, int | np.integer):
        raise ContainerError(f"{path}: '{name}' is {found!r}, expected a whole number; decode the capture again")
    return None if found is None else int(found)


def _text(file: Any, name: str, path: Path) -> str:
    found = file.attrs.get(name)
    if not isinstance(found, str):
        raise ContainerError(
            f"{path}: found no text '{name}', expected the attributes of a light field; decode the capture again"
        )
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and bool(np.isfinite(value))
