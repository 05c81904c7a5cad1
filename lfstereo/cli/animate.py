"""``lfstereo animate``: a focal sweep or a parallax orbit as GIF or MP4."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments, option
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock


@dataclass(frozen=True, slots=True)
class _Limits:
    """Between which slopes the focus wanders."""

    near: float | None = option(None, "nearest slope of a sweep; unset: where the scene begins", "px per view")
    far: float | None = option(None, "farthest slope; unset: where the scene ends", "px per view")
    slope: float | None = option(None, "slope that stands still in an orbit; unset: the middle", "px per view")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.focus.animation import AnimationOptions

    parser.add_argument("input", type=Path, help="light field (.h5, .mat, ESLF .png, folder of views)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="animation to write (.gif or .mp4)")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    add_arguments(parser, AnimationOptions)
    add_arguments(parser, _Limits)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.focus.animation import SUFFIXES, AnimationOptions, orbit_frames, sweep_frames, write_animation
    from lfstereo.focus.slope_map import find_focus_range
    from lfstereo.lightfield.store import read_light_field

    target = arguments.output
    check_absent(target, arguments.force)
    if target.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{target}: found the suffix '{target.suffix}', expected .gif or .mp4; rename the output")
    options, limits = from_arguments(AnimationOptions, arguments), from_arguments(_Limits, arguments)
    clock = StageClock(bars=sys.stderr.isatty())
    with clock.stage("read"):
        light_field = read_light_field(arguments.input)
    near, far = limits.near, limits.far
    if (near is None or far is None) and (options.kind == "sweep" or limits.slope is None):
        with clock.stage("limits") as progress:
            found = find_focus_range(light_field, progress=progress)
        near, far = found.near if near is None else near, found.far if far is None else far
    with clock.stage("animate") as progress:
        if options.kind == "sweep":
            assert near is not None and far is not None
            frames = sweep_frames(light_field, near, far, options, progress=progress)
        else:
            still = limits.slope if limits.slope is not None else ((near or 0.0) + (far or 0.0)) / 2
            frames = orbit_frames(light_field, still, options, progress)
        count = write_animation(target, frames, options.fps, arguments.force)
    print(f"written: {target}, {count} pictures")
    return 0
