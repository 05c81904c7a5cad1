"""Bundle adjustment of one camera or two over all views: robust Levenberg-Marquardt with analytic derivatives."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Bool, Float64
from lfstereo.progress import Progress, silent
from lfstereo.rig.intrinsics import Expand, project
from lfstereo.rig.sightings import Sightings
from lfstereo.rig.uncertainty import jackknife_covariance, without_pose

_CLIP_SIGMAS = 3.0
_MEDIAN_OF_NORM = 1.1774
"""Median length of a 2-D Gaussian residual in standard deviations, sqrt(2 ln 2)."""
_MAX_STEPS = 60
_SMALL_GAIN = 1e-3
"""Of the cost in variances: a step that gains less moves no unknown by a twentieth of its standard deviation."""


@dataclass(frozen=True, slots=True)
class LensModel:
    """How a camera's parameters become rays, and which of them are adjusted."""

    expand: Expand
    free: Bool
    """``(n,)``"""
    expected: Float64
    """``(n,)`` what the parameters are without any measurement."""
    expected_sd: Float64
    """``(n,)`` standard deviation of that; ``inf`` = anything."""
    low: Float64
    """``(n,)`` least value of each parameter; ``-inf`` = any."""
    high: Float64
    """``(n,)`` largest value; ``inf`` = any."""
    stigmatic: bool = False
    """Distortion moves the picture, not the directions; see :func:`lfstereo.rig.intrinsics.project`."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One shot of one camera in the adjustment."""

    camera: int
    pose: int
    sightings: Sightings


@dataclass(frozen=True, slots=True)
class BundleState:
    """Everything that is adjusted: cameras, right_from_left, and each shot's left_from_board."""

    cameras: tuple[Float64, ...]
    rig_rotation: Float64
    """``(3, 3)``; of the second camera, where there is one."""
    rig_translation: Float64
    """``(3,)`` m."""
    rotations: Float64
    """``(P, 3, 3)``"""
    translations: Float64
    """``(P, 3)`` m."""


@dataclass(frozen=True, slots=True)
class Adjustment:
    """The result of a bundle adjustment."""

    state: BundleState
    covariance: Float64
    """Of the free parameters: cameras in turn, then the rig (rotation about its own axes in rad, translation in m);
    whatever the residuals of one shot have in common."""
    sigma_px: float
    """Robust standard deviation of a residual coordinate."""
    residuals: tuple[Float64, ...]
    """Per shot ``(M, 2)`` px, predicted minus seen."""
    steps: int


@dataclass(frozen=True, slots=True)
class _Problem:
    models: tuple[LensModel, ...]
    points: Float64
    seen: tuple[Seen, ...]
    poses: int

    @property
    def shared(self) -> int:
        return sum(int(m.free.sum()) for m in self.models) + 6 * (len(self.models) - 1)

    @property
    def precision(self) -> Float64:
        """Return the inverse variance of what is expected of each free camera parameter."""
        return np.concatenate([1 / m.expected_sd[m.free] ** 2 for m in self.models])

    def surprise(self, state: BundleState) -> tuple[Float64, Float64]:
        """Return how far the free camera parameters are from what was expected, and the weights of their squares.

        A corner counts as one measurement against them however many views it was seen in: what is wrong with it in
        one view, of a board that is not flat or a lens that is not modelled, is wrong in all.
        """
        pairs = list(zip(self.models, state.cameras, strict=True))
        away = np.concatenate([(values - m.expected)[m.free] for m, values in pairs])
        precision = self.precision
        shots = [s.sightings for s in self.seen]
        corners = sum(len(np.unique(shot.corner[shot.weight > 0])) for shot in shots)
        return away, precision * (sum(float(shot.weight.sum()) for shot in shots) / max(corners, 1))

    def columns(self, seen: Seen) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Return the unknowns that a shot depends on, in the order of its derivatives."""
        counts = [int(m.free.sum()) for m in self.models]
        first = sum(counts[: seen.camera])
        own = np.arange(first, first + counts[seen.camera])
        rig = np.arange(sum(counts), sum(counts) + 6) if seen.camera else np.arange(0)
        pose = self.shared + 6 * seen.pose + np.arange(6)
        return np.concatenate([own, rig, pose])


def adjust(
    models: Sequence[LensModel],
    points: Float64,
    seen: Sequence[Seen],
    start: BundleState,
    progress: Progress = silent,
) -> Adjustment:
    """Move cameras, rig and poses until the corners are seen where they were seen.

    Parameters stay within the bounds of their lens model. Minimises the confidence-weighted Huber loss of the
    residuals in px; its bend lies at three robust standard deviations of the residuals and is set anew until it stays.

    Parameters
    ----------
    models
        One or two cameras.
    points
        ``(N, 3)`` corners of the target in board axes, m.
    seen
        The measurements.
    start
        Where to begin.

    References
    ----------
    Triggs, McLauchlan, Hartley and Fitzgibbon, "Bundle adjustment - a modern synthesis" (2000); Huber, "Robust
    estimation of a location parameter" (1964).
    """
    problem = _Problem(tuple(models), points, tuple(seen), len(start.rotations))
    state, steps = start, 0
    sigma = _sigma(problem, state)
    for _ in range(6):
        state, taken = _descend(problem, state, _CLIP_SIGMAS * sigma, progress, steps)
        steps += taken
        before, sigma = sigma, _sigma(problem, state)
        if abs(sigma - before) < 0.01 * before or steps >= _MAX_STEPS:
            break
    return Adjustment(
        state=state,
        covariance=_covariance(problem, state, _CLIP_SIGMAS * sigma),
        sigma_px=sigma,
        residuals=tuple(_residual(problem, state, s) for s in problem.seen),
        steps=steps,
    )


def points_in_camera(state: BundleState, points: Float64, camera: int, pose: int) -> Float64:
    """Return the target's corners of one shot in a camera's axes, ``(N, 3)`` m."""
    left: Float64 = points @ state.rotations[pose].T + state.translations[pose]
    if camera:
        left = left @ state.rig_rotation.T + state.rig_translation
    return left


def _residual(problem: _Problem, state: BundleState, seen: Seen) -> Float64:
    shot = seen.sightings
    model = problem.models[seen.camera]
    rays, _ = model.expand(state.cameras[seen.camera])
    points = points_in_camera(state, problem.points, seen.camera, seen.pose)[shot.corner]
    if points[:, 2].min() <= 0:
        return np.full_like(shot.place, 1e6)
    residual: Float64 = project(rays, shot.offset, points, shot.place, model.stigmatic).place - shot.place
    return residual


def _sigma(problem: _Problem, state: BundleState) -> float:
    lengths = [np.hypot(*_residual(problem, state, s)[s.sightings.weight > 0].T) for s in problem.seen]
    return max(float(np.median(np.concatenate(lengths))) / _MEDIAN_OF_NORM, 1e-9)


def _cost(problem: _Problem, state: BundleState, clip: float) -> float:
    away, weight = problem.surprise(state)
    total = 0.5 * (clip / _CLIP_SIGMAS) ** 2 * float(weight @ away**2)
    for seen in problem.seen:
        length = np.hypot(*_residual(problem, state, seen).T)
        loss = np.where(length <= clip, 0.5 * length**2, clip * (length - 0.5 * clip))
        total += float(seen.sightings.weight @ loss)
    return total


def _descend(
    problem: _Problem, state: BundleState, clip: float, progress: Progress, done: int
) -> tuple[BundleState, int]:
    cost, damping = _cost(problem, state, clip), 1e-4
    for step in range(_MAX_STEPS - done):
        progress(min(done + step, _MAX_STEPS), _MAX_STEPS)
        normal, gradient = _normal_equations(problem, state, clip)
        scale = np.sqrt(np.diag(normal))
        scale[scale == 0] = 1.0  # The centre of distortion, as long as there is none.
        normal, gradient = normal / np.outer(scale, scale), gradient / scale
        gain = 0.0
        while damping < 1e10:
            delta = -np.linalg.solve(normal + damping * np.eye(len(scale)), gradient) / scale
            trial = _moved(problem, state, delta)
            trial_cost = _cost(problem, trial, clip)
            if trial_cost < cost:
                gain, state, cost, damping = cost - trial_cost, trial, trial_cost, max(damping / 10, 1e-14)
                break
            damping *= 8
        if gain < _SMALL_GAIN * (clip / _CLIP_SIGMAS) ** 2:
            return state, step + 1
    return state, max(_MAX_STEPS - done, 0)


def _normal_equations(problem: _Problem, state: BundleState, clip: float) -> tuple[Float64, Float64]:
    """Return ``J'WJ`` and ``J'Wr``, with what was expected."""
    size = problem.shared + 6 * problem.poses
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    away, weight = problem.surprise(state)
    own = np.arange(len(away))
    normal[own, own] += (clip / _CLIP_SIGMAS) ** 2 * weight
    gradient[own] += (clip / _CLIP_SIGMAS) ** 2 * weight * away
    for seen in problem.seen:
        columns = problem.columns(seen)
        own_normal, own_gradient = _equations_of(problem, state, clip, seen)
        normal[np.ix_(columns, columns)] += own_normal
        gradient[columns] += own_gradient
    return normal, gradient


def _equations_of(problem: _Problem, state: BundleState, clip: float, seen: Seen) -> tuple[Float64, Float64]:
    residual, jacobian = _derivatives(problem, state, seen)
    trust = seen.sightings.weight * np.minimum(1.0, clip / np.maximum(np.hypot(*residual.T), 1e-300))
    weighted = jacobian * trust[:, None, None]
    # Not matmul: threads of a linear algebra library stall each other on matrices this thin.
    return np.einsum("mac,mad->cd", weighted, jacobian), np.einsum("mac,ma->c", weighted, residual)


def _derivatives(problem: _Problem, state: BundleState, seen: Seen) -> tuple[Float64, Float64]:
    shot, model = seen.sightings, problem.models[seen.camera]
    rays, by_parameter = model.expand(state.cameras[seen.camera])
    turned = problem.points @ state.rotations[seen.pose].T
    in_left = turned + state.translations[seen.pose]
    by_pose = np.concatenate([-_cross(turned), np.broadcast_to(np.eye(3), (len(turned), 3, 3))], axis=2)
    points = in_left
    if seen.camera:
        swung = in_left @ state.rig_rotation.T
        points = swung + state.rig_translation
        by_rig = np.concatenate([-_cross(swung), np.broadcast_to(np.eye(3), (len(turned), 3, 3))], axis=2)
        by_pose = np.concatenate([by_rig, state.rig_rotation @ by_pose], axis=2)
    seen_at = project(rays, shot.offset, points[shot.corner], shot.place, model.stigmatic)
    by_camera = seen_at.by_ray @ by_parameter[:, model.free]
    jacobian = np.concatenate([by_camera, seen_at.by_point @ by_pose[shot.corner]], axis=2)
    return seen_at.place - shot.place, jacobian


def _cross(vectors: Float64) -> Float64:
    """Return the ``(N, 3, 3)`` matrices of the cross product."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    matrices: Float64 = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return matrices


def _moved(problem: _Problem, state: BundleState, delta: Float64) -> BundleState:
    cameras, first = [], 0
    for model, values in zip(problem.models, state.cameras, strict=True):
        count = int(model.free.sum())
        moved = values.copy()
        moved[model.free] += delta[first : first + count]
        cameras.append(np.clip(moved, model.low, model.high))
        first += count
    if len(problem.models) > 1:
        rotation = Rotation.from_rotvec(delta[first : first + 3]).as_matrix() @ state.rig_rotation
        translation = state.rig_translation + delta[first + 3 : first + 6]
        state = dataclasses.replace(state, rig_rotation=rotation, rig_translation=translation)
    poses = delta[problem.shared :].reshape(-1, 6)
    return dataclasses.replace(
        state,
        cameras=tuple(cameras),
        rotations=Rotation.from_rotvec(poses[:, :3]).as_matrix() @ state.rotations,
        translations=state.translations + poses[:, 3:],
    )


def _covariance(problem: _Problem, state: BundleState, clip: float) -> Float64:
    shared = problem.shared
    size = shared + 6
    normals, gradients = np.zeros((problem.poses, size, size)), np.zeros((problem.poses, size))
    for seen in problem.seen:
        columns = problem.columns(seen)
        columns = np.where(columns < shared, columns, columns - 6 * seen.pose)
        normal, gradient = _equations_of(problem, state, clip, seen)
        normals[seen.pose][np.ix_(columns, columns)] += normal
        gradients[seen.pose][columns] += gradient
    _, weight = problem.surprise(state)
    precision = problem.precision
    views = np.divide(weight, precision, out=np.zeros_like(weight), where=precision > 0)
    expected, scores = np.zeros(shared), np.zeros(shared)
    expected[: len(weight)] = (clip / _CLIP_SIGMAS) ** 2 * weight
    scores[: len(weight)] = (clip / _CLIP_SIGMAS) ** 4 * weight * views
    shots = [without_pose(*equations, shared) for equations in zip(normals, gradients, strict=True)]
    return jackknife_covariance(shots, expected, scores)
