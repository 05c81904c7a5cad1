"""A raw mosaic that comes as an ordinary image file, with the profile of its camera in place of metadata."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lfstereo.arrays import UInt8, UInt16
from lfstereo.assets import asset_folder
from lfstereo.container.capture import IMAGE_SUFFIXES, Capture
from lfstereo.container.jpeg_mosaic import restore_mosaic
from lfstereo.container.metadata import FrameMetadata, parse_metadata
from lfstereo.container.picture_size import is_picture
from lfstereo.errors import AssetError, ContainerError, MetadataError
from lfstereo.options import read_toml

_FINER = 16
"""Digital numbers per one of the file: 12 bits for what 8 cannot hold."""


def camera_names() -> tuple[str, ...]:
    """Return the names of the camera profiles that come with lfstereo."""
    return tuple(sorted(path.stem for path in (asset_folder("calib") / "cameras").glob("*.toml")))


def read_camera_profile(camera: str, bits: int | None = None) -> FrameMetadata:
    """Read what is typical of a camera model.

    Parameters
    ----------
    camera
        Name of a profile in ``calib/cameras``, such as ``lytro-f01``, or path of such a TOML file.
    bits
        Give the levels and bits of a mosaic stored with 8 bits; None gives those of the camera's own raw frames.

    Raises
    ------
    AssetError
        If there is no such profile.
    ConfigError
        If the file is not TOML.
    MetadataError
        If the profile lacks a field or holds a value that cannot be.
    """
    path = Path(camera) if camera.endswith(".toml") else asset_folder("calib") / "cameras" / f"{camera}.toml"
    if not path.is_file():
        raise AssetError(
            f"{camera}: found no such camera profile, expected one of {', '.join(camera_names())} or a TOML file"
        )
    profile: dict[str, Any] = read_toml(path)
    metadata = parse_metadata(profile, None, str(path))
    if bits != 8:
        return metadata
    sites = ("r", "gr", "gb", "b")
    levels, image = profile.get("levels_8_bit"), profile.get("image")
    if not isinstance(levels, dict) or not isinstance(image, dict):
        raise MetadataError(
            f"{path}: found no tables [image] and [levels_8_bit], expected both for a mosaic of 8 bits; add them"
        )
    stored = {level: dict.fromkeys(sites, levels.get(level)) for level in ("black", "white")}
    image = image | {"pixelFormat": stored, "pixelPacking": {"bitsPerPixel": 8, "endianness": "little"}}
    return parse_metadata(profile | {"image": image}, None, f"{path}: levels_8_bit")


def read_mosaic_image(path: Path, camera: str) -> Capture:
    """Read a raw mosaic stored as a JPEG, PNG or TIFF of one channel.

    A JPEG gets its Bayer pattern back as far as the file allows (`restore_mosaic`), with 4 bits more than the file's 8
    to hold it.

    Parameters
    ----------
    path
        The image of one channel (or equal ones): 8 bits, with the levels scaled as the profile tells, or 16 bits
        holding the camera's own digital numbers.
    camera
        Name or path of the camera's profile, as for `read_camera_profile`.

    Raises
    ------
    ContainerError
        If the file is no image, is cut off, has several channels, another size than the camera's sensor, or values
        above its white level.
    AssetError, ConfigError, MetadataError
        If the profile cannot be found or used.
    """
    pixels = _read_pixels(path)
    metadata = read_camera_profile(camera, bits=8 * pixels.dtype.itemsize)
    expected = (metadata.height, metadata.width)
    if pixels.shape != expected:
        raise ContainerError(
            f"{path}: found an image of {pixels.shape[1]} x {pixels.shape[0]} pixels, expected {expected[1]} x "
            f"{expected[0]} of camera {camera}; give the whole mosaic, or the camera it is from"
        )
    largest = int(pixels.max())
    if largest > max(metadata.white):
        raise ContainerError(
            f"{path}: found values up to {largest}, expected at most the white level {max(metadata.white):g} of camera "
            f"{camera}; store the digital numbers as the camera wrote them"
        )
    if pixels.dtype == np.uint16:
        metadata = replace(metadata, bits_per_pixel=16, endianness="little")
    if path.suffix.lower() in (".jpg", ".jpeg"):
        return _restored(path, pixels.astype(np.uint8), metadata)
    return Capture(mosaic=pixels.astype(np.uint16), metadata=metadata, source=str(path))


def _restored(path: Path, pixels: UInt8, metadata: FrameMetadata) -> Capture:
    """Return the capture of a JPEG, its numbers sixteen times as large and its Bayer pattern restored."""
    from PIL import Image

    with Image.open(path) as picture:
        steps = np.reshape(picture.quantization[0], (8, 8))  # type: ignore[attr-defined]
    red, green_r, green_b, blue = (1 / gain for gain in metadata.white_balance)
    greens = (green_r, green_b) if metadata.bayer.index("r") < 2 else (green_b, green_r)
    white = [{"r": red, "b": blue, "g": greens[site // 2]}[colour] for site, colour in enumerate(metadata.bayer)]
    restored = restore_mosaic(pixels, steps, float(np.mean(metadata.black)), (white[0], white[1], white[2], white[3]))
    (b0, b1, b2, b3), (w0, w1, w2, w3) = _FINER * np.array([metadata.black, metadata.white])
    mosaic = np.clip(np.rint(_FINER * restored), 0, max(w0, w1, w2, w3)).astype(np.uint16)
    finer = replace(metadata, black=(b0, b1, b2, b3), white=(w0, w1, w2, w3), bits_per_pixel=16, endianness="little")
    return Capture(mosaic=mosaic, metadata=finer, source=str(path))


def _read_pixels(path: Path) -> UInt8 | UInt16:
    import imageio.v3 as iio

    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise ContainerError(f"{path}: found the suffix '{path.suffix}', expected one of {', '.join(IMAGE_SUFFIXES)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); give a JPEG, PNG or TIFF") from error
    if not is_picture(data, str(path)):
        raise ContainerError(f"{path}: cannot be read as an image (no known head); give a complete JPEG, PNG or TIFF")
    try:
        pixels = np.asarray(iio.imread(data, extension=path.suffix.lower()))
    except Exception as error:  # every decoder has its own kinds
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ContainerError(
            f"{path}: cannot be read as an image ({reason}); give a complete JPEG, PNG or TIFF"
        ) from error
    if pixels.ndim == 3 and (pixels == pixels[..., :1]).all():
        pixels = pixels[..., 0]  # grey stored as equal channels
    if pixels.ndim != 2 or pixels.dtype not in (np.uint8, np.uint16):
        raise ContainerError(
            f"{path}: found an image of {pixels.dtype} with shape {pixels.shape}, expected one channel of 8 or 16 "
            "bits; give the mosaic as the sensor read it out, before demosaicing"
        )
    return pixels
