"""The recipe for cameras that are no light-field cameras: focus sweeps to depth, one call per stage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from lfstereo.arrays import Bool, Disparity, Float32, Rgb
from lfstereo.depth.baselines import sgbm, sgbm_wls
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.feature_disparity import search_range
from lfstereo.depth.triangulate import DepthMap, triangulate
from lfstereo.errors import ConfigError, QualityError, ShapeError
from lfstereo.focus.alignment import AlignedSweep, AlignOptions, align_sweep
from lfstereo.focus.even_slices import even_stack
from lfstereo.focus.importers import ImportOptions, read_sweep
from lfstereo.focus.measures import FocusIndex, FocusOptions, find_focus
from lfstereo.focus.stack import FocalStack
from lfstereo.focus.sweep import depth_at, vergence
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.network.shipped import DEFAULT_MODEL
from lfstereo.options import option
from lfstereo.pipeline import common_field
from lfstereo.progress import StageClock
from lfstereo.rig.geometry import RectifiedGeometry, Side, rectified_geometry
from lfstereo.rig.interchange import PlenopticPart, import_rig
from lfstereo.rig.rectify import rectify
from lfstereo.rig.rig import StereoRig

LEAST_SURE_SHARE = 0.05
"""Of the pixels, that must change in sharpness over a sweep; a blank one leaves 0.1 percent."""
_STAND_IN = (1.0, 1.0)
"""Focus distance and pupil of a rig whose cameras have one view each: they change nothing."""


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """What to make of one sweep or two."""

    metric: bool = option(False, "refuse sweeps that do not tell their distances, instead of giving slices alone")
    focal_px: float | None = option(None, "focal length in px of the pictures as they are; unset: from EXIF", "px")
    match: Literal["stereo", "network", "pictures"] = option(
        "stereo",
        "two sweeps: SGBM + WLS on the all-in-focus pictures, a network on the slices, or the network on the "
        "all-in-focus pictures, which may also be one ordinary picture each",
    )
    judge: Literal["method", "network"] = option(
        "method", "one sweep: the published --method, or a network of the binocular family"
    )
    baseline_m: float | None = option(None, "distance of the two cameras, where no rig tells", "m")
    doffs_px: float = option(0.0, "difference of their principal points, right minus left, where no rig tells", "px")
    near_m: float | None = option(None, "near end of the scene, for a rig in an OpenCV file", "m")
    far_m: float | None = option(None, "far end of the scene, for a rig in an OpenCV file", "m")
    model: str = option(DEFAULT_MODEL, "network: name of a shipped model, or its folder")
    device: Literal["auto", "cpu", "cuda"] = option("auto", "where the network runs")


@dataclass(frozen=True, slots=True)
class StackOptions:
    """Everything that decides a result."""

    read: ImportOptions = ImportOptions()
    align: AlignOptions = AlignOptions()
    focus: FocusOptions = FocusOptions()
    sweep: SweepOptions = SweepOptions()


@dataclass(frozen=True, slots=True)
class SweepResult:
    """What one sweep tells."""

    aligned: AlignedSweep
    focus: FocusIndex
    valid: Bool
    """``(V, U)``: sure, and inside every picture."""
    depth: DepthMap | None
    """Where the focus distances are known; as the camera's own scale counts them."""
    focal_px: float | None
    """Of the slices."""


@dataclass(frozen=True, slots=True)
class ViewGeometry:
    """Two parallel cameras."""

    focal_px: float
    baseline_m: float
    doffs_px: float
    principal_px: tuple[float, float]
    """(cx, cy) of the left one, px."""


@dataclass(frozen=True, slots=True)
class SweepPairResult:
    """What two sweeps tell together."""

    left: AlignedSweep
    right: AlignedSweep
    map: DisparityMap
    search_px: tuple[float, float]
    """Smallest and largest disparity that was looked for."""
    geometry: ViewGeometry | None
    depth: DepthMap | None
    """Where the geometry is known."""
    weights_sha256: str
    """Of the network; empty where none was used."""


def run_sweep(folder: Path, options: StackOptions, clock: StageClock) -> SweepResult:
    """Turn one focus sweep into the slice in focus of every pixel, and its distance where the sweep tells.

    Raises
    ------
    InputError
        If the pictures, the table of distances or an option cannot be used.
    QualityError
        If the pictures cannot be aligned, or hardly differ in sharpness.
    """
    aligned = _aligned(folder, options, clock, "")
    sweep = aligned.sweep
    if len(sweep.slices) < 3:
        raise ShapeError(f"{folder}: found {len(sweep.slices)} pictures, expected 3 or more to find the sharpest of")
    if options.sweep.metric:
        vergence(sweep)
    with clock.stage("depth from focus"):
        if options.sweep.judge == "network":
            found = _focus_by_network(sweep.slices, options.sweep, str(folder))
        else:
            found = find_focus(sweep.slices, options.focus)
    valid = found.valid & aligned.seen
    if valid.mean() < LEAST_SURE_SHARE:
        raise QualityError(
            f"{folder}: {valid.mean():.1%} of the pixels change in sharpness from picture to picture, expected "
            f"{LEAST_SURE_SHARE:.0%} or more; give pictures of shallow depth of field, each focused elsewhere"
        )
    depth = None
    if sweep.distances_m is not None:
        metres = depth_at(found.slice_index, sweep)
        depth = DepthMap(np.where(valid, metres, 0).astype(np.float32), valid & (metres > 0))
    given = options.sweep.focal_px
    focal_px = given / sweep.reduction if given else sweep.lens.focal_px
    return SweepResult(aligned, found, valid, depth, focal_px)


def run_sweep_pair(
    left: Path,
    right: Path,
    right_distances: Path | None,
    rig: StereoRig | None,
    options: StackOptions,
    clock: StageClock,
) -> SweepPairResult:
    """Turn two focus sweeps of cameras side by side into disparity, and into depth where the geometry is known.

    Without a rig the pictures must be rectified already; features show whether they are. With one, slices are
    rectified after they were aligned to the sweep's middle picture, which is the one that the rig speaks of.

    Raises
    ------
    InputError
        If the pictures, the tables or an option cannot be used, or the two do not fit together.
    QualityError
        If pictures cannot be aligned, or the two do not see rectified views of one scene.
    """
    own = replace(options.read, distances=right_distances or options.read.distances)
    sides = {
        "left": _aligned(left, options, clock, " left"),
        "right": _aligned(right, replace(options, read=own), clock, " right"),
    }
    shapes = [side.sweep.slices.shape[1:3] for side in sides.values()]
    if shapes[0] != shapes[1]:
        raise ShapeError(f"{right}: pictures of {shapes[1]} px, but {left} has {shapes[0]} (rows, columns)")
    geometry = _given_geometry(sides["left"], options.sweep)
    seen = {side: aligned.seen for side, aligned in sides.items()}
    slices = {side: aligned.sweep.slices for side, aligned in sides.items()}
    span: tuple[float, float] | None = None
    if rig is not None:
        with clock.stage("rectify"):
            plain = rectified_geometry(replace(rig, pixel_px=max(rig.pixel_px, sides["left"].sweep.reduction)))
            slices["left"], seen["left"] = _rectified(sides["left"], rig, plain, "left")
            slices["right"], seen["right"] = _rectified(sides["right"], rig, plain, "right")
        geometry = ViewGeometry(plain.focal_px, plain.baseline_m, plain.doffs_px, plain.left.principal_px)
        span = 0.0, plain.disparity_max_px
    with clock.stage("all in focus"):
        sharp = {
            side: pictures[0] if len(pictures) == 1 else find_focus(pictures, options.focus).all_in_focus
            for side, pictures in slices.items()
        }
    span = span or search_range(sharp["left"], sharp["right"], f"{left}, {right}")
    sha256 = ""
    with clock.stage("disparity"):
        if options.sweep.match == "network":
            found, sha256 = _by_network(sides, slices, geometry, options.sweep)
        elif options.sweep.match == "pictures":
            found, sha256 = _by_pictures(sharp["left"], sharp["right"], span, options.sweep)
        else:
            found = _by_matching(sharp["left"], sharp["right"], span)
    valid = found.valid & common_field(found.disparity, seen["left"], seen["right"])
    found = replace(found, valid=valid)
    depth = None
    if geometry is not None:
        depth = triangulate(found.disparity, valid, geometry.focal_px, geometry.baseline_m, geometry.doffs_px)
    elif options.sweep.metric:
        raise ConfigError(f"{left}: found no geometry, expected --rig, or --baseline-m and a focal length, for metres")
    return SweepPairResult(sides["left"], sides["right"], found, span, geometry, depth, sha256)


def read_pair_rig(path: Path, options: SweepOptions) -> StereoRig:
    """Read the geometry of two ordinary cameras: OpenCV's stereo calibration, or a rig file with one view per camera.

    Raises
    ------
    ConfigError
        If the file cannot be used, or an OpenCV file comes without near and far end of the scene.
    """
    if path.suffix.lower() == ".toml":
        return import_rig(path)
    if options.near_m is None or options.far_m is None:
        raise ConfigError(f"{path}: an OpenCV file does not tell the scene's depth; give --near-m and --far-m")
    part = PlenopticPart(_STAND_IN, _STAND_IN, options.near_m, options.far_m, pixel_px=1.0)
    return import_rig(path, part)


def _aligned(folder: Path, options: StackOptions, clock: StageClock, label: str) -> AlignedSweep:
    with clock.stage(f"read{label}") as progress:
        sweep = read_sweep(folder, options.read, progress, fewest=1 if options.sweep.match == "pictures" else 2)
    with clock.stage(f"align{label}") as progress:
        return align_sweep(sweep, options.align, progress)


def _given_geometry(left: AlignedSweep, options: SweepOptions) -> ViewGeometry | None:
    sweep = left.sweep
    focal = options.focal_px / sweep.reduction if options.focal_px else sweep.lens.focal_px
    if focal is None or options.baseline_m is None:
        return None
    rows, columns = sweep.slices.shape[1:3]
    middle = (columns - 1) / 2, (rows - 1) / 2
    return ViewGeometry(focal, options.baseline_m, options.doffs_px / sweep.reduction, middle)


def _rectified(aligned: AlignedSweep, rig: StereoRig, geometry: RectifiedGeometry, side: Side) -> tuple[Float32, Bool]:
    """Return ``(K, V, U, 3)`` rectified slices, and where all of them were seen."""
    sweep = aligned.sweep
    px, weight = sweep.reduction, aligned.seen.astype(np.uint8)[None, None] * np.uint8(255)
    sampling = ViewSampling(origin_px=((px - 1) / 2,) * 2, step_px=(px, px), rotation_rad=0.0, view_step_px=1.0)
    slices = np.empty((len(sweep.slices), *geometry.size, 3), np.float32)
    seen = np.zeros(geometry.size, np.bool_)
    for k, slice_ in enumerate(sweep.slices):
        view = LightField(slice_[None, None], weight, sampling, "", sweep.source)
        rectified = rectify(view, rig, geometry, side)
        slices[k] = rectified.views[0, 0]
        if rectified.weight is not None:
            seen = rectified.weight[0, 0] == 255
    return slices, seen


def _by_matching(left: Rgb, right: Rgb, span: tuple[float, float]) -> DisparityMap:
    """Match the sharp pictures; smooth everywhere, valid where plain matching agrees from both sides."""
    sure = sgbm(left, right, span[1], span[0]).valid
    smooth = sgbm_wls(left, right, span[1], span[0])
    disparity: Disparity = np.clip(smooth.disparity, 0, None)
    return DisparityMap(disparity, sure & smooth.valid, left)


def _by_pictures(left: Rgb, right: Rgb, span: tuple[float, float], options: SweepOptions) -> tuple[DisparityMap, str]:
    from lfstereo.network.estimate import estimate_from_pictures, load_network

    network = load_network(options.model, options.device)
    return estimate_from_pictures(left, right, span[1], network), network.card.sha256


def _focus_by_network(slices: Float32, options: SweepOptions, source: str) -> FocusIndex:
    """Let a network judge one sweep; its confidence is 1 where it expects no error, and falls by e with every slice."""
    from lfstereo.network.estimate import estimate_from_one_stack, load_network

    stack = FocalStack(slices, -np.arange(len(slices), dtype=np.float32), 0.0, source)
    found = estimate_from_one_stack(stack, load_network(options.model, options.device))
    assert found.uncertainty_px is not None
    index: Float32 = np.clip(-found.disparity, 0, len(slices) - 1)
    return FocusIndex(index, np.exp(-found.uncertainty_px), found.valid, found.all_in_focus)


def _by_network(
    sides: dict[str, AlignedSweep],
    slices: dict[str, Float32],
    geometry: ViewGeometry | None,
    options: SweepOptions,
) -> tuple[DisparityMap, str]:
    if geometry is None:
        raise ConfigError("network: found no geometry, expected --rig, or --baseline-m and a focal length")
    from lfstereo.network.estimate import estimate_disparity, load_network, slice_limits

    network = load_network(options.model, options.device)
    stacks = []
    for side, aligned in sides.items():
        sweep = aligned.sweep
        focused = geometry.focal_px * geometry.baseline_m * vergence(sweep) - geometry.doffs_px
        ratio = (sweep.lens.aperture_m or 0.0) / geometry.baseline_m
        fewest, most = slice_limits(network.module)
        if fewest == most:
            stacks.append(even_stack(slices[side], focused, ratio, sweep.source, most))
        else:
            stacks.append(FocalStack(slices[side], focused.astype(np.float32), ratio, sweep.source))
    return estimate_disparity(stacks[0], stacks[1], network), network.card.sha256
