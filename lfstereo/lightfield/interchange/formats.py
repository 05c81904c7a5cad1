"""The formats a light field can be written in, by name and by file suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

from lfstereo.develop.options import ColourSpace
from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.eslf import write_eslf
from lfstereo.lightfield.interchange.lftoolbox_mat import write_decoded_mat
from lfstereo.lightfield.interchange.picture_folders import write_hci_folder, write_tiff_folder
from lfstereo.lightfield.options import PictureOptions
from lfstereo.lightfield.store import write_light_field
from lfstereo.lightfield.views_folder import write_views_folder
from lfstereo.progress import Progress, silent

FormatName = Literal["h5", "mat", "eslf", "hci", "png", "tiff"]
Writer: TypeAlias = Callable[[Path, LightField, bool, Progress], None]
PictureWriter: TypeAlias = Callable[[Path, LightField, bool, Progress, PictureOptions], None]


def _write_h5(path: Path, light_field: LightField, force: bool, progress: Progress) -> None:
    write_light_field(path, light_field, force)
    progress(1, 1)


_LINEAR: dict[FormatName, Writer] = {"h5": _write_h5, "mat": write_decoded_mat}
_PICTURES: dict[FormatName, PictureWriter] = {
    "eslf": write_eslf,
    "hci": write_hci_folder,
    "png": write_views_folder,
    "tiff": write_tiff_folder,
}
_SPACES: dict[FormatName, tuple[ColourSpace, ...]] = {"hci": ("srgb",), "png": ("srgb", "display-p3")}
"""What a format can hold, where it is not all: 8 bits are too few for linear light and for very wide primaries."""
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


def check_pictures(name: FormatName, pictures: PictureOptions) -> None:
    """Refuse a colour space, an exposure or a treatment of highlights that a format has no place for.

    Raises
    ------
    ConfigError
        If the format cannot hold it.
    """
    if name in _LINEAR and pictures != PictureOptions():
        raise ConfigError(
            f"format {name}: found options of pictures ({pictures}), expected none as it holds linear light as "
            "decoded; leave them out, or export tiff"
        )
    spaces = _SPACES.get(name, (pictures.colour_space,))
    if pictures.colour_space not in spaces:
        raise ConfigError(
            f"format {name}: found the colour space {pictures.colour_space}, expected {' or '.join(spaces)}, as its "
            "pictures have 8 bits; export tiff or eslf, which have 16"
        )


def export_light_field(
    path: Path,
    light_field: LightField,
    name: FormatName | None = None,
    force: bool = False,
    progress: Progress = silent,
    pictures: PictureOptions = PictureOptions(),
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
    pictures
        How linear light becomes pictures, in the formats that hold some.

    Raises
    ------
    ConfigError
        If the suffix stands for no format, or for another than the one named, or the format cannot hold pictures so.
    OutputError
        If the output exists and ``force`` is not set, or it cannot be written.
    """
    chosen = choose_format(path, name)
    check_pictures(chosen, pictures)
    if chosen in _LINEAR:
        _LINEAR[chosen](path, light_field, force, progress)
    else:
        _PICTURES[chosen](path, light_field, force, progress, pictures)
