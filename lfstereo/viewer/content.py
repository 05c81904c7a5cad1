"""What a page shows, as plain values: pictures, disparity, geometry, figures and files.

Keys of a page's content
    ``title`` parts of the heading; ``lede`` the line below; ``made`` by what; ``size`` (V, U) of all pictures;
    ``turbo`` colours of disparity; ``pictures`` by name; ``slices`` near to far with the disparity in focus; ``views``
    with their place (s, t) in the pupil; ``disparity`` codes and valid bits; ``overlays`` that say how sure it is, with
    codes, 255 = no answer;
    ``slopes`` in focus of a single light field, px per view; ``geometry`` that turns px into metres; ``axis`` of the
    focus scale; ``slope_from_disparity`` px per view; ``record`` the tables of ``run.toml``; ``files`` beside the page;
    ``live`` what a server offers, or ``None``.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lfstereo.arrays import Bool, Float32
from lfstereo.depth.baselines import sgbm
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.samples import ViewSamples
from lfstereo.pipeline import PairResult
from lfstereo.viewer.embedding import array_text, colour_table, jpeg_uri, mask_text

PAGE_NAME = "report.html"
_SHARP_QUALITY = 95
_DISPARITY_CODES_PER_PX = 256
_OVERLAY_CODES_PER_PX = 16
_OVERLAY_FULL_PX = 8
"""Px from which on an overlay is drawn palest."""
_NO_ANSWER = 255
_UNCERTAINTY_LABEL = (
    "How far off the network expects its own disparity to be. Learnt, like the disparity: small is no proof."
)
_DOUBT_LABEL = (
    "How far a second method is away: OpenCV's semi-global matching of the two centre views. Small where both agree, "
    "which is no proof. Darkest where the second method has no answer. A comparison, not a measured uncertainty."
)
KNOWN_FILES = {
    "overview.png": "near and far slice, all-in-focus image, disparity",
    "disparity.pfm": "disparity in px, float32, inf = unknown",
    "disparity.png": "disparity, 16 bit, 256 per px, 0 = unknown",
    "disparity_colour.png": "disparity as colours, scale in px and metres",
    "depth.tiff": "depth z in metres, float32",
    "valid.png": "where depth is known",
    "all_in_focus.png": "left view, everything sharp, sRGB",
    "centre_left.png": "left centre view, rectified, sRGB",
    "centre_right.png": "right centre view, rectified, sRGB",
    "focal_stack_left": "slices near to far, 16-bit sRGB",
    "focal_stack_right": "slices near to far, 16-bit sRGB",
    "point_cloud.ply": "coloured points in metres",
    "mesh.glb": "textured surface in metres, binary glTF",
    "run.toml": "options, versions, checksums, geometry, times",
}


@dataclass(frozen=True, slots=True)
class EncodedResult:
    """The parts of a result's page that take time to make, before its figures are known."""

    parts: dict[str, Any]


def encode_result(result: PairResult) -> EncodedResult:
    """Encode pictures, disparity and the second opinion of a run."""
    found, geometry, left = result.map, result.geometry, result.left
    codes = np.rint(np.clip(found.disparity * _DISPARITY_CODES_PER_PX, 0, 65535)).astype(np.uint16)
    samples = left.samples
    parts = {
        "size": list(found.disparity.shape),
        "turbo": colour_table(),
        "pictures": {
            "sharp": jpeg_uri(srgb8(found.all_in_focus), _SHARP_QUALITY),
            "centre_left": jpeg_uri(srgb8(left.centre_view)),
            "centre_right": jpeg_uri(srgb8(result.right.centre_view)),
        },
        "slices": _slices(left.stack),
        **encode_views(samples),
        "disparity": {
            "values": array_text(codes),
            "px_per_code": 1 / _DISPARITY_CODES_PER_PX,
            "valid": mask_text(found.valid),
        },
        "overlays": _overlays(result),
        "slopes": None,
        "geometry": {
            "focal_px": geometry.focal_px,
            "baseline_m": geometry.baseline_m,
            "doffs_px": geometry.doffs_px,
            "principal_px": list(geometry.left.principal_px),
        },
        "axis": {
            "near": float(left.stack.disparities_px[0]),
            "far": float(left.stack.disparities_px[-1]),
            "unit": "px",
            "metric": True,
        },
        "slope_from_disparity": list(left.slope_from_disparity),
    }
    return EncodedResult(parts)


def encode_views(samples: ViewSamples | None) -> dict[str, Any]:
    """Return the keys of a page that hold its views; none where there are no samples."""
    if samples is None:
        return {"views": [], "view_step": 1, "views_in_all": 0}
    views = [
        {"s": s, "t": t, "picture": jpeg_uri(picture)}
        for (s, t), picture in zip(samples.places, samples.pictures, strict=True)
    ]
    return {"views": views, "view_step": samples.step, "views_in_all": samples.views_in_all}


def result_content(encoded: EncodedResult, run_toml: str, folder: Path) -> dict[str, Any]:
    """Return the content of a result's page.

    Parameters
    ----------
    encoded
        From :func:`encode_result`.
    run_toml
        The text of the folder's ``run.toml``.
    folder
        The folder that holds the page; the files in it are listed.
    """
    record = tomllib.loads(run_toml)
    summary = record["summary"]
    near, far = summary["depth_m"]
    lede = (
        f"{summary['width']} × {summary['height']} px, {near:.2f} to {far:.2f} m from the camera, "
        f"{100 * summary['valid_share']:.0f} % of the picture valid."
    )
    return encoded.parts | {
        "title": [record["inputs"]["left"], record["inputs"]["right"]],
        "lede": lede,
        "made": f"lfstereo {record['versions']['lfstereo']} · {record['run']['model']}",
        "record": record,
        "files": list_files(folder),
        "live": None,
    }


def list_files(folder: Path) -> list[dict[str, Any]]:
    """Return name, address beside the page, meaning and size of the files in a result folder."""
    order = list(KNOWN_FILES)
    found = sorted(
        (path for path in folder.iterdir() if path.name != PAGE_NAME and not path.name.startswith(".")),
        key=lambda path: (order.index(path.name) if path.name in order else len(order), path.name),
    )
    return [
        {
            "name": path.name + ("/" if path.is_dir() else ""),
            "href": path.name + ("/" if path.is_dir() else ""),
            "about": KNOWN_FILES.get(path.name, ""),
            "bytes": sum(p.stat().st_size for p in path.rglob("*")) if path.is_dir() else path.stat().st_size,
        }
        for path in found
    ]


def _slices(stack: FocalStack) -> list[dict[str, Any]]:
    return [
        {"disparity": float(disparity), "picture": jpeg_uri(srgb8(picture))}
        for disparity, picture in zip(stack.disparities_px, stack.slices, strict=True)
    ]


def _overlays(result: PairResult) -> list[dict[str, Any]]:
    """Return what tells how sure the disparity is: the network's own word, where it has one, and a second method."""
    found, uncertainty = result.map, result.map.uncertainty_px
    overlays = []
    if uncertainty is not None:
        overlays.append(_overlay("uncertainty", "Uncertainty", _UNCERTAINTY_LABEL, uncertainty, found.valid))
    views = result.left.centre_view, result.right.centre_view
    other = sgbm(*views, result.geometry.disparity_max_px)
    away: Float32 = np.abs(found.disparity - other.disparity)
    overlays.append(_overlay("doubt", "Second method", _DOUBT_LABEL, away, other.valid))
    return overlays


def _overlay(name: str, title: str, label: str, px: Float32, answered: Bool) -> dict[str, Any]:
    codes = np.clip(np.rint(px * np.float32(_OVERLAY_CODES_PER_PX)), 0, _NO_ANSWER - 1)
    return {
        "id": name,
        "name": title,
        "label": label,
        "values": array_text(np.where(answered, codes, _NO_ANSWER).astype(np.uint8)),
        "px_per_code": 1 / _OVERLAY_CODES_PER_PX,
        "full_px": _OVERLAY_FULL_PX,
    }
