"""``lfstereo refocus``: pictures focused at planes of choice, from one light field or from both of a pair."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments, option, toml_value
from lfstereo.outputs import atomic_folder, check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.arrays import Float32, Float64
    from lfstereo.focus.aperture import RefocusOptions
    from lfstereo.focus.planes import FocusPlanesOptions
    from lfstereo.focus.scale import FocusScale
    from lfstereo.lightfield.field import LightField
    from lfstereo.rig.geometry import Side

_PICTURE_SUFFIXES = (".png",)
_SIDES: tuple[Side, Side] = ("left", "right")


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """What is made of the refocused slices."""

    method: Literal["direct", "lftoolbox"] = option(
        "direct",
        "direct: as described here; lftoolbox: the numbers and the slopes of the Light Field Toolbox for MATLAB",
    )
    upsample: int = option(1, "px of the pictures per px of a view: detail from views that differ by parts of a px")
    all_in_focus: bool = option(False, "also fuse the slices into one picture that is sharp everywhere")
    device: Literal["cpu", "cuda"] = option("cpu", "where the views are summed; cuda: on a graphics card")
    any_zoom: bool = option(False, "accept light fields at another zoom or focus than the rig was calibrated at")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.focus.aperture import RefocusOptions
    from lfstereo.focus.planes import FocusPlanesOptions

    parser.add_argument(
        "inputs", nargs="+", type=Path, metavar="INPUT", help="a light field or capture; or, with --rig, LEFT RIGHT"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of slices, or for one plane a picture (.png)"
    )
    parser.add_argument("--rig", type=Path, help="rig file: rectifies, and tells disparities and metres from slopes")
    parser.add_argument("--side", choices=_SIDES, default="left", help="camera of the rig, for one input")
    parser.add_argument("--whites", type=Path, help="folder with the camera's white images, for raw captures")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    parser.add_argument("--json", action="store_true", help="print the planes of focus as JSON on stdout")
    for title, options in (
        ("planes of focus", FocusPlanesOptions),
        ("aperture and views", RefocusOptions),
        ("pictures", PictureOptions),
    ):
        add_arguments(parser.add_argument_group(title), options)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.focus.aperture import RefocusOptions
    from lfstereo.focus.planes import FocusPlanesOptions, choose_slopes

    check_absent(arguments.output, arguments.force)
    planes, views = from_arguments(FocusPlanesOptions, arguments), from_arguments(RefocusOptions, arguments)
    pictures = from_arguments(PictureOptions, arguments)
    planes = _checked(arguments, planes, pictures)
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    fields, scale = _open(arguments, pictures, clock)
    with clock.stage("planes of focus") as progress:
        slopes = choose_slopes(fields, planes, scale, progress)
    table = _table(slopes, scale)
    if arguments.output.suffix.lower() in _PICTURE_SUFFIXES:
        from lfstereo.depth.pictures import write_png
        from lfstereo.lightfield.encoding import srgb16

        (stack,) = _render(fields, slopes, views, pictures, clock)
        write_png(arguments.output, srgb16(_single(stack, pictures)), arguments.force)
    else:
        stacks = _render(fields, slopes, views, pictures, clock)
        with clock.stage("write"), atomic_folder(arguments.output, arguments.force) as folder:
            names = _SIDES if len(fields) == 2 else ("",)
            for name, stack in zip(names, stacks, strict=True):
                _write_slices(folder / name, stack, table, pictures)
            settings = {"planes": asdict(planes), "views": asdict(views), "pictures": asdict(pictures)}
            (folder / "refocus.toml").write_text(_toml(table, settings, fields), "utf-8")
    print(json.dumps(table, indent=2) if arguments.json else _text(table, arguments.output))
    return 0


def _checked(arguments: argparse.Namespace, planes: FocusPlanesOptions, pictures: PictureOptions) -> FocusPlanesOptions:
    from dataclasses import replace

    suffix, count = arguments.output.suffix.lower(), len(arguments.inputs)
    if count > 2 or (count == 2 and arguments.rig is None):
        raise ConfigError(f"found {count} inputs, expected one, or the left and the right one of a pair with --rig")
    if suffix and suffix not in _PICTURE_SUFFIXES:
        raise ConfigError(f"{arguments.output}: found the suffix '{suffix}', expected .png or none for a folder")
    if suffix and (count == 2 or not (len(planes.at) == 1 or pictures.all_in_focus)):
        raise ConfigError(
            f"{arguments.output}: one picture holds one plane of one light field; give --at with one number or "
            "--all-in-focus, or an output without a suffix for a folder"
        )
    if pictures.method == "lftoolbox":
        return replace(planes, slope_rule="lftoolbox")
    return planes


def _open(
    arguments: argparse.Namespace, pictures: PictureOptions, clock: StageClock
) -> tuple[list[LightField], FocusScale | None]:
    """Read the light fields; with a rig, rectify them and return the scale of their slopes."""
    from lfstereo.pipeline import open_light_field

    sides = _SIDES if len(arguments.inputs) == 2 else (arguments.side,)
    fields, scale = [], None
    for side, path in zip(sides, arguments.inputs, strict=True):
        with clock.stage(f"read {path.name}") as progress:
            field = open_light_field(path, arguments.whites, progress)
        if arguments.rig is not None:
            from lfstereo.focus.scale import focus_scale
            from lfstereo.rig.geometry import rectified_geometry
            from lfstereo.rig.rectify import rectify
            from lfstereo.rig.rig import read_rig
            from lfstereo.rig.view_maps import common_view_baseline_m

            rig = read_rig(arguments.rig)
            geometry = rectified_geometry(rig)
            scale = focus_scale(geometry, common_view_baseline_m(field, rig))
            with clock.stage(f"rectify {side}") as progress:
                field = rectify(field, rig, geometry, side, progress, pictures.any_zoom)
        fields.append(field)
    return fields, scale


def _render(
    fields: list[LightField], slopes: Float64, views: RefocusOptions, pictures: PictureOptions, clock: StageClock
) -> list[Float32]:
    import numpy as np

    from lfstereo.focus.lftoolbox import refocus_as_lftoolbox
    from lfstereo.focus.refocus import refocus
    from lfstereo.focus.superresolve import superresolve

    stacks = []
    for field in fields:
        with clock.stage("refocus") as progress:
            if pictures.method == "lftoolbox":
                options = _shift_sum_options(views, pictures)
                weight = None if field.weight is None else field.weight.astype(np.float32) / np.float32(255)
                count = field.views.shape[1]
                theirs = -slopes * (count - 1) / count
                shown = [refocus_as_lftoolbox(field.views, weight, float(s), options).picture for s in theirs]
                stacks.append(np.stack(shown))
            elif pictures.upsample != 1:
                stacks.append(np.stack([superresolve(field, float(s), pictures.upsample, views) for s in slopes]))
            elif pictures.device != "cpu":
                from lfstereo.network.refocus_device import refocus_on_device

                stacks.append(refocus_on_device(field, slopes, views, pictures.device))
            else:
                stacks.append(refocus(field, slopes, views, progress))
    return stacks


def _shift_sum_options(views: RefocusOptions, pictures: PictureOptions) -> Any:
    from lfstereo.focus.lftoolbox import ShiftSumOptions

    names: dict[str, Literal["sum", "median", "max", "min"]] = {
        "mean": "sum",
        "median": "median",
        "max": "max",
        "min": "min",
    }
    if views.interpolation == "fourier" or views.reduction not in names or any(views.tilt):
        raise ConfigError(
            f"method lftoolbox: found interpolation '{views.interpolation}', reduction '{views.reduction}', tilt "
            f"{views.tilt}, expected linear or cubic, {', '.join(names)}, no tilt; or give --method direct"
        )
    least = views.least_weight
    return ShiftSumOptions(names[views.reduction], views.interpolation, pictures.upsample, least > 0, least)


def _single(stack: Float32, pictures: PictureOptions) -> Float32:
    from lfstereo.focus.fusion import fuse_slices

    return fuse_slices(stack) if pictures.all_in_focus else stack[0]


def _write_slices(folder: Path, stack: Float32, table: dict[str, list[float]], pictures: PictureOptions) -> None:
    from lfstereo.depth.pictures import write_png
    from lfstereo.focus.fusion import fuse_slices
    from lfstereo.lightfield.encoding import srgb16

    folder.mkdir(exist_ok=True)
    for k, picture in enumerate(stack):
        at = f"d{table['disparity_px'][k]:06.2f}px" if "disparity_px" in table else f"s{table['slope'][k]:+07.3f}"
        write_png(folder / f"slice_{k:02d}_{at}.png", srgb16(picture))
    if pictures.all_in_focus:
        write_png(folder / "all_in_focus.png", srgb16(fuse_slices(stack)))


def _table(slopes: Float64, scale: FocusScale | None) -> dict[str, list[float]]:
    table = {"slope": [round(float(s), 6) for s in slopes]}
    if scale is not None:
        table["disparity_px"] = [round(float(d), 4) for d in scale.disparities(slopes)]
        table["depth_m"] = [round(float(z), 6) for z in scale.depths(slopes)]
    return table


def _toml(table: dict[str, list[float]], settings: dict[str, dict[str, Any]], fields: list[LightField]) -> str:
    from lfstereo import __version__

    text = f"lfstereo = {toml_value(__version__)}\ninputs = {toml_value([f.source for f in fields])}\n"
    for name, values in {"slices": table, **settings}.items():
        rows = (f"{key} = {toml_value(value)}\n" for key, value in values.items() if value is not None)
        text += f"\n[{name}]\n" + "".join(rows)
    return text


def _text(table: dict[str, list[float]], output: Path) -> str:
    lines = [f"{'slice':>5}{'slope':>10}" + ("  disparity px    depth m" if "depth_m" in table else "")]
    for k, slope in enumerate(table["slope"]):
        line = f"{k:>5}{slope:>10.4f}"
        if "depth_m" in table:
            line += f"{table['disparity_px'][k]:>14.2f}{table['depth_m'][k]:>11.4f}"
        lines.append(line)
    return "\n".join([*lines, f"written: {output}"])
