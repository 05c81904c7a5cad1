"""The result folder of one focus sweep or two: maps, pictures, points and what they were made with."""

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
from lfstereo.arrays import Bool, Float32, Rgb, UInt8
from lfstereo.depth.colormap import DisparityScale, colour_disparity, picture_disparity
from lfstereo.depth.pfm import write_pfm
from lfstereo.depth.pictures import write_png
from lfstereo.depth.ply import write_ply
from lfstereo.depth.png16 import write_disparity_png
from lfstereo.depth.points import points_from_depth
from lfstereo.depth.triangulate import DepthMap
from lfstereo.focus.alignment import AlignedSweep
from lfstereo.lightfield.encoding import srgb8
from lfstereo.options import to_toml, toml_value
from lfstereo.outputs import atomic_folder
from lfstereo.progress import StageClock
from lfstereo.stack_pipeline import StackOptions, SweepPairResult, SweepResult

_GAP_PX = 8
_PACKAGES = ("numpy", "scipy", "opencv-contrib-python-headless", "imageio", "rawpy")


@dataclass(frozen=True, slots=True)
class StackReport:
    """Summary of a result."""

    width: int
    height: int
    slices: int
    valid_share: float
    depth_m: tuple[float, float] | None
    """1st and 99th percentile of the valid depths; ``None`` where no distance is known."""
    disparity_px: tuple[float, float] | None
    """Of two sweeps: 1st and 99th percentile of the valid disparities."""
    points: int
    """Of the point cloud; 0 where no geometry is known."""
    moved_px: float
    """Largest distance that alignment moved a corner of any picture by."""
    least_correlation: float
    """Of neighbouring pictures after alignment."""
    seconds: dict[str, float]

    def values(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def write_sweep(
    folder: Path, result: SweepResult, source: Path, options: StackOptions, clock: StageClock, force: bool = False
) -> StackReport:
    """Write what one sweep gave, whole or not at all.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.
    """
    sweep, found = result.aligned.sweep, result.focus
    points = 0
    with atomic_folder(folder, force) as out:
        with clock.stage("write results"):
            write_pfm(out / "slice_index.pfm", found.slice_index, result.valid)
            write_png(out / "confidence.png", np.rint(255 * np.clip(found.confidence, 0, 1)).astype(np.uint8))
            scale, values = _scale(result)
            coloured = colour_disparity(values, result.valid, scale)
            name = "slice_index_colour.png" if result.depth is None else "depth_colour.png"
            write_png(out / name, picture_disparity(values, result.valid, scale))
            _write_shared(out, found.all_in_focus, result.valid, sweep.slices, coloured)
            if result.depth is not None:
                points = _write_depth(out, result.depth, found.all_in_focus, result.focal_px, None)
        report = _report([result.aligned], result.valid, result.depth, None, points, clock)
        geometry = {} if result.focal_px is None else {"focal_px": result.focal_px}
        text = _run_toml(report, {"stack": (source, result.aligned)}, geometry, options)
        (out / "run.toml").write_text(text, "utf-8")
    return report


def write_sweep_pair(
    folder: Path,
    result: SweepPairResult,
    sources: tuple[Path, Path],
    rig: Path | None,
    options: StackOptions,
    clock: StageClock,
    force: bool = False,
) -> StackReport:
    """Write what two sweeps gave, whole or not at all; the names are those of ``lfstereo run``.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.
    """
    found, view, points = result.map, result.geometry, 0
    with atomic_folder(folder, force) as out:
        with clock.stage("write results"):
            write_pfm(out / "disparity.pfm", found.disparity, found.valid)
            write_disparity_png(out / "disparity.png", found.disparity, found.valid)
            scale = DisparityScale(result.search_px[1], result.search_px[0])
            if view is not None:
                scale = DisparityScale(
                    result.search_px[1], result.search_px[0], view.focal_px, view.baseline_m, view.doffs_px
                )
            write_png(out / "disparity_colour.png", picture_disparity(found.disparity, found.valid, scale))
            coloured = colour_disparity(found.disparity, found.valid, scale)
            _write_shared(out, found.all_in_focus, found.valid, result.left.sweep.slices, coloured)
            if result.depth is not None and view is not None:
                points = _write_depth(out, result.depth, found.all_in_focus, view.focal_px, view.principal_px)
        pair = [result.left, result.right]
        report = _report(pair, found.valid, result.depth, found.disparity, points, clock)
        geometry = {} if view is None else asdict(view)
        inputs = {"left": (sources[0], result.left), "right": (sources[1], result.right)}
        text = _run_toml(report, inputs, geometry, options, rig, result.weights_sha256)
        (out / "run.toml").write_text(text, "utf-8")
    return report


def _scale(result: SweepResult) -> tuple[DisparityScale, Float32]:
    """Return the colour scale and what it colours: 1/m where distances are known, else slices, the first cold."""
    if result.depth is None:
        return DisparityScale(len(result.aligned.sweep.slices) - 1.0, unit="slice"), result.focus.slice_index
    distances = result.aligned.sweep.distances_m
    assert distances is not None
    metres = result.depth.depth_m
    per_m = np.divide(1.0, metres, out=np.zeros_like(metres), where=metres > 0)
    near, far = 1 / float(distances[0]), 1 / float(distances[-1])
    return DisparityScale(near, far, focal_px=1.0, baseline_m=1.0, unit="1/m"), per_m


def _write_shared(out: Path, sharp: Rgb, valid: Bool, slices: Float32, coloured: UInt8) -> None:
    write_png(out / "valid.png", np.where(valid, 255, 0).astype(np.uint8))
    picture = srgb8(sharp)
    write_png(out / "all_in_focus.png", picture)
    first, last = (srgb8(slices[k]) for k in (0, -1))
    write_png(out / "overview.png", _two_by_two(first, last, picture, coloured))


def _two_by_two(first: UInt8, last: UInt8, sharp: UInt8, coloured: UInt8) -> UInt8:
    """Return one picture: the first and the last slice above, all-in-focus picture and map below."""
    rows = []
    for pair in ((first, last), (sharp, coloured)):
        between = np.full((pair[0].shape[0], _GAP_PX, 3), 255, np.uint8)
        rows.append(np.hstack([pair[0], between, pair[1]]))
    width = max(row.shape[1] for row in rows)
    wide = [np.pad(row, ((0, _GAP_PX), (0, width - row.shape[1]), (0, 0)), constant_values=255) for row in rows]
    return np.vstack(wide)[:-_GAP_PX]


def _write_depth(
    out: Path, depth: DepthMap, sharp: Rgb, focal_px: float | None, principal_px: tuple[float, float] | None
) -> int:
    """Write depth in metres and, where the focal length is known, the points; return how many."""
    tifffile.imwrite(out / "depth.tiff", depth.depth_m)
    if focal_px is None:
        return 0
    rows, columns = depth.depth_m.shape
    cloud = points_from_depth(depth, sharp, focal_px, principal_px or ((columns - 1) / 2, (rows - 1) / 2))
    write_ply(out / "point_cloud.ply", cloud)
    return len(cloud.points_m)


def _report(
    aligned: list[AlignedSweep],
    valid: Bool,
    depth: DepthMap | None,
    disparity: Float32 | None,
    points: int,
    clock: StageClock,
) -> StackReport:
    def span(values: Float32, known: Bool) -> tuple[float, float]:
        low, high = np.percentile(values[known], [1, 99]) if known.any() else (0.0, 0.0)
        return float(low), float(high)

    return StackReport(
        width=valid.shape[1],
        height=valid.shape[0],
        slices=len(aligned[0].sweep.slices),
        valid_share=float(valid.mean()),
        depth_m=None if depth is None else span(depth.depth_m, depth.valid),
        disparity_px=None if disparity is None else span(disparity, valid),
        points=points,
        moved_px=max(float(side.moved_px.max()) for side in aligned),
        least_correlation=min(
            (float(side.correlation.min()) for side in aligned if side.correlation.size), default=1.0
        ),
        seconds=dict(clock.seconds),
    )


def _run_toml(
    report: StackReport,
    inputs: dict[str, tuple[Path, AlignedSweep]],
    geometry: dict[str, Any],
    options: StackOptions,
    rig: Path | None = None,
    weights_sha256: str = "",
) -> str:
    packages = {name: metadata.version(name) for name in _PACKAGES}
    named = {name: path.name for name, (path, _) in inputs.items()} | ({"rig": rig.name} if rig else {})
    tables: dict[str, dict[str, Any]] = {
        "versions": {"lfstereo": __version__, "python": platform.python_version()} | packages,
        "inputs": named,
        "sha256": ({"rig": _sha256(rig)} if rig else {}) | ({"weights": weights_sha256} if weights_sha256 else {}),
        "geometry": geometry,
        "summary": {k: v for k, v in report.values().items() if k != "seconds" and v is not None},
        "seconds": {name: round(seconds, 3) for name, seconds in report.seconds.items()},
    }
    for name, (path, aligned) in inputs.items():
        sweep = aligned.sweep
        tables[name] = {
            "pictures": sweep.names,
            "sha256": tuple(_sha256(path / picture) for picture in sweep.names),
            "full_size": sweep.full_size,
            "gains": tuple(round(float(g), 5) for g in aligned.gains),
            "moved_px": tuple(round(float(px), 3) for px in aligned.moved_px),
            "correlation": tuple(round(float(c), 5) for c in aligned.correlation),
            "slice_from_reference": tuple(tuple(float(v) for v in t.ravel()) for t in aligned.slice_from_reference),
        }
        if sweep.distances_m is not None:
            tables[name]["distances_m"] = tuple(float(d) for d in sweep.distances_m)
    text = ""
    for part in ("read", "align", "focus", "sweep"):
        text += f"[run.{part}]\n{to_toml(getattr(options, part))}\n"
    for name, table in tables.items():
        text += f"[{name}]\n" + "".join(f"{_key(key)} = {toml_value(value)}\n" for key, value in table.items()) + "\n"
    return text


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else toml_value(name)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
