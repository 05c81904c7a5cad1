"""Lenslet grids of real cameras against published centres; what is left is drawn.

Run ``python benchmarks/bench_real_grid.py FOLDER -o OUT/`` with the folder ``tao_f01`` of tests/DATA.md.

The Illum's list (``illum_cords.mat``) mixes measured centres with others that lie on a computed lattice; the measured
ones are fitted alone. The F01's (``image_cords.mat``) are rounded to whole px, so that even the true grid would be
0.408 px off (0.289 px in x and in y); the best lattice for the list itself is the fair comparison.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from scipy.io import loadmat

from lfstereo.arrays import Float64
from lfstereo.container.mosaic_image import read_mosaic_image
from lfstereo.lenslet.fit import estimate_grid_from_photograph
from lfstereo.lenslet.given import computed_centres, fit_given_centres, neighbour_correlation
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.residual import GridResidual, draw_residual

ILLUM, F01 = (5368, 7728), (3280, 3280)
DEGREES = (0, 2, 4)
SURE_PX = 3.5


def distances(grid: LensletGrid, points: Float64) -> Float64:
    """Return ``(N, 2)`` px from the nearest lattice point of a grid to each point."""
    lattice = Lattice.of(grid)
    index = (points - lattice.origin) @ lattice.reciprocal.T
    return np.asarray((index - np.round(index)) @ lattice.matrix.T, np.float64)


def rms(apart: Float64) -> str:
    """Return the RMS distance, and the RMS of a single coordinate, px."""
    return f"{np.sqrt((apart**2).sum(1).mean()):.4f} px ({np.sqrt((apart**2).mean()):.4f} px per coordinate)"


def draw(residual: GridResidual, grid: LensletGrid, path: Path) -> None:
    """Write the map of a residual."""
    cv2.imwrite(str(path), draw_residual(residual, grid)[..., ::-1])
    print(f"    drawn: {path}")


def illum(folder: Path, out: Path) -> None:
    """Explain the Illum's list down to its noise."""
    points = np.asarray(loadmat(folder / "illum_cords.mat")["lensletLocs"], np.float64) - 1
    computed = computed_centres(points)
    print(f"Illum: {len(points)} centres, {computed.mean():.1%} of them on a computed lattice")
    model, _ = fit_given_centres(points[computed], ILLUM)
    # Measured centres are listed up to 5 px from the computed lattice; what the noise carried beyond was dropped,
    # which pulls the mean of those that are left. Farther inside nothing was.
    from_model = np.hypot(*distances(model, points[~computed]).T)
    print(f"    measured ones lie up to {from_model.max():.2f} px from the computed lattice")
    inside = points[~computed][from_model < SURE_PX]
    for name, given in (("all measured", points[~computed]), (f"nearer than {SURE_PX:g} px", inside)):
        for degree in DEGREES:
            grid, residual = fit_given_centres(given, ILLUM, degree)
            noise = residual.displacement[residual.found].std(axis=0)
            both = neighbour_correlation(residual, grid)
            print(
                f"    {name} ({len(given)}), degree {degree}: left {noise[0]:.3f} px in x, {noise[1]:.3f} px "
                f"in y; neighbours correlate {both[0]:.2f}, {both[1]:.2f}; {residual.found.mean():.1%} agree"
            )
            draw(residual, grid, out / f"illum_{'all' if given is not inside else 'inside'}_degree_{degree}.png")
    (ux, uy), uncertainty = grid.step_u_px, grid.uncertainty_px
    print(f"    pitch {np.hypot(ux, uy):.4f} px, turned by {1e3 * uy / ux:.3f} mrad, known to {uncertainty:.3f} px")


def f01(folder: Path, out: Path) -> None:
    """Compare grids of photographs alone with the F01's list."""
    stored = loadmat(folder / "image_cords.mat")["image_cords"].reshape(-1, 2)[:, ::-1].astype(np.float64) - 1
    best, residual = fit_given_centres(stored, F01)
    print(f"F01: {len(stored)} centres; the best lattice for them leaves {rms(distances(best, stored))}")
    draw(residual, best, out / "f01_centres.png")
    for path in sorted(folder.glob("IMG_*.jpg")):
        grid = estimate_grid_from_photograph(read_mosaic_image(path, "lytro-f01"))
        lattice = Lattice.of(best)
        points = lattice.origin + lattice.indices_inside(F01, 100) @ lattice.matrix.T
        print(f"    {path.name}: {rms(distances(grid, stored))}; from the best lattice {rms(distances(grid, points))}")


def main() -> None:
    """Print the figures and write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    illum(arguments.folder, arguments.output)
    f01(arguments.folder, arguments.output)


if __name__ == "__main__":
    main()
