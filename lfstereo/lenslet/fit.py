"""Fit the lattice of micro-image centres to a white image, or to the photograph itself."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64
from lfstereo.container.capture import Capture
from lfstereo.errors import GridFitError, ShapeError
from lfstereo.lenslet.centres import measure_centres
from lfstereo.lenslet.flatten import flatten, mean_brightness
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice, to_grid
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.profile import mean_micro_image
from lfstereo.lenslet.smooth_field import fit_smooth_field
from lfstereo.lenslet.spectrum import coarse_frequencies, lattice_from_phases
from lfstereo.lenslet.uncertainty import lattice_uncertainty
from lfstereo.progress import Progress, silent

_LEAST_SIDE_PITCHES = 12
_FIT_RADIUS_PITCHES = 0.58
_LEAST_EXPOSED = 0.1
"""Where fewer micro-images than this share are well exposed, all are used."""
_CENTRES_PER_ROUND = 25_000
"""The last round measures all centres."""
_CONVERGED_PX = 0.003
_LEAST_CENTRES = 30
_AGREEMENT_PITCHES = 0.05
"""A lenslet agrees with the lattice when its measured centre lies this close, in pitches."""


def fit_grid(white: Capture, options: GridOptions = GridOptions(), progress: Progress = silent) -> LensletGrid:
    """Fit the lenslet grid to a white image.

    Parameters
    ----------
    white
        Raw frame of an evenly lit surface.
    options
        Rounds and limits.
    progress
        Told of each round.

    Returns
    -------
    The grid, with the robust RMS of the measured centres (px) and the share of lenslets that agree.

    Raises
    ------
    GridFitError
        If the frame is no white image, shows no hexagonal pattern, or too few lenslets agree.
    ShapeError
        If the frame is smaller than a dozen lenslets.
    """
    brightness = mean_brightness(white)
    if brightness < options.least_brightness:
        raise GridFitError(
            f"{white.source}: found a mean brightness of {brightness:.3f} of full scale, a white image has at least "
            f"{options.least_brightness:g}; is it a dark frame?"
        )
    fit = _fit(white, options, options.white_shading_per_px, progress)
    unevenness = _unevenness(white, fit.lattice)
    if unevenness > options.largest_unevenness:
        raise GridFitError(
            f"{white.source}: brightness differs by {100 * unevenness:.0f} % between neighbouring lenslets, a white "
            f"image stays below {100 * options.largest_unevenness:.0f} %; give the frame of an evenly lit white surface"
        )
    return _trusted_grid(white, fit, options, options.least_quality, "white image")


def estimate_grid_from_photograph(
    photograph: Capture, options: GridOptions = GridOptions(), progress: Progress = silent
) -> LensletGrid:
    """Fit the lenslet grid to a photograph, for want of a white image.

    The dark gaps between micro-images give the lattice; the brightness of the scene drops out because every
    Bayer site is divided by its local mean and every lenslet has a shading term of its own.

    Parameters
    ----------
    photograph
        Raw frame of any scene that is not dark all over.
    options
        Rounds; only half the share of agreeing lenslets is asked of a photograph.
    progress
        Told of each round.

    Raises
    ------
    GridFitError
        If the frame shows no hexagonal pattern, or too few lenslets agree.
    ShapeError
        If the frame is smaller than a dozen lenslets.
    """
    fit = _fit(photograph, options, options.photograph_shading_per_px, progress)
    return _trusted_grid(photograph, fit, options, 0.5 * options.least_quality, "photograph")


@dataclass(frozen=True, slots=True)
class _Fit:
    """A lattice and the centres that it was fitted to."""

    lattice: Lattice
    index: Float64
    """``(N, 2)`` lattice coordinates of the measured centres."""
    measured: Float64
    """``(N, 2)`` (x, y) px."""
    weight: Float64
    """``(N,)`` confidence of each; 0 for those that the lattice was not fitted to."""
    residual_px: float
    quality: float

    def left_over(self) -> Float64:
        """Return ``(N, 2)`` (x, y) px from the lattice to the measured centres."""
        return np.asarray(self.measured - self.lattice.origin - self.index @ self.lattice.matrix.T, np.float64)

    def robust_weight(self) -> Float64:
        """Return ``(N,)`` the weight that each centre has in the fit in the end."""
        spread = max(self.residual_px / np.sqrt(2), 1e-6)
        weight: Float64 = self.weight / (1 + (np.hypot(*self.left_over().T) / (3 * spread)) ** 2) ** 2
        return weight


def _trusted_grid(capture: Capture, fit: _Fit, options: GridOptions, least_quality: float, source: str) -> LensletGrid:
    """Return the grid of a fit, unless too few lenslets agree or it is not known well enough."""
    where = capture.source
    if not fit.quality >= least_quality:
        raise GridFitError(
            f"{where}: only {100 * fit.quality:.0f} % of {len(fit.index)} lenslets agree with one regular grid, "
            f"expected at least {100 * least_quality:.0f} %; the frame is damaged, dark or not from a lenslet camera"
        )
    shape = int(capture.mosaic.shape[0]), int(capture.mosaic.shape[1])
    weight = fit.robust_weight()
    used = weight > 0
    uncertainty = lattice_uncertainty(fit.lattice, fit.index[used], fit.measured[used], weight[used], shape)
    if uncertainty > options.largest_uncertainty_px:
        raise GridFitError(
            f"{where}: the lenslet grid is known to {uncertainty:.2f} px only, expected "
            f"{options.largest_uncertainty_px:g} px or better; give a white image, or a better lit picture"
        )
    field = None
    if options.field_degree:
        places = fit.measured[used]
        field, _ = fit_smooth_field(places, fit.left_over()[used], weight[used], options.field_degree, shape)
    nominal = _nominal_pitch(capture)
    return to_grid(fit.lattice, shape, nominal, fit.residual_px, fit.quality, source, uncertainty, field)


def _fit(capture: Capture, options: GridOptions, shading_per_px: float, progress: Progress) -> _Fit:
    nominal = _nominal_pitch(capture)
    side = min(capture.mosaic.shape)
    if capture.mosaic.ndim != 2 or side < _LEAST_SIDE_PITCHES * np.clip(nominal, 6, 20):
        raise ShapeError(
            f"{capture.source}: found a frame of shape {capture.mosaic.shape}, expected (height, width) of at least "
            f"{_LEAST_SIDE_PITCHES} lenslets; give a whole raw frame"
        )
    steps = options.passes + 3
    flat = flatten(capture, float(np.clip(nominal, 6, 40)))
    progress(1, steps)
    lattice = lattice_from_phases(flat, coarse_frequencies(flat, capture.source))
    exposed = _well_exposed(capture, lattice.pitch)
    progress(2, steps)
    for n in range(options.passes):
        before = lattice
        lattice = _improve(flat, exposed, lattice, options, shading_per_px, _CENTRES_PER_ROUND).lattice
        progress(3 + n, steps)
        if _largest_move(before, lattice, flat.shape) < _CONVERGED_PX:
            break
    found = _improve(flat, exposed, lattice, options, shading_per_px, flat.size)
    progress(steps, steps)
    return found


def _largest_move(before: Lattice, after: Lattice, shape: tuple[int, ...]) -> float:
    """Return by how many px a lattice moved, at most, in the corners of a frame."""
    height, width = shape
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], np.float64)
    index = (corners - before.origin) @ before.reciprocal.T
    moved = after.origin + index @ after.matrix.T - corners
    return float(np.hypot(*moved.T).max())


def _well_exposed(capture: Capture, pitch: float) -> Bool:
    """Return ``(H, W)``: True where a micro-image around the pixel is neither clipped nor dark."""
    meta = capture.metadata
    black, white = float(np.mean(meta.black)), float(np.mean(meta.white))
    size = 2 * round(0.5 * pitch) + 1
    clipped = cv2.dilate((capture.mosaic >= black + 0.97 * (white - black)).astype(np.uint8), np.ones((size, size)))
    mean = cv2.blur(capture.mosaic.astype(np.float32), (size, size))
    return np.asarray((clipped == 0) & (mean > black + 0.01 * (white - black)), np.bool_)


def _improve(
    flat: Float32, exposed: Bool, lattice: Lattice, options: GridOptions, shading_per_px: float, most: int
) -> _Fit:
    """Measure up to ``most`` centres and fit the lattice anew."""
    radius = _FIT_RADIUS_PITCHES * lattice.pitch
    height, width = flat.shape
    index = lattice.indices_inside((height, width), radius + 2)
    expected = lattice.origin + index @ lattice.matrix.T
    spots = np.round(expected).astype(np.int64)
    lit = exposed[spots[:, 1], spots[:, 0]]
    if lit.mean() > _LEAST_EXPOSED:
        index, expected = index[lit], expected[lit]
    stride = max(1, len(index) // most)
    index, expected = index[::stride], expected[::stride]
    micro_image = mean_micro_image(flat, lattice, share=options.template_share)
    centres = measure_centres(flat, expected, micro_image, radius, shading_per_px)
    measured = expected + centres.displacement
    middle = np.array([width - 1, height - 1]) / 2
    field = np.hypot(*(expected - middle).T) / np.hypot(*middle)
    usable = (np.hypot(*centres.displacement.T) < 0.35 * lattice.pitch) & (field < options.trusted_field)
    weight = np.where(usable, 1 / np.maximum(centres.misfit, 1e-3) ** 2, 0)
    if usable.sum() < _LEAST_CENTRES:
        return _Fit(lattice, index, measured, weight, residual_px=float("inf"), quality=0.0)
    fitted, residual = robust_affine(index[usable], measured[usable], weight[usable])
    distance = np.hypot(*(measured - fitted.origin - index @ fitted.matrix.T).T)
    agree = distance < _AGREEMENT_PITCHES * lattice.pitch
    return _Fit(fitted, index, measured, weight, residual, float(agree.mean()))


def robust_affine(index: Float64, points: Float64, weight: Float64) -> tuple[Lattice, float]:
    """Fit a lattice to numbered points by reweighted least squares with Geman-McClure weights.

    Parameters
    ----------
    index
        ``(N, 2)`` whole lattice coordinates.
    points
        ``(N, 2)`` measured positions, px.
    weight
        ``(N,)`` confidence of each point, any scale.

    Returns
    -------
    The lattice and the robust RMS distance of the points to it, px.
    """
    middle = index.mean(0)
    design = np.column_stack([np.ones(len(index)), index - middle])
    weight = weight / weight.mean()
    robust = weight
    spread = 0.0
    for _ in range(12):
        normal = design.T @ (design * robust[:, None])
        solved = np.linalg.solve(normal, design.T @ (points * robust[:, None]))
        distance = np.hypot(*(points - design @ solved).T)
        # The median of a Rayleigh distribution is 1.1774 sigma, its RMS sqrt(2) sigma.
        spread = max(float(np.median(distance)) / 1.1774, 1e-6)
        robust = weight / (1 + (distance / (3 * spread)) ** 2) ** 2
    origin = solved[0] - middle @ solved[1:]
    return Lattice(origin=origin, row=solved[1].copy(), diagonal=solved[2].copy()), float(np.sqrt(2) * spread)


def _unevenness(white: Capture, lattice: Lattice) -> float:
    """Return the median relative brightness change from a lenslet to the second next one of its row."""
    height, width = white.mosaic.shape
    index = lattice.indices_inside((height, width), 0.6 * lattice.pitch + 3)
    spots = np.round(lattice.origin + index @ lattice.matrix.T).astype(np.int64)
    # The same site parity everywhere, so that colours do not count as brightness: mean over a 2 x 2 cell, twice.
    x, y = spots[:, 0], spots[:, 1]
    black = float(np.mean(white.metadata.black))
    level = np.zeros(len(index))
    for dy in range(-2, 2):
        for dx in range(-2, 2):
            level += white.mosaic[y + dy, x + dx] / 16
    level -= black
    order = np.lexsort((index[:, 0], index[:, 1]))
    level, row = np.maximum(level[order], 1.0), index[order, 1]
    same = row[2:] == row[:-2]
    change = np.abs(level[2:] - level[:-2]) / np.maximum(level[2:], level[:-2])
    return float(np.median(change[same]))


def _nominal_pitch(capture: Capture) -> float:
    return capture.metadata.lenslets.pitch_m / capture.metadata.pixel_pitch_m
