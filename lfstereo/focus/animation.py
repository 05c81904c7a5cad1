"""Moving pictures of a light field: focus that wanders through the scene, or an eye that circles before it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from lfstereo.arrays import Rgb, UInt8
from lfstereo.errors import ConfigError, MissingExtraError
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.perspective import perspective_view
from lfstereo.options import option
from lfstereo.outputs import atomic_file
from lfstereo.progress import Progress, silent

SUFFIXES = (".gif", ".mp4")


@dataclass(frozen=True, slots=True)
class AnimationOptions:
    """What moves, how far and how fast."""

    kind: Literal["sweep", "orbit"] = option("sweep", "sweep: focus from near to far and back; orbit: parallax")
    frames: int = option(30, "pictures of one round")
    fps: float = option(15.0, "pictures per second")
    radius_views: float | None = option(
        None, "radius of the circle of an orbit; unset: as far as all views reach", "views"
    )
    width_px: int = option(0, "width of the pictures; 0: that of a view", "px")


def sweep_frames(
    light_field: LightField,
    near: float,
    far: float,
    options: AnimationOptions = AnimationOptions(),
    aperture: RefocusOptions = RefocusOptions(),
    progress: Progress = silent,
) -> Iterator[UInt8]:
    """Give the pictures of a focal sweep from near to far and back, ``(v, u, 3)`` sRGB each.

    The slopes follow a cosine, so that the sweep rests at both ends and closes without a jump.

    Raises
    ------
    ConfigError
        If an option is not possible.
    ShapeError, InputError
        As :func:`lfstereo.focus.refocus.refocus`.
    """
    _check(options)
    turn = np.cos(2 * np.pi * np.arange(options.frames) / options.frames)
    slopes = (near + far) / 2 + (near - far) / 2 * turn
    there = options.frames // 2 + 1
    slices = refocus(light_field, slopes[:there], aperture, progress)
    for k in range(options.frames):
        yield _frame(slices[min(k, options.frames - k)], options)


def orbit_frames(
    light_field: LightField,
    slope: float,
    options: AnimationOptions = AnimationOptions(kind="orbit"),
    progress: Progress = silent,
) -> Iterator[UInt8]:
    """Give the pictures of an eye that circles in the aperture, ``(v, u, 3)`` sRGB each.

    Parameters
    ----------
    light_field
        The views.
    slope
        px per view; what lies there stands still.
    options
        Radius and number of pictures.
    progress
        Told the pictures done.

    Raises
    ------
    ConfigError
        If an option is not possible.
    """
    _check(options)
    t0, s0 = light_field.centre
    rows, columns = light_field.views.shape[:2]
    x_reach, y_reach = min(s0, columns - 1 - s0), min(t0, rows - 1 - t0)
    if options.radius_views is not None:
        x_reach, y_reach = (min(reach, options.radius_views) for reach in (x_reach, y_reach))
    for k, angle in enumerate(2 * np.pi * np.arange(options.frames) / options.frames):
        x, y = float(x_reach * np.cos(angle)), float(y_reach * np.sin(angle))
        view = perspective_view(light_field, (x, y), slope)
        steady = np.array([[1, 0, slope * x], [0, 1, slope * y]])
        size = (view.shape[1], view.shape[0])
        yield _frame(cv2.warpAffine(view, steady, size, borderMode=cv2.BORDER_REPLICATE), options)
        progress(k + 1, options.frames)


def write_animation(path: Path, frames: Iterator[UInt8], fps: float, force: bool = False) -> int:
    """Write pictures as an endless GIF or as an MP4 (H.264) and return how many there were.

    Raises
    ------
    ConfigError
        If the suffix is neither ``.gif`` nor ``.mp4``.
    MissingExtraError
        If an MP4 is asked for without imageio-ffmpeg.
    OutputError
        If the file exists and ``force`` is not set, or it cannot be written.
    """
    import imageio.v2 as imageio

    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ConfigError(f"{path}: found the suffix '{path.suffix}', expected .gif or .mp4; rename the output")
    settings: dict[str, Any] = {"duration": 1000.0 / fps, "loop": 0}
    if suffix == ".mp4":
        _find_ffmpeg()
        settings = {"fps": fps, "codec": "libx264", "quality": 8, "macro_block_size": 2, "ffmpeg_log_level": "error"}
    count = 0
    with atomic_file(path, force) as scratch:
        named = scratch.with_suffix(suffix)
        try:
            writer: Any = imageio.get_writer(named, format="FFMPEG" if suffix == ".mp4" else "GIF", **settings)
            with writer:
                for frame in frames:
                    writer.append_data(frame if suffix == ".gif" else _even(frame))
                    count += 1
            named.replace(scratch)
        finally:
            named.unlink(missing_ok=True)
    return count


def _find_ffmpeg() -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingExtraError(
            "MP4: found no imageio-ffmpeg, expected it installed; run 'pip install imageio-ffmpeg', or write a .gif"
        ) from error
    del imageio_ffmpeg


def _even(frame: UInt8) -> UInt8:
    """Leave out a last odd row or column, which the video's colour halves cannot hold."""
    return frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2]


def _frame(picture: Rgb, options: AnimationOptions) -> UInt8:
    if options.width_px > 0:
        size = options.width_px, max(1, round(picture.shape[0] * options.width_px / picture.shape[1]))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)
    return srgb8(picture)


def _check(options: AnimationOptions) -> None:
    if options.frames < 2:
        raise ConfigError(f"frames = {options.frames}: expected 2 or more")
    if not 0 < options.fps <= 240:
        raise ConfigError(f"fps = {options.fps}: expected more than 0 and up to 240 pictures per second")
    if options.width_px < 0:
        raise ConfigError(f"width_px = {options.width_px}: expected 0 px or more")
    if options.radius_views is not None and not 0 <= options.radius_views < np.inf:
        raise ConfigError(f"radius_views = {options.radius_views}: expected 0 views or more")
