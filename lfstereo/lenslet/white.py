"""Choose the white image that belongs to a photograph."""

from __future__ import annotations

from pathlib import Path

from lfstereo.container.capture import Capture, read_capture
from lfstereo.container.members import is_archive
from lfstereo.container.metadata import FrameMetadata
from lfstereo.container.serials import camera_mark, same_camera
from lfstereo.errors import AssetError
from lfstereo.lenslet.flatten import mean_brightness
from lfstereo.lenslet.library import WhiteImage, WhiteLibrary, open_library

_DARK_BELOW = 0.03


def find_white_image(place: Path, metadata: FrameMetadata) -> Capture:
    """Find the white image taken by the same camera nearest in zoom, then in focus.

    Parameters
    ----------
    place
        Folder that holds white images (``MOD_*.RAW`` with ``.TXT`` beside, in any sub-folder), ``.tar`` archives or
        backup volumes of them, one such archive, or one white image.
    metadata
        Of the photograph: serial number, size, zoom and focus step.

    Returns
    -------
    The white image; dark frames are passed over.

    Raises
    ------
    AssetError
        If the place does not exist, or holds no white image of this camera.
    ContainerError, MetadataError
        If the chosen file is damaged.
    """
    if place.is_file() and not is_archive(place):
        white = read_capture(place)
        refuse_other_camera(white.metadata, metadata, str(place))
        return white
    return first_bright(whites_of_camera(open_library(place), metadata))[1]


def whites_of_camera(library: WhiteLibrary, metadata: FrameMetadata) -> tuple[WhiteImage, ...]:
    """Return the white images of a picture's camera, the nearest first, as `WhiteLibrary.of_camera`.

    Raises
    ------
    AssetError
        If there are none.
    """
    place = library.place
    if not library.whites:
        reason = f"; the first unreadable one: {library.problems[0]}" if library.problems else ""
        raise AssetError(
            f"{place}: found no white image, expected MOD_*.RAW with .TXT beside; copy the camera's calibration "
            f"files there{reason}"
        )
    fitting = library.of_camera(metadata)
    if not fitting:
        found = sorted({camera_mark(white.serial) or "unknown" for white in library.whites})
        raise AssetError(
            f"{place}: found white images of camera {', '.join(found)}, expected "
            f"{camera_mark(metadata.serial) or 'one'} ({metadata.width} x {metadata.height} px) as the capture; give "
            "the white images of that camera"
        )
    return fitting


def first_bright(whites: tuple[WhiteImage, ...]) -> tuple[WhiteImage, Capture]:
    """Read the first white image that is not a dark frame.

    Raises
    ------
    AssetError
        If all are dark.
    ContainerError, MetadataError
        If one of them is damaged.
    """
    for white in whites:
        capture = white.read()
        if mean_brightness(capture) >= _DARK_BELOW:
            return white, capture
    first = whites[0]
    raise AssetError(
        f"{first.raw.where}: found only dark frames of camera {camera_mark(first.serial)}; copy the camera's white "
        "images there"
    )


def refuse_other_camera(found: FrameMetadata, wanted: FrameMetadata, where: str) -> None:
    """Refuse a white image of another size or camera than the picture.

    Raises
    ------
    AssetError
        If it is one.
    """
    if (found.width, found.height) != (wanted.width, wanted.height):
        raise AssetError(
            f"{where}: found a white image of {found.width} x {found.height} px, expected {wanted.width} x "
            f"{wanted.height} as the capture; give the white image of the same camera"
        )
    if wanted.serial and not (found.serial and same_camera(found.serial, wanted.serial)):
        raise AssetError(
            f"{where}: found a white image of camera {camera_mark(found.serial) or 'unknown'}, expected "
            f"{camera_mark(wanted.serial)} as the capture; give the white image of the same camera"
        )
