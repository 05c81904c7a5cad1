"""Choose the white image that belongs to a photograph."""

from __future__ import annotations

from pathlib import Path

from lfstereo.container.capture import BARE_SUFFIX, Capture, read_capture, read_sidecar
from lfstereo.container.metadata import FrameMetadata
from lfstereo.errors import AssetError, InputError
from lfstereo.lenslet.flatten import mean_brightness

_CAMERA_NAME_PART = "MOD_"
"""Part of the file name that the cameras give their white images."""
_DARK_BELOW = 0.03


def find_white_image(place: Path, metadata: FrameMetadata) -> Capture:
    """Find the white image taken by the same camera nearest in zoom, then in focus.

    Parameters
    ----------
    place
        Folder that holds white images (``MOD_*.RAW`` with ``.TXT`` beside, in any sub-folder), or one white image.
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
    if place.is_file():
        white = read_capture(place)
        _refuse_other_camera(white.metadata, metadata, str(place))
        return white
    if not place.is_dir():
        raise AssetError(f"{place}: found no such folder, expected the camera's white images; check the path")
    candidates, unreadable = _candidates(place)
    if not candidates:
        reason = f"; the first unreadable one: {unreadable[0]}" if unreadable else ""
        raise AssetError(
            f"{place}: found no white image, expected MOD_*.RAW with .TXT beside; copy the camera's calibration "
            f"files there{reason}"
        )
    fitting = [(path, found) for path, found in candidates if _same_camera(found, metadata)]
    if not fitting:
        serials = sorted({found.serial or "none" for _, found in candidates})
        raise AssetError(
            f"{place}: found white images of serial {', '.join(serials)}, expected {metadata.serial or 'one camera'} "
            f"({metadata.width} x {metadata.height} px) as the capture; give the white images of that camera"
        )
    for path, _ in sorted(fitting, key=lambda item: (*_distance(item[1], metadata), item[0])):
        white = read_capture(path)
        if mean_brightness(white) >= _DARK_BELOW:
            return white
    raise AssetError(
        f"{place}: found only dark frames of serial {metadata.serial}; copy the camera's white images there"
    )


def _candidates(folder: Path) -> tuple[list[tuple[Path, FrameMetadata]], list[str]]:
    found, unreadable = [], []
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() == BARE_SUFFIX):
        try:
            metadata = read_sidecar(path)
        except InputError as error:
            unreadable.append(str(error))
            continue
        named = _CAMERA_NAME_PART in path.name.upper()
        if (metadata.is_white_image or named) and not metadata.is_dark_frame:
            found.append((path, metadata))
    return found, unreadable


def _same_camera(found: FrameMetadata, wanted: FrameMetadata) -> bool:
    same_size = (found.width, found.height) == (wanted.width, wanted.height)
    return same_size and (not wanted.serial or found.serial == wanted.serial)


def _distance(found: FrameMetadata, wanted: FrameMetadata) -> tuple[int, int]:
    zoom = abs(found.lens.zoom_step - wanted.lens.zoom_step)
    return zoom, abs(found.lens.focus_step - wanted.lens.focus_step)


def _refuse_other_camera(found: FrameMetadata, wanted: FrameMetadata, where: str) -> None:
    if (found.width, found.height) != (wanted.width, wanted.height):
        raise AssetError(
            f"{where}: found a white image of {found.width} x {found.height} px, expected {wanted.width} x "
            f"{wanted.height} as the capture; give the white image of the same camera"
        )
    if wanted.serial and found.serial != wanted.serial:
        raise AssetError(
            f"{where}: found a white image of serial {found.serial or 'none'}, expected {wanted.serial} as the "
            "capture; give the white image of the same camera"
        )
