"""Two real light fields of a row of five views each, from nine photographs taken along a rail.

Middlebury's 2001 data sets (https://vision.middlebury.edu/stereo/data/scenes2001/) hold im0.ppm to im8.ppm, equally
spaced, and the true disparity of view 2 against view 6, times 8, in disp2.pgm. Views 0 to 4 make the left light field,
views 4 to 8 the right one; their centre views 2 and 6 lie four steps apart, so a point with disparity d has slope d / 4
px per view in both. From there on it is as with two Lytro cameras: focal stacks at common disparities, then a network.

An aperture of five views would be wider than the baseline. The outer views are left out and the ones beside the centre
weighted down until the aperture is as wide as the networks' training data have at most, 0.4 of the baseline. A quarter
of a pixel means more at 20 px of disparity than at 100, so the stacks are enlarged before the network sees them.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from lfstereo.depth.baselines import fill_from_background, sgbm, sgbm_wls
from lfstereo.depth.colormap import DisparityScale, colour_disparity
from lfstereo.depth.metrics import score_disparity
from lfstereo.depth.pictures import write_png
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import render_stack, slice_disparities
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.encoding import srgb8, srgb_to_linear
from lfstereo.lightfield.field import LightField

STEPS_BETWEEN_CENTRES = 4
APERTURE_RATIO = 0.4
SLICES = 16


def read_views(folder: Path, numbers: range) -> LightField:
    """Read photographs as a light field of one row of views."""
    paths = [folder / f"im{n}.ppm" for n in numbers]
    pictures = [cv2.imread(str(path), cv2.IMREAD_COLOR) if path.is_file() else None for path in paths]
    if any(picture is None for picture in pictures):
        raise SystemExit(f"{folder}: im0.ppm to im8.ppm expected; give the folder of one of the nine-view scenes")
    views = srgb_to_linear(np.stack([picture[..., ::-1] for picture in pictures if picture is not None]))
    return LightField(views[None], weight=None, sampling=None, serial="", source=str(folder))


def aperture() -> RefocusOptions:
    """Return the disc that takes the centre view and w of its neighbours, as wide as APERTURE_RATIO baselines.

    Views at -1, 0, 1 step with weights w, 1, w have the variance 2 w / (1 + 2 w); a uniform aperture of width A
    has A^2 / 12.
    """
    variance = (APERTURE_RATIO * STEPS_BETWEEN_CENTRES) ** 2 / 12
    weight = variance / (2 - 2 * variance)
    return RefocusOptions(aperture="disc", radius_views=0.5 + weight)


def focal_stack(light_field: LightField, near_px: float, enlarge: int) -> FocalStack:
    """Render slices from ``near_px`` to 0 px of disparity, then enlarge picture and disparities."""
    focused = slice_disparities(near_px, 0.0, SLICES)
    stack = render_stack(light_field, focused, (1 / STEPS_BETWEEN_CENTRES, 0.0), APERTURE_RATIO, aperture())
    rows, columns = stack.slices.shape[1:3]
    size = (columns * enlarge, rows * enlarge)
    slices = np.stack([cv2.resize(s, size, interpolation=cv2.INTER_CUBIC) for s in stack.slices]).clip(0)
    return FocalStack(slices, focused * enlarge, stack.aperture_ratio, stack.source)


def estimate(left: LightField, right: LightField, near_px: float, enlarge: int, model: str | None) -> np.ndarray:
    """Return the network's disparity in px of the photographs."""
    from lfstereo.network.estimate import estimate_disparity, load_network

    stacks = [focal_stack(field, near_px, enlarge) for field in (left, right)]
    network = load_network() if model is None else load_network(model)
    found = estimate_disparity(*stacks, network).disparity / enlarge
    return cv2.resize(found, left.views.shape[3:1:-1], interpolation=cv2.INTER_AREA)


def main() -> None:
    """Print the errors of the network and of semi-global matching on the centre views."""
    parser = argparse.ArgumentParser(description="Depth from nine photographs along a rail.")
    parser.add_argument("folder", type=Path, help="folder with im0.ppm .. im8.ppm and disp2.pgm")
    parser.add_argument("--model", help="model name or folder; unset: the shipped one; 'none': only the baselines")
    parser.add_argument("--near", type=float, default=24.0, help="largest disparity to look for, px")
    parser.add_argument("--enlarge", type=int, default=2, help="times the stacks are enlarged for the network")
    parser.add_argument("-o", "--output", type=Path, help="write the disparity maps side by side to this PNG file")
    arguments = parser.parse_args()
    left, right = read_views(arguments.folder, range(0, 5)), read_views(arguments.folder, range(4, 9))
    coded = cv2.imread(str(arguments.folder / "disp2.pgm"), cv2.IMREAD_UNCHANGED)
    if coded is None:
        raise SystemExit(f"{arguments.folder}: disp2.pgm, the true disparity, is missing")
    truth, known = coded.astype(np.float32) / 8, coded > 0

    centres = left.views[left.centre], right.views[right.centre]
    maps = {
        "SGBM, holes filled": fill_from_background(sgbm(*centres, arguments.near)).disparity,
        "SGBM + WLS": fill_from_background(sgbm_wls(*centres, arguments.near)).disparity,
    }
    if arguments.model != "none":
        maps["lfstereo"] = estimate(left, right, arguments.near, arguments.enlarge, arguments.model)
    print(f"{arguments.folder.name:<20}{'MAE px':>9}{'bad 0.5':>9}{'bad 1':>9}{'bad 2':>9}")
    for name, disparity in maps.items():
        scores = score_disparity(disparity, truth, known)
        print(f"{name:<20}{scores.mae_px:>9.3f}{scores.bad_05:>8.1f}%{scores.bad_1:>8.1f}%{scores.bad_2:>8.1f}%")
    if arguments.output is not None:
        scale = DisparityScale(arguments.near)
        pictures = [colour_disparity(disparity, None, scale) for disparity in (truth, *maps.values())]
        write_png(arguments.output, np.hstack([srgb8(centres[0]), *pictures]), force=True)


if __name__ == "__main__":
    main()
