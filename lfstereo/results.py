"""The result folder of a run: maps, pictures, focal stacks, point cloud and what they were made with."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from lfstereo import __version__
from lfstereo.arrays import Bool, Disparity, Float32, UInt8
from lfstereo.depth.baselines import fill_from_background, sgbm, sgbm_wls
from lfstereo.depth.colormap import DisparityScale, colour_disparity, picture_disparity
from lfstereo.depth.glb import write_glb
from lfstereo.depth.mesh import mesh_from_depth
from lfstereo.depth.metrics import score_disparity
from lfstereo.depth.pfm import read_pfm, write_pfm
from lfstereo.depth.pictures import write_png
from lfstereo.depth.ply import write_ply
from lfstereo.depth.png16 import write_disparity_png
from lfstereo.depth.points import points_from_depth
from lfstereo.depth.triangulate import DepthMap, triangulate
from lfstereo.errors import AssetError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.encoding import srgb8, srgb16
from lfstereo.options import to_toml, toml_value
from lfstereo.outputs import atomic_folder
from lfstereo.pipeline import PairResult, RunOptions
from lfstereo.progress import StageClock
from lfstereo.viewer.content import PAGE_NAME, encode_result, result_content
from lfstereo.viewer.template import fill_page

_GAP_PX = 8
_PACKAGES = ("numpy", "scipy", "opencv-contrib-python-headless", "torch")


@dataclass(frozen=True, slots=True)
class Inputs:
    """Files that a run was started with."""

    left: Path
    right: Path
    rig: Path


@dataclass(frozen=True, slots=True)
class DisparityTruth:
    """A true disparity map."""

    disparity: Disparity
    """``(V, U)`` px of the rectified left centre view."""
    known: Bool
    """``(V, U)``."""


@dataclass(frozen=True, slots=True)
class Report:
    """Summary of a run."""

    width: int
    height: int
    disparity_px: tuple[float, float]
    """1st and 99th percentile of the valid disparities."""
    depth_m: tuple[float, float]
    """1st and 99th percentile of the valid depths."""
    valid_share: float
    points: int
    seconds: dict[str, float]
    peak_gib: dict[str, float]
    errors: dict[str, dict[str, float]]
    """Per method: judged_percent, mae_px, bad_1/2/4_percent, median_depth_error (relative); empty without truth."""

    @property
    def peak_memory_gib(self) -> float:
        """Largest of the stages' peaks."""
        return max(self.peak_gib.values())

    def values(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def write_results(
    folder: Path,
    result: PairResult,
    inputs: Inputs,
    options: RunOptions,
    clock: StageClock,
    truth: DisparityTruth | None = None,
    force: bool = False,
) -> Report:
    """Write the result folder, whole or not at all.

    Returns
    -------
    Report
        The summary that is also in ``run.toml``.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.
    """
    with atomic_folder(folder, force) as out:
        return fill_folder(out, result, inputs, options, clock, truth)


def fill_folder(
    out: Path,
    result: PairResult,
    inputs: Inputs,
    options: RunOptions,
    clock: StageClock,
    truth: DisparityTruth | None = None,
) -> Report:
    """Write the files of a result folder into an empty folder; as in :func:`write_results`."""
    depth = _depth(result, result.map.disparity, result.map.valid)
    errors = truth_errors(result, truth) if truth else {}
    with clock.stage("write results"):
        points = _write_maps(out, result, depth)
        for side, part in (("left", result.left), ("right", result.right)):
            write_png(out / f"centre_{side}.png", srgb8(part.centre_view))
            _write_stack(out / f"focal_stack_{side}", part.stack)
    with clock.stage("encode page"):
        encoded = encode_result(result)
    report = _summary(result, depth, points, clock, errors)
    run_toml = _run_toml(report, result, inputs, options)
    (out / "run.toml").write_text(run_toml, "utf-8")
    (out / PAGE_NAME).write_text(fill_page(result_content(encoded, run_toml, out)), "utf-8")
    return report


def read_truth(folder: Path, size: tuple[int, int]) -> DisparityTruth:
    """Read the true disparity map that a simulation wrote.

    Parameters
    ----------
    folder
        The ``truth`` folder of the simulation.
    size
        (V, U) of the rectified views.

    Raises
    ------
    AssetError
        If the folder holds no ``disparity.pfm``.
    ShapeError
        If the truth has another size.
    """
    path = folder / "disparity.pfm"
    if not path.is_file():
        raise AssetError(f"{folder}: holds no disparity.pfm; give the 'truth' folder of a simulation")
    disparity, known = read_pfm(path)
    if disparity.shape != size:
        raise ShapeError(f"{path}: {disparity.shape}, but this rig's views have {size}; give the truth of this rig")
    return DisparityTruth(disparity, known)


def truth_errors(result: PairResult, truth: DisparityTruth) -> dict[str, dict[str, float]]:
    """Compare with a true disparity map, beside SGBM and SGBM + WLS (holes filled) on the rectified centre views.

    All are judged at every pixel whose truth is known inside the common field of view, our own once more where it is
    valid: a network that knows its errors answers less than that.
    """
    everywhere = truth.known & result.common
    centres = result.left.centre_view, result.right.centre_view
    candidates = {"lfstereo": result.map, "lfstereo, where valid": result.map}
    for name, match in (("SGBM", sgbm), ("SGBM + WLS", sgbm_wls)):
        candidates[name] = fill_from_background(match(*centres, result.geometry.disparity_max_px))
    depth_true = _depth(result, truth.disparity, everywhere)
    errors = {}
    for name, found in candidates.items():
        judged = everywhere & found.valid if name.endswith("valid") else everywhere
        if not judged.any():
            continue
        scores = score_disparity(found.disparity, truth.disparity, judged)
        depth = _depth(result, found.disparity, judged)
        both = depth.valid & depth_true.valid
        relative = np.abs(depth.depth_m - depth_true.depth_m)[both] / depth_true.depth_m[both]
        errors[name] = {
            "judged_percent": 100 * float(judged.sum() / everywhere.sum()),
            "mae_px": scores.mae_px,
            "bad_1_percent": scores.bad_1,
            "bad_2_percent": scores.bad_2,
            "bad_4_percent": scores.bad_4,
            "median_depth_error": float(np.median(relative)),
        }
    return errors


def _depth(result: PairResult, disparity: Float32, valid: Bool) -> DepthMap:
    geometry = result.geometry
    return triangulate(disparity, valid, geometry.focal_px, geometry.baseline_m, geometry.doffs_px)


def _write_maps(out: Path, result: PairResult, depth: DepthMap) -> int:
    found, geometry = result.map, result.geometry
    write_pfm(out / "disparity.pfm", found.disparity, depth.valid)
    write_disparity_png(out / "disparity.png", found.disparity, depth.valid)
    scale = DisparityScale(
        near_px=geometry.disparity_max_px,
        focal_px=geometry.focal_px,
        baseline_m=geometry.baseline_m,
        doffs_px=geometry.doffs_px,
    )
    write_png(out / "disparity_colour.png", picture_disparity(found.disparity, depth.valid, scale))
    tifffile.imwrite(out / "depth.tiff", depth.depth_m)
    write_png(out / "valid.png", np.where(depth.valid, 255, 0).astype(np.uint8))
    sharp = srgb8(found.all_in_focus)
    write_png(out / "all_in_focus.png", sharp)
    cloud = points_from_depth(depth, found.all_in_focus, geometry.focal_px, geometry.left.principal_px)
    write_ply(out / "point_cloud.ply", cloud)
    mesh = mesh_from_depth(depth, geometry.focal_px, geometry.left.principal_px)
    if len(mesh.triangles):
        write_glb(out / "mesh.glb", mesh, sharp)
    coloured = colour_disparity(found.disparity, depth.valid, scale)
    write_png(out / "overview.png", _overview(result, sharp, coloured))
    return len(cloud.points_m)


def _overview(result: PairResult, sharp: UInt8, coloured: UInt8) -> UInt8:
    """Return one picture: a near and a far slice above, all-in-focus image and disparity below."""
    slices = result.left.stack.slices
    near, far = (srgb8(slices[k]) for k in (len(slices) // 5, len(slices) - 1 - len(slices) // 6))
    beside = np.full((sharp.shape[0], _GAP_PX, 3), 255, np.uint8)
    upper, lower = np.hstack([near, beside, far]), np.hstack([sharp, beside, coloured])
    return np.vstack([upper, np.full((_GAP_PX, upper.shape[1], 3), 255, np.uint8), lower])


def _write_stack(folder: Path, stack: FocalStack) -> None:
    folder.mkdir()
    for k, (picture, disparity) in enumerate(zip(stack.slices, stack.disparities_px, strict=True)):
        write_png(folder / f"slice_{k:02d}_d{disparity:06.2f}px.png", srgb16(picture))


def _summary(
    result: PairResult, depth: DepthMap, points: int, clock: StageClock, errors: dict[str, dict[str, float]]
) -> Report:
    def span(values: Float32) -> tuple[float, float]:
        low, high = np.percentile(values[depth.valid], [1, 99]) if depth.valid.any() else (0.0, 0.0)
        return float(low), float(high)

    return Report(
        width=depth.valid.shape[1],
        height=depth.valid.shape[0],
        disparity_px=span(result.map.disparity),
        depth_m=span(depth.depth_m),
        valid_share=float(depth.valid.mean()),
        points=points,
        seconds=dict(clock.seconds),
        peak_gib=dict(clock.peak_gib),
        errors=errors,
    )


def _run_toml(report: Report, result: PairResult, inputs: Inputs, options: RunOptions) -> str:
    geometry = result.geometry
    tables: dict[str, dict[str, Any]] = {
        "versions": {"lfstereo": __version__, "python": platform.python_version()}
        | {name: metadata.version(name) for name in _PACKAGES},
        "inputs": {"left": inputs.left.name, "right": inputs.right.name, "rig": inputs.rig.name},
        "sha256": {"left": sha256_of(inputs.left), "right": sha256_of(inputs.right), "rig": sha256_of(inputs.rig)}
        | {"weights": result.weights_sha256},
        "geometry": {
            "focal_px": geometry.focal_px,
            "baseline_m": geometry.baseline_m,
            "doffs_px": geometry.doffs_px,
            "principal_left_px": geometry.left.principal_px,
            "principal_right_px": geometry.right.principal_px,
            "slice_disparities_px": tuple(float(d) for d in result.left.stack.disparities_px),
            "aperture_ratio": result.left.stack.aperture_ratio,
        },
        "summary": {
            name: getattr(report, name)
            for name in ("width", "height", "disparity_px", "depth_m", "valid_share", "points")
        },
        "seconds": {name: round(seconds, 3) for name, seconds in report.seconds.items()},
        "peak_gib": {name: round(gib, 3) for name, gib in report.peak_gib.items()},
    }
    tables |= {f'error."{name}"': values for name, values in report.errors.items()}
    text = f"[run]\n{to_toml(options)}"
    for name, table in tables.items():
        text += f"\n[{name}]\n" + "".join(f"{_key(key)} = {toml_value(value)}\n" for key, value in table.items())
    return text


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else toml_value(name)


def sha256_of(path: Path) -> str:
    """Return the sha256 of a file, or of the names and contents of a folder's files."""
    digest = hashlib.sha256()
    for file in [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file()):
        if file != path:
            digest.update(file.relative_to(path).as_posix().encode())
        with file.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
