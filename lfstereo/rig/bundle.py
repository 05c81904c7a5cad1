"""Calibrate a rig: both cameras, the transform between them and all poses of the target at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.options import option
from lfstereo.progress import Progress, silent
from lfstereo.rig.adjust import Adjustment, BundleState, LensModel, Seen, adjust, points_in_camera
from lfstereo.rig.intrinsics import plenoptic_rays
from lfstereo.rig.rig import PlenopticCamera, StereoRig
from lfstereo.rig.sightings import Sightings, usable
from lfstereo.rig.start import start_focal_px, start_poses, start_pupil, start_rig
from lfstereo.rig.thin_lens import LensBounds, ThinLens, lens_bounds
from lfstereo.rig.trust import check_baseline, check_count, check_coverage, check_lens_range, check_poses

SizePair = tuple[tuple[int, int], tuple[int, int]]
"""(width, height) of the left and the right sensor, px."""
LensPair = tuple[ThinLens | None, ThinLens | None]
_CENTRE_SD = 0.015
"""How far principal point and centre of distortion are expected from the middle, in widths of the frame."""
_BEND_SD = (0.03, 0.01, 0.01)
"""Expected distortion at half the width by the terms k1, k2, k3, relative; all expectations only count where the
photographs say less."""


@dataclass(frozen=True, slots=True)
class RigOptions:
    """How a rig is calibrated."""

    radial_terms: int = option(2, "number of radial distortion terms to estimate, 0 to 3")
    distortion_centre: bool = option(True, "estimate the centre of distortion too, instead of taking the axis")
    outlier_factor: float = option(3.0, "a shot with this many times the median shot's error is rejected; 0 = none is")
    near_m: float = option(0.0, "near end of the working range; 0 = the nearest corner", "m")
    far_m: float = option(0.0, "far end of the working range; 0 = the farthest corner", "m")
    pixel_px: float = option(0.0, "size of a rectified px; 0 = as decoded", "sensor px")
    any_set: bool = option(False, "accept sets of photographs that do not determine the rig well")
    any_lens: bool = option(False, "accept lenses that contradict the captures' metadata")


@dataclass(frozen=True, slots=True)
class ShotPair:
    """What the two cameras saw of one board."""

    name: str
    left: Sightings
    right: Sightings


@dataclass(frozen=True, slots=True)
class ShotError:
    """How well one shot of one camera fits."""

    name: str
    side: str
    rms_px: float
    corners: int
    views: int


@dataclass(frozen=True, slots=True)
class RigSolution:
    """A calibrated rig and how far to trust it."""

    rig: StereoRig
    baseline_sd_m: float
    rotation_sd_rad: tuple[float, float, float]
    """Standard deviations of turns about the right camera's x, y and z axis."""
    focal_sd: tuple[float, float]
    """Relative standard deviation of fx, left and right."""
    sigma_px: float
    """Robust standard deviation of a residual coordinate, sensor px."""
    errors: tuple[ShotError, ...]
    rejected: tuple[str, ...]
    """Names of shots that contradict the others."""
    pairs: tuple[ShotPair, ...]
    """The shots that were used."""
    adjustment: Adjustment
    """Its residuals alternate left, right, in the order of ``pairs``."""


def solve_rig(
    pairs: Sequence[ShotPair],
    points: Float64,
    sizes_px: SizePair,
    pixel_px: float,
    options: RigOptions = RigOptions(),
    progress: Progress = silent,
    lenses: LensPair = (None, None),
) -> RigSolution:
    """Calibrate a rig from the corners of a target in all views of both cameras.

    Parameters
    ----------
    pairs
        The shots, in sensor px (px of the picture for pinhole cameras).
    points
        ``(N, 3)`` corners in board axes, m.
    sizes_px
        (width, height) of the left and the right sensor.
    pixel_px
        Sensor px per px of a rectified view, unless the options say otherwise.
    options
        What to estimate and what to reject.
    lenses
        The left and the right camera's lens as their metadata tell; the search starts within what that allows and
        stays there. ``None``: not known.

    Raises
    ------
    RigError
        If the shots are too few, too much alike, cover too little or leave the baseline open, or the lenses are not
        those of the metadata; the message says what to photograph or measure next.
    """
    used = [pair for pair in pairs if usable(pair.left) and usable(pair.right)]
    check_count(len(used), len(pairs))
    used.sort(key=lambda pair: pair.name)
    bounds = tuple(None if lens is None or options.any_lens else lens_bounds(lens) for lens in lenses)
    start = _start(used, points, sizes_px, bounds)
    models = _models(used, sizes_px, [float(camera[0]) for camera in start.cameras], options, bounds)
    result = _adjust(used, points, models, start, progress)
    rejected: list[str] = []
    for _ in range(3):
        bad = _outliers(used, result, options.outlier_factor)
        if not bad:
            break
        kept = [n for n, pair in enumerate(used) if pair.name not in bad]
        rejected += [used[n].name for n in range(len(used)) if n not in kept]
        used = [used[n] for n in kept]
        check_count(len(used), len(pairs))
        state = dataclasses.replace(
            result.state, rotations=result.state.rotations[kept], translations=result.state.translations[kept]
        )
        result = _adjust(used, points, models, state, progress)
    return _checked(used, tuple(rejected), points, sizes_px, models, result, options.pixel_px or pixel_px, options)


def is_pinhole(shots: Sequence[Sightings]) -> bool:
    """Return whether all corners were seen in centre views only, as by ordinary cameras."""
    return not any(np.any(shot.offset) for shot in shots)


def _models(
    pairs: Sequence[ShotPair],
    sizes_px: SizePair,
    focals_px: Sequence[float],
    options: RigOptions,
    bounds: Sequence[LensBounds | None],
) -> tuple[LensModel, LensModel]:
    models = []
    for shots, (width, height), focal, bound in zip(_sides(pairs), sizes_px, focals_px, bounds, strict=True):
        free = np.ones(11, np.bool_)
        free[4:6] = not is_pinhole(shots)
        free[6:9] = np.arange(3) < options.radial_terms
        free[9:] = options.distortion_centre and options.radial_terms > 0
        expected, sd = np.zeros(11), np.full(11, np.inf)
        expected[2:4] = (width - 1) / 2, (height - 1) / 2
        sd[2:4] = _CENTRE_SD * width
        sd[6:9] = np.array(_BEND_SD) / (0.5 * width / focal) ** np.array([2, 4, 6])
        sd[9:] = _CENTRE_SD * width / focal
        low, high = np.full(11, -np.inf), np.full(11, np.inf)
        if bound is not None:
            for side, values in enumerate((low, high)):
                values[:2], values[5] = bound.focal_px[side], bound.pupil_m_per_px[side]
                values[4] = bound.vergence_per_m[side]
        models.append(LensModel(plenoptic_rays, free, expected, sd, low, high, stigmatic=True))
    return models[0], models[1]


def _sides(pairs: Sequence[ShotPair]) -> tuple[list[Sightings], list[Sightings]]:
    return [pair.left for pair in pairs], [pair.right for pair in pairs]


def _start(
    pairs: Sequence[ShotPair], points: Float64, sizes_px: SizePair, bounds: Sequence[LensBounds | None]
) -> BundleState:
    cameras, poses = [], []
    for shots, size, bound in zip(_sides(pairs), sizes_px, bounds, strict=True):
        centre = (np.asarray(size, np.float64) - 1) / 2
        focal = start_focal_px(shots, points, centre, float(max(size)), bound.focal_px if bound else None)
        poses.append([start_poses(shot, points, focal, centre) for shot in shots])
        cameras.append(np.array([focal, focal, *centre, 1.0, 1e-3, 0, 0, 0, 0, 0]))
    rotation, translation, turns, moves = start_rig(*poses)
    state = BundleState(
        cameras=tuple(cameras),
        rig_rotation=rotation,
        rig_translation=translation,
        rotations=np.stack(turns),
        translations=np.stack(moves),
    )
    for side, (camera, shots, bound) in enumerate(zip(cameras, _sides(pairs), bounds, strict=True)):
        if not is_pinhole(shots):
            depths = [points_in_camera(state, points, side, n)[:, 2] for n in range(len(pairs))]
            camera[4:6] = start_pupil(shots, depths, camera[0])
            if bound is not None:
                camera[4] = np.clip(camera[4], *bound.vergence_per_m)
                camera[5] = np.clip(camera[5], *bound.pupil_m_per_px)
    return state


def _adjust(
    pairs: Sequence[ShotPair],
    points: Float64,
    models: tuple[LensModel, LensModel],
    start: BundleState,
    progress: Progress,
) -> Adjustment:
    seen = [Seen(side, n, shot) for n, pair in enumerate(pairs) for side, shot in enumerate((pair.left, pair.right))]
    return adjust(models, points, seen, start, progress)


def _errors(pairs: Sequence[ShotPair], result: Adjustment) -> list[ShotError]:
    errors = []
    shots = [(pair.name, side, shot) for pair in pairs for side, shot in (("left", pair.left), ("right", pair.right))]
    for (name, side, shot), residual in zip(shots, result.residuals, strict=True):
        seen = shot.weight > 0
        rms = float(np.sqrt(np.mean(residual[seen] ** 2)))
        views = len(np.unique(shot.offset[seen], axis=0))
        errors.append(ShotError(name, side, rms, len(np.unique(shot.corner[seen])), views))
    return errors


def _outliers(pairs: Sequence[ShotPair], result: Adjustment, factor: float) -> set[str]:
    """Return the shots far worse than the median; at most the worst quarter at once, as one can spoil others."""
    errors = _errors(pairs, result)
    limit = factor * float(np.median([error.rms_px for error in errors]))
    bad = sorted((e for e in errors if e.rms_px > limit), key=lambda e: -e.rms_px) if factor > 0 else []
    return {error.name for error in bad[: max(1, len(pairs) // 4)]}


def _checked(
    pairs: Sequence[ShotPair],
    rejected: tuple[str, ...],
    points: Float64,
    sizes_px: SizePair,
    models: tuple[LensModel, LensModel],
    result: Adjustment,
    pixel_px: float,
    options: RigOptions,
) -> RigSolution:
    state = result.state
    for side, shots, values, model in zip(("left", "right"), _sides(pairs), state.cameras, models, strict=True):
        if not is_pinhole(shots):
            check_lens_range(side, values, model.low, model.high)
    if not options.any_set:
        check_poses(state.rotations, state.translations, points)
        for side, shots, size in zip(("left", "right"), _sides(pairs), sizes_px, strict=True):
            check_coverage(side, shots, size)
    counts = [int(model.free.sum()) for model in models]
    rig_at = sum(counts)
    covariance = result.covariance[rig_at : rig_at + 6, rig_at : rig_at + 6]
    direction = state.rig_translation / np.linalg.norm(state.rig_translation)
    rig = _rig(pairs, points, sizes_px, state, pixel_px, options)
    baseline_sd = float(np.sqrt(direction @ covariance[3:, 3:] @ direction))
    if not options.any_set:
        check_baseline(rig.baseline_m, baseline_sd)
    sd = np.sqrt(np.diag(result.covariance))
    return RigSolution(
        rig=rig,
        baseline_sd_m=baseline_sd,
        rotation_sd_rad=(float(sd[rig_at]), float(sd[rig_at + 1]), float(sd[rig_at + 2])),
        focal_sd=(float(sd[0] / rig.left.focal_px[0]), float(sd[counts[0]] / rig.right.focal_px[0])),
        sigma_px=result.sigma_px,
        errors=tuple(_errors(pairs, result)),
        rejected=rejected,
        pairs=tuple(pairs),
        adjustment=result,
    )


def _rig(
    pairs: Sequence[ShotPair],
    points: Float64,
    sizes_px: SizePair,
    state: BundleState,
    pixel_px: float,
    options: RigOptions,
) -> StereoRig:
    depths = np.stack([points_in_camera(state, points, 0, n)[:, 2] for n in range(len(pairs))])
    near, far = options.near_m or float(depths.min()), options.far_m or float(depths.max())
    cameras = [
        _camera(shots, size, values, 2 / (1 / near + 1 / far))
        for shots, size, values in zip(_sides(pairs), sizes_px, state.cameras, strict=True)
    ]
    turn, move = Rotation.from_matrix(state.rig_rotation).as_rotvec().tolist(), state.rig_translation.tolist()
    return StereoRig(
        left=cameras[0],
        right=cameras[1],
        rotation_rad=(turn[0], turn[1], turn[2]),
        translation_m=(move[0], move[1], move[2]),
        near_m=near,
        far_m=far,
        pixel_px=pixel_px,
    )


def _camera(shots: Sequence[Sightings], size: tuple[int, int], values: Float64, middle_m: float) -> PlenopticCamera:
    fx, fy, cx, cy, vergence, pupil, *bend = (float(value) for value in values)
    return PlenopticCamera(
        serial=shots[0].serial,
        sensor_px=size,
        focal_px=(fx, fy),
        principal_px=(cx, cy),
        focus_distance_m=middle_m if is_pinhole(shots) else 1 / vergence,
        pupil_m_per_px=pupil,
        distortion=(bend[0], bend[1], bend[2], bend[3], bend[4]),
    )
