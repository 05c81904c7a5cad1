"""The recipe: from two captures to a disparity map, one call per stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb
from lfstereo.container import read_capture
from lfstereo.conventions import SLICES_DEFAULT
from lfstereo.depth.disparity import DisparityMap
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.refocus import render_stack, slice_disparities
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.calibration import decode_photograph
from lfstereo.lightfield.field import LightField, in_srgb
from lfstereo.lightfield.samples import ViewSamples, sample_views
from lfstereo.lightfield.store import read_light_field
from lfstereo.network.shipped import DEFAULT_MODEL
from lfstereo.options import option
from lfstereo.progress import Progress, StageClock, silent
from lfstereo.rig.geometry import RectifiedGeometry, Side, rectified_geometry
from lfstereo.rig.rectify import field_of_view, rectify
from lfstereo.rig.rig import StereoRig
from lfstereo.rig.view_maps import common_view_baseline_m

if TYPE_CHECKING:
    from lfstereo.network.estimate import Network

CAPTURE_SUFFIXES = (".lfr", ".lfp", ".raw", ".dng")


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How a pair is turned into depth."""

    slices: int = option(SLICES_DEFAULT, "slices of each focal stack")
    model: str = option(DEFAULT_MODEL, "name of a shipped model, or its folder")
    device: Literal["auto", "cpu", "cuda"] = option("auto", "where the network runs")
    any_zoom: bool = option(False, "accept captures at another zoom or focus than the rig was calibrated at")
    any_camera: bool = option(False, "accept captures of cameras with other serial numbers than the rig's")


@dataclass(frozen=True, slots=True)
class SideResult:
    """What one camera of the pair contributes."""

    stack: FocalStack
    centre_view: Rgb
    """``(V, U, 3)`` rectified centre view, linear RGB."""
    seen: Bool
    """``(V, U)``: inside this camera's own field of view."""
    serial: str
    slope_from_disparity: tuple[float, float]
    """``(a, b)`` of ``slope = a d + b``, px per view."""
    samples: ViewSamples | None
    """Some of the rectified views, of the left camera alone."""


@dataclass(frozen=True, slots=True)
class PairResult:
    """Everything a run computed, before it is written."""

    map: DisparityMap
    left: SideResult
    right: SideResult
    geometry: RectifiedGeometry
    weights_sha256: str
    common: Bool
    """``(V, U)``: where the left view shows what the right one holds too; the map's valid pixels are among these."""


@dataclass(frozen=True, slots=True)
class FocusedPair:
    """Both cameras' focal stacks, ready for the network."""

    left: SideResult
    right: SideResult
    geometry: RectifiedGeometry


Opener: TypeAlias = Callable[[Path, Progress], LightField]
"""Turns a capture into a light field."""


def run_pair(
    left: Path, right: Path, rig: StereoRig, whites: Path | None, options: RunOptions, clock: StageClock
) -> PairResult:
    """Turn two captures, decoded light fields or view folders into disparity.

    Parameters
    ----------
    left, right
        An LFR/LFP/RAW capture, an ``.h5`` light field or a folder of views each.
    rig
        The calibrated rig that took them.
    whites
        Folder of white images, needed for raw captures.

    Raises
    ------
    InputError
        If a file, the rig or the white images cannot be used, or the two do not fit together.
    QualityError
        If a lenslet grid or the rig's geometry cannot be trusted.
    """
    with clock.stage("load network"):
        from lfstereo.network.estimate import load_network

        network = load_network(options.model, options.device)
    check_slices(options, network)

    def opened(path: Path, progress: Progress) -> LightField:
        return open_light_field(path, whites, progress)

    return match_pair(focus_pair(left, right, rig, opened, options, clock), network, clock)


def check_slices(options: RunOptions, network: Network) -> None:
    """Refuse a number of slices that the network cannot use.

    Raises
    ------
    ConfigError
        If there are too few or too many.
    """
    from lfstereo.network.estimate import slice_limits

    fewest, most = slice_limits(network.module)
    if not fewest <= options.slices <= most:
        wanted = f"{fewest}" if fewest == most else f"{fewest} to {most}"
        raise ConfigError(f"slices = {options.slices}, expected {wanted}, what {options.model} was made for")


def focus_pair(
    left: Path, right: Path, rig: StereoRig, opened: Opener, options: RunOptions, clock: StageClock
) -> FocusedPair:
    """Decode both captures, rectify them and render their focal stacks; as in :func:`run_pair`."""
    geometry = rectified_geometry(rig)
    sides: dict[Side, SideResult] = {}
    shape: tuple[int, ...] | None = None
    for side, path in (("left", left), ("right", right)):
        with clock.stage(f"decode {side}") as progress:
            light_field = opened(path, progress)
        if shape is not None and light_field.views.shape != shape:
            raise ShapeError(
                f"{path}: light field of {light_field.views.shape}, but {left} has {shape}; decode both the same way"
            )
        shape = light_field.views.shape
        sides[side] = focus_side(light_field, rig, geometry, side, options, clock)  # type: ignore[index,arg-type]
        del light_field
    return FocusedPair(left=sides["left"], right=sides["right"], geometry=geometry)


def match_pair(focused: FocusedPair, network: Network, clock: StageClock) -> PairResult:
    """Let the network find the disparity of a pair of focal stacks; valid where both see and the network is sure."""
    from lfstereo.network.estimate import estimate_disparity

    left, right = focused.left, focused.right
    with clock.stage("disparity") as progress:
        found = estimate_disparity(left.stack, right.stack, network, progress)
    common = common_field(found.disparity, left.seen, right.seen)
    return PairResult(
        map=replace(found, valid=found.valid & common),
        left=left,
        right=right,
        geometry=focused.geometry,
        weights_sha256=network.card.sha256,
        common=common,
    )


def open_light_field(path: Path, whites: Path | None, progress: Progress = silent) -> LightField:
    """Decode a raw capture, or read a light field that already is decoded.

    Warns
    -----
    QualityWarning
        If a raw capture has no white image that fits, so that its grid is taken from the picture itself.
    """
    if path.is_dir() or path.suffix.lower() not in CAPTURE_SUFFIXES:
        return in_srgb(read_light_field(path))
    capture = read_capture(path)
    return decode_photograph(capture, whites, progress=progress)


def focus_side(
    light_field: LightField,
    rig: StereoRig,
    geometry: RectifiedGeometry,
    side: Side,
    options: RunOptions,
    clock: StageClock,
) -> SideResult:
    """Rectify one light field and render its focal stack at the pair's common disparities."""
    camera = rig.left if side == "left" else rig.right
    t0, s0 = light_field.centre
    seen = field_of_view(light_field, camera, geometry, side)
    step_m = common_view_baseline_m(light_field, rig)
    views_across = max(light_field.views.shape[:2])
    with clock.stage(f"rectify {side}") as progress:
        rectified = rectify(light_field, rig, geometry, side, progress, options.any_zoom, options.any_camera)
    slope_from_disparity = geometry.slope_from_disparity(step_m)
    with clock.stage(f"focal stack {side}") as progress:
        stack = render_stack(
            rectified,
            slice_disparities(geometry.disparity_max_px, 0.0, options.slices),
            slope_from_disparity,
            aperture_ratio=views_across * step_m / rig.baseline_m,
            progress=progress,
        )
        samples = sample_views(rectified) if side == "left" else None
    return SideResult(
        stack=stack,
        centre_view=rectified.views[t0, s0].copy(),
        seen=seen,
        serial=light_field.serial,
        slope_from_disparity=slope_from_disparity,
        samples=samples,
    )


def common_field(disparity: Float32, seen_left: Bool, seen_right: Bool) -> Bool:
    """Return where the left view shows what the right camera's field of view holds too, ``(V, U)``."""
    rows, columns = disparity.shape
    x_right = np.rint(np.arange(columns) - disparity).astype(np.intp)
    inside = (x_right >= 0) & (x_right < columns)
    hit: Bool = seen_right[np.arange(rows)[:, None], np.clip(x_right, 0, columns - 1)]
    both: Bool = seen_left & inside & hit
    return both
