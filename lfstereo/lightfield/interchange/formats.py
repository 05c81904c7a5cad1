"""The formats a light field can be written in, by name and by file suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.eslf import write_eslf
from lfstereo.lightfield.interchange.lftoolbox_mat import write_decoded_mat
from lfstereo.lightfield.interchange.picture_folders import write_hci_folder, write_tiff_folder
from lfstereo.lightfield.store import write_light_field
from lfstereo.lightfield.views_folder import write_views_folder
from lfstereo.progress import Progress, silent

FormatName = Literal["h5", "mat", "eslf", "hci", "png", "tiff"]
Writer: TypeAlias = Callable[[Path, LightField, bool, Progress], None]


def _write_h5(path: Path, light_field: LightField, force: bool, progress: Progress) -> None:
    write_light_field(path, light_field, force)
    progress(1, 1)


FORMATS: dict[FormatName, Writer] = {
    "h5": _write_h5,
    "mat": write_decoded_mat,
    "eslf": write_eslf,
    "hci": write_hci_folder,
    "png": write_views_folder,
    "tiff": write_tiff_folder,
}
_BY_SUFFIX: dict[str, FormatName] = {".h5": "h5", ".hdf5": "h5", ".mat": "mat", ".png": "eslf", "": "png"}
_SUFFIXES: dict[FormatName, tuple[str, ...]] = {"h5": (".h5", ".hdf5"), "mat": (".mat",), "eslf": (".png",)}


def choose_format(path: Path, name: FormatName | None = None) -> FormatName:
    """Return the format that a path asks for, or check that a named one fits it.

    Raises
    ------
    ConfigError
        If the suffix stands for no format, or for another than the one named.

    Examples
    --------
    >>> choose_format(Path("scene.mat")), choose_format(Path("views")), choose_format(Path("views"), "tiff")
    ('mat', 'png', 'tiff')
    """
    suffix = path.suffix.lower()
    if name is None:
        if suffix not in _BY_SUFFIX:
            raise ConfigError(
                f"{path}: found the suffix '{path.suffix}', expected .h5, .mat, .png (ESLF), .dng (raw mosaic) or none "
                "for a folder; rename the output or give --format"
            )
        return _BY_SUFFIX[suffix]
    wanted = _SUFFIXES.get(name)
    if (wanted is not None and suffix not in wanted) or (wanted is None and suffix in (".h5", ".mat", ".png", ".tif")):
        expected = "a folder" if wanted is None else f"a file name ending in {wanted[0]}"
        raise ConfigError(f"{path}: found the suffix '{path.suffix}', expected {expected} for format {name}; rename it")
    return name


def export_light_field(
    path: Path,
    light_field: LightField,
    name: FormatName | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> None:
    """Write a light field for another program.

    Parameters
    ----------
    path
        File or folder to write.
    light_field
        What to write.
    name
        Format; ``None`` takes it from the suffix of ``path``, a folder of PNG views where there is none.
    force
        Replace an output that exists.
    progress
        Told of the views written.

    Raises
    ------
    ConfigError
        If the suffix stands for no format, or for another than the one named.
    OutputError
        If the output exists and ``force`` is not set, or it cannot be written.
    """
    FORMATS[choose_format(path, name)](path, light_field, force, progress)
