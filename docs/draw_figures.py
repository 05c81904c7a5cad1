"""Draw the figures of the guide from the formulas of ``lfstereo.conventions`` and the shipped rig: four SVG files.

python docs/draw_figures.py [-o docs/figures]

README's picture is that of a demo: python docs/draw_figures.py --overview DEMO/
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from lfstereo.assets import asset_folder
from lfstereo.conventions import depth_from_disparity
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import read_rig

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" '
    'font-family="sans-serif" font-size="13"><rect width="{w}" height="{h}" fill="white"/>'
)
_JPEG_QUALITY = 85
RIG = asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml"


def main() -> None:
    """Write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "figures")
    parser.add_argument("--overview", type=Path, metavar="DEMO", help="make README's picture, from a demo's folder")
    arguments = parser.parse_args()
    output: Path = arguments.output
    output.mkdir(parents=True, exist_ok=True)
    if arguments.overview:
        overview = np.asarray(cv2.imread(str(arguments.overview / "result" / "overview.png")))
        cv2.imwrite(str(output.parent / "overview.jpg"), overview, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    for name, draw in _FIGURES.items():
        (output / f"{name}.svg").write_text(draw() + "</svg>\n", "utf-8")


def views() -> str:
    """Draw the 15 x 15 views over the aperture, and the axes of one of them."""
    parts = [HEAD.format(w=600, h=270)]
    for t in range(15):
        for s in range(15):
            centre = t == 7 and s == 7
            shade = "#c03030" if centre else "#4878a8" if np.hypot(s - 7, t - 7) <= 7.2 else "#d8e0e8"
            parts.append(f'<rect x="{40 + 13 * s}" y="{45 + 13 * t}" width="11" height="11" fill="{shade}"/>')
    parts += [
        text(40, 20, "views[t, s]: where in the aperture"),
        text(40, 38, "s to the right"),
        text(14, 150, "t", "#333"),
        text(300, 20, "views[t, s, v, u]: one picture, px"),
        '<rect x="320" y="45" width="250" height="174" fill="#eef2f6" stroke="#4878a8"/>',
        text(320, 38, "u = x, to the right"),
        text(304, 140, "v"),
        text(300, 240, "v = y, downwards; pixel (0, 0) is the top left one"),
        text(40, 262, "red: centre view (7, 7); pale: outside the micro-image"),
    ]
    return "".join(parts)


def slope() -> str:
    """Draw how a near, a middle and a far point move from view to view."""
    parts = [HEAD.format(w=600, h=250), text(40, 20, "an epipolar-plane image: row of pixels x against view s")]
    for sigma, x0, colour, label in (
        (0.35, 150, "#c03030", "near"),
        (0, 300, "#333", "zero"),
        (-0.25, 450, "#4878a8", "far"),
    ):
        ends = [(x0 - 12 * sigma * (s - 7), 40 + 12 * s) for s in (0, 14)]
        (x1, y1), (x2, y2) = ends
        parts.append(f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="5"/>')
        parts.append(text(x0 - 45, 228, f"{label}: slope {sigma:+.2f}", colour))
    parts.append(text(40, 246, "x(s) = x(s0) - slope * (s - s0); one px of shift is drawn as large as one step of s"))
    return "".join(parts)


def disparity_depth() -> str:
    """Draw depth over disparity for the shipped rig."""
    geometry = rectified_geometry(read_rig(RIG))
    disparity = np.linspace(0, 100, 101)
    depth = [
        depth_from_disparity(float(d), geometry.focal_px, geometry.baseline_m, geometry.doffs_px) for d in disparity
    ]
    top = 1.1 * max(depth)
    points = " ".join(f"{60 + 5 * d:.1f},{220 - 190 * z / top:.1f}" for d, z in zip(disparity, depth, strict=True))
    parts = [HEAD.format(w=600, h=270), f'<polyline points="{points}" fill="none" stroke="#c03030" stroke-width="3"/>']
    parts.append('<path d="M60 20 V220 H570" fill="none" stroke="#333"/>')
    parts += [text(50 + 5 * d, 238, str(d)) for d in range(0, 101, 20)]
    ticks = np.arange(0, top, 0.2)
    parts += [text(28, 224 - 190 * z / top, f"{z:.1f}") for z in ticks]
    parts.append(
        text(
            70,
            30,
            f"z = f B / (d + doffs), f = {geometry.focal_px:.0f} px, B = {1e3 * geometry.baseline_m:.1f} mm, "
            f"doffs = {geometry.doffs_px:.1f} px",
        )
    )
    parts += [text(230, 260, "disparity d, px"), text(4, 14, "z, m")]
    return "".join(parts)


def rig_from_above() -> str:
    """Draw the two cameras of the shipped rig, their fields of view and the working range, seen from above."""
    rig = read_rig(RIG)
    scale, left, foot = 330.0, 180.0, 465.0
    reach = 1.06 * rig.far_m

    def place(point: np.ndarray) -> str:
        return f"{left + scale * point[0]:.1f},{foot - scale * point[2]:.1f}"

    parts = [HEAD.format(w=600, h=520), text(20, 22, "the rig from above, to scale")]
    for z, name in ((rig.near_m, "near"), (rig.far_m, "far")):
        y = foot - scale * z
        parts.append(f'<path d="M40 {y:.1f} H560" stroke="#999" stroke-dasharray="3 4"/>')
        parts.append(text(470, y - 6, f"{name}_m = {z:.2f}"))
    turns = (np.eye(3), rig.right_from_left)
    centres = (np.zeros(3), rig.right_centre_m)
    colours = ("#4878a8", "#c03030")
    for camera, turn, centre, colour in zip((rig.left, rig.right), turns, centres, colours, strict=True):
        across = [((x - camera.principal_px[0]) / camera.focal_px[0], 0.0, 1.0) for x in (0, camera.sensor_px[0])]
        rays = [centre + reach * np.asarray(ray) @ turn for ray in across]
        ahead = centre + 0.35 * np.array([0.0, 0.0, 1.0]) @ turn
        parts.append(
            f'<polygon points="{place(centre)} {place(rays[0])} {place(rays[1])}" fill="{colour}" fill-opacity="0.12" '
            f'stroke="{colour}"/>'
        )
        ends = f"{place(centre)} {place(ahead)}"
        parts.append(f'<polyline points="{ends}" stroke="{colour}" stroke-width="2.5" fill="none"/>')
        cx, cy = place(centre).split(",")
        parts.append(f'<circle cx="{cx}" cy="{cy}" r="4" fill="{colour}"/>')
    turned = np.degrees(np.linalg.norm(rig.rotation_rad))
    parts += [
        text(left - 60, foot + 24, "left", colours[0]),
        text(left + scale * rig.baseline_m + 14, foot + 24, "right", colours[1]),
        text(
            20,
            508,
            f"baseline_m = {rig.baseline_m:.3f}; the right camera turned in by {turned:.1f} degrees",
        ),
    ]
    return "".join(parts)


def text(x: float, y: float, words: str, colour: str = "#333") -> str:
    """Return a line of text."""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{words}</text>'


_FIGURES = {"views": views, "slope": slope, "disparity_depth": disparity_depth, "rig": rig_from_above}

if __name__ == "__main__":
    main()
