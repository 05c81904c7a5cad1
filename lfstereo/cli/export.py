"""``lfstereo export``: light fields and raw captures in the formats of other programs."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lfstereo.errors import ConfigError
from lfstereo.lightfield.options import PictureOptions
from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.lightfield.field import LightField
    from lfstereo.lightfield.interchange.picture_folders import HciLengths

_FORMATS = ("h5", "mat", "eslf", "hci", "png", "tiff", "dng")
_CAPTURE_SUFFIXES = (".lfr", ".lfp", ".raw", ".dng")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "input", type=Path, help="light field (.h5, .mat, ESLF .png, folder of views), or for DNG a raw capture"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="file or folder to write")
    parser.add_argument(
        "--format",
        choices=_FORMATS,
        help="h5: lfstereo's own; mat: Light Field Toolbox (MATLAB 7.3); eslf: one lenslet-packed 16-bit PNG; hci: "
        "folder of the HCI benchmark; png, tiff: folder of 8-bit or 16-bit views; dng: the raw mosaic "
        "(default: by the output's suffix, a folder of PNG where it has none)",
    )
    parser.add_argument("--rig", type=Path, help="rig file: lets depth be told from the disparities of an HCI folder")
    parser.add_argument("--side", choices=("left", "right"), default="left", help="camera of the rig (default: left)")
    parser.add_argument("--keep-serials", action="store_true", help="write camera serial numbers, not only their marks")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    add_arguments(parser, PictureOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    source, target = arguments.input, arguments.output
    check_absent(target, arguments.force)
    to_dng = arguments.format == "dng" or (arguments.format is None and target.suffix.lower() == ".dng")
    from_capture = source.suffix.lower() in _CAPTURE_SUFFIXES and not source.is_dir()
    if to_dng != from_capture:
        wanted = "a raw capture (.LFR, .LFP, .RAW)" if to_dng else "a light field; decode it first ('lfstereo decode')"
        raise ConfigError(f"{source}: found the suffix '{source.suffix}', expected {wanted}, for {target}")
    clock = StageClock(bars=sys.stderr.isatty())
    pictures = from_arguments(PictureOptions, arguments)
    if to_dng:
        if pictures != PictureOptions():
            raise ConfigError(f"{target}: found options of pictures ({pictures}), expected none for a raw mosaic")
        _export_capture(arguments, clock)
    else:
        _export_views(arguments, pictures, clock)
    print(f"written: {target}")
    return 0


def _export_capture(arguments: argparse.Namespace, clock: StageClock) -> None:
    from lfstereo.container.capture import DNG_SUFFIX, read_capture
    from lfstereo.container.dng import write_dng
    from lfstereo.container.serials import camera_mark

    target = arguments.output
    if target.suffix.lower() != DNG_SUFFIX:
        raise ConfigError(
            f"{target}: found the suffix '{target.suffix}', expected {DNG_SUFFIX} for format dng; rename it"
        )
    with clock.stage("read"):
        capture = read_capture(arguments.input)
        if not arguments.keep_serials:
            marked = replace(capture.metadata, serial=camera_mark(capture.metadata.serial))
            capture = replace(capture, metadata=marked)
    with clock.stage("write"):
        write_dng(target, capture, arguments.force)


def _export_views(arguments: argparse.Namespace, pictures: PictureOptions, clock: StageClock) -> None:
    from lfstereo.container.serials import camera_mark
    from lfstereo.lightfield.interchange.formats import check_pictures, choose_format, export_light_field
    from lfstereo.lightfield.interchange.picture_folders import write_hci_folder
    from lfstereo.lightfield.store import read_light_field

    name = choose_format(arguments.output, arguments.format)
    check_pictures(name, pictures)
    if arguments.rig is not None and name != "hci":
        raise ConfigError(f"--rig: found the format {name}, expected hci; leave --rig out")
    with clock.stage("read"):
        light_field = read_light_field(arguments.input)
        if not arguments.keep_serials:
            light_field = replace(light_field, serial=camera_mark(light_field.serial))
        lengths = _lengths(arguments.rig, arguments.side, light_field) if arguments.rig is not None else None
    with clock.stage("write") as progress:
        if lengths is not None:
            write_hci_folder(arguments.output, light_field, arguments.force, progress, pictures, lengths)
            return
        export_light_field(arguments.output, light_field, name, arguments.force, progress, pictures)


def _lengths(path: Path, side: str, light_field: LightField) -> HciLengths:
    """Return the lengths with which the benchmark's formula gives a camera's depths.

    The benchmark has ``1/Z = 1/Zf + d * sensor / (baseline * focal * width)``; here it is
    ``1/Z = 1/Zf + sigma / (fx / step * baseline)``.
    """
    from lfstereo.container.serials import camera_mark, same_camera
    from lfstereo.lightfield.interchange.picture_folders import SENSOR_SIZE_MM, HciLengths
    from lfstereo.rig.rig import read_rig

    rig = read_rig(path)
    camera = rig.left if side == "left" else rig.right
    sampling = light_field.sampling
    if sampling is None:
        raise ConfigError(
            f"{light_field.source}: found views without a place on the sensor, expected a light field that was decoded "
            "from a raw capture, for --rig; leave --rig out"
        )
    if not same_camera(camera.serial, light_field.serial):
        raise ConfigError(
            f"{light_field.source}: found camera {camera_mark(light_field.serial)}, expected "
            f"{camera_mark(camera.serial)}, the {side} one of {path}; give the other --side or the rig of this camera"
        )
    focal_px = camera.focal_px[0] / sampling.step_px[0]
    return HciLengths(
        focal_length_mm=SENSOR_SIZE_MM * focal_px / max(light_field.views.shape[2:4]),
        baseline_mm=1000 * camera.pupil_m_per_px * sampling.view_step_px,
        focus_distance_m=camera.focus_distance_m,
    )
