"""The lenslet grid against lattices that are known."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from lfstereo.container import Capture
from lfstereo.container.mosaic_image import read_mosaic_image
from lfstereo.container.packing import unpack
from lfstereo.errors import GridFitError, ShapeError
from lfstereo.lenslet.fit import estimate_grid_from_photograph, fit_grid, robust_affine
from lfstereo.lenslet.options import GridOptions

WHITE_RMS_PX = 0.01
"""Known lattice, 1 DN noise, about 1000 lenslets."""
SHADED_RMS_PX = 0.03
PHOTOGRAPH_RMS_PX = 0.06
REAL_RMS_PX = 0.5
"""Against centres rounded to whole px, which are 0.44 px from any lattice themselves."""


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt((errors**2).sum(1).mean()))


def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * np.sin(x / 19 + 0.3) * np.cos(y / 23) + 0.2 * np.sin((x + 2 * y) / 41)


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"rotation": -0.3, "pitch": 14.9},
        {"rotation": 0.45, "pitch": 9.93},
        {"rotation": 0.0, "pitch": 14.2857, "origin": (0.0, 0.0)},
        {"rotation": -5e-4, "pitch": 21.7},
        {"bayer": "bggr", "pitch": 9.93, "rotation": -4.9e-3},
    ],
    ids=str,
)
def test_known_lattice_is_recovered(draw_frame: Callable[..., Any], given: dict[str, Any]) -> None:
    frame = draw_frame(**given)
    grid = fit_grid(frame.capture)
    assert rms(frame.lattice_error(grid.centres())) < WHITE_RMS_PX
    assert grid.residual_px < 0.05
    assert grid.quality > 0.99
    assert grid.source == "white image"


def test_shading_across_the_micro_images_does_not_move_the_grid(draw_frame: Callable[..., Any]) -> None:
    # The centroid of a disc of radius r with relative slope g moves by g r^2 / 4 = 0.27 px in the corners here.
    frame = draw_frame(shading=0.025)
    assert rms(frame.lattice_error(fit_grid(frame.capture).centres())) < SHADED_RMS_PX


def test_grid_of_a_photograph(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame(scene=texture, parallax=3.0, colour=(0.4, 0.7, 0.5))
    grid = estimate_grid_from_photograph(frame.capture)
    assert rms(frame.lattice_error(grid.centres())) < PHOTOGRAPH_RMS_PX
    assert grid.source == "photograph"


def test_wrong_pitch_in_the_metadata_does_no_harm(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame()
    lenslets = replace(frame.capture.metadata.lenslets, pitch_m=1.3e-5, rotation_rad=0.1)
    capture = replace(frame.capture, metadata=replace(frame.capture.metadata, lenslets=lenslets))
    grid = fit_grid(capture)
    assert rms(frame.lattice_error(grid.centres())) < WHITE_RMS_PX
    assert grid.columns == round(440 / 14.3)


def test_residual_tells_how_far_single_centres_lie_off() -> None:
    rng = np.random.default_rng(1)
    j, i = np.mgrid[:60, :60].astype(float)
    index = np.stack([i.ravel(), j.ravel()], axis=1)
    points = index @ np.array([[14.3, 0.02], [7.1, 12.4]]) + (3.0, 4.0) + rng.normal(0, 0.1, (3600, 2))
    points[::7] += rng.normal(0, 5, points[::7].shape)
    lattice, residual = robust_affine(index, points, np.ones(3600))
    # Two axes of 0.1 px noise make 0.141 px; the outliers widen the median by about a tenth.
    assert residual == pytest.approx(0.141 * 1.1, rel=0.12)
    assert np.hypot(*(lattice.origin - (3.0, 4.0))) < 0.02
    assert np.abs(lattice.row - (14.3, 0.02)).max() < 5e-4


def test_photograph_is_refused_as_white_image(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame(scene=lambda x, y: 0.5 + 0.45 * np.sign(np.sin(x / 11) * np.sin(y / 13)))
    with pytest.raises(GridFitError, match="between neighbouring lenslets, a white image stays below"):
        fit_grid(frame.capture)


def test_dark_frame_is_refused(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame(peak=4.0)
    with pytest.raises(GridFitError, match=r"mean brightness of 0\.00\d .* is it a dark frame\?"):
        fit_grid(frame.capture)


@pytest.mark.parametrize("kind", ["noise", "flat"])
def test_frame_without_lenslets_is_refused(draw_frame: Callable[..., Any], kind: str) -> None:
    capture = draw_frame().capture
    spread = 100 if kind == "noise" else 0
    values = 500 + np.random.default_rng(0).integers(-spread, spread + 1, capture.mosaic.shape)
    with pytest.raises(GridFitError, match="no hexagonal lenslet pattern"):
        fit_grid(replace(capture, mosaic=values.astype(np.uint16)))


def test_frame_whose_lenslets_disagree_is_refused(draw_frame: Callable[..., Any]) -> None:
    capture = draw_frame().capture
    mosaic = capture.mosaic.copy()
    # Bands slipped against each other, as after lost data: no single lattice fits them.
    for n, top in enumerate(range(0, 400, 40)):
        mosaic[top : top + 40] = np.roll(mosaic[top : top + 40], 2 * ((5 * n) % 7), axis=1)
    with pytest.raises(GridFitError, match="agree with one regular grid"):
        fit_grid(replace(capture, mosaic=mosaic), GridOptions(least_quality=0.9))


def test_frame_of_a_few_lenslets_is_refused(draw_frame: Callable[..., Any]) -> None:
    with pytest.raises(ShapeError, match=r"expected .* of at least 12 lenslets"):
        fit_grid(draw_frame(shape=(120, 300)).capture)


def test_better_than_the_toolbox_on_its_reference(real_data: Path, draw_frame: Callable[..., Any]) -> None:
    folder = real_data / "lftoolbox_reference" / "crop600"
    true = json.loads((folder / "true_grid.json").read_text())
    cos, sin = np.cos(true["Rot"]), np.sin(true["Rot"])
    turn = np.array([[cos, -sin], [sin, cos]])
    like = draw_frame(shape=(600, 600))
    frame = replace(
        like,
        origin=np.array([true["HOffset"] - 1, true["VOffset"] - 1]),
        row=turn @ [true["HSpacing"], 0],
        diagonal=turn @ [true["HSpacing"] / 2, true["VSpacing"]],
    )
    for name, fit, largest in (("white", fit_grid, 0.003), ("lenslet", estimate_grid_from_photograph, 0.03)):
        data = (folder / f"{name}.raw").read_bytes()
        capture = Capture(unpack(data, 600, 600, 10, "little", name), like.capture.metadata, name)
        # The toolbox's own fit of the white image is 0.070 px off.
        assert rms(frame.lattice_error(fit(capture).centres())) < largest


@pytest.mark.parametrize("number", [1, 2, 3])
def test_real_photographs_without_white_image(real_data: Path, number: int) -> None:
    folder = real_data / "raw" / "tao_f01"
    capture = read_mosaic_image(folder / f"IMG_{number}.jpg", "lytro-f01")
    grid = estimate_grid_from_photograph(capture)
    # (row, column), 1-based, rounded to whole px.
    stored = loadmat(folder / "image_cords.mat")["image_cords"].reshape(-1, 2)[:, ::-1].astype(float) - 1
    stored = stored[(stored.min(1) > 8) & (stored.max(1) < 3270)]
    row, step_v = np.array(grid.step_u_px), np.array(grid.step_v_px)
    basis = np.stack([row, step_v + row / 2], axis=1)
    origin = np.array(grid.origin_px) + (0.5 * row if grid.first_shifted_row == 0 else 0)
    index = (stored - origin) @ np.linalg.inv(basis).T
    assert rms((index - np.round(index)) @ basis.T) < REAL_RMS_PX
    assert (grid.rows, grid.columns) == (382, 330)
    assert np.hypot(*row) == pytest.approx(9.93, abs=0.01)
    assert np.arctan2(row[1], row[0]) == pytest.approx(-4.91e-3, abs=5e-5)


def test_bent_lattice_needs_the_smooth_field(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame(shape=(500, 560))
    y, x = np.mgrid[:500, :560].astype(np.float32)
    # Every micro-image moves by up to 0.5 px, most in the corners of the frame.
    bend = 0.5 * ((x / 280 - 1) ** 2).astype(np.float32)
    green = replace(frame.capture.metadata, normalized_responses=(1.0, 1.0, 1.0, 1.0))
    grey = draw_frame(shape=(500, 560), colour=(1.0, 1.0, 1.0)).capture.mosaic
    moved = cv2.remap(grey.astype(np.float32), x - bend, y, cv2.INTER_CUBIC)
    capture = replace(frame.capture, mosaic=np.round(moved).astype(np.uint16), metadata=green)
    inner = np.s_[2:-2, 2:-2]

    def error(options: GridOptions) -> float:
        centres = fit_grid(capture, options).centres()[inner].reshape(-1, 2)
        true_shift = np.stack([0.5 * (centres[:, 0] / 280 - 1) ** 2, np.zeros(len(centres))], axis=1)
        return rms(frame.lattice_error(centres - true_shift))

    everywhere = GridOptions(trusted_field=1.0)
    assert error(everywhere) > 0.1
    # Displacements are measured to first order, a tenth of them remains.
    assert error(replace(everywhere, field_degree=2)) < 0.05


def test_grid_that_is_not_known_well_is_refused(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame()
    assert 0 < (fit_grid(frame.capture).uncertainty_px or 0) < WHITE_RMS_PX
    with pytest.raises(GridFitError, match=r"known to 0\.00 px only, expected 1e-05 px or better"):
        fit_grid(frame.capture, GridOptions(largest_uncertainty_px=1e-5))


def test_micro_images_cut_off_centre_towards_the_corners_do_not_move_the_grid(draw_frame: Callable[..., Any]) -> None:
    frame = draw_frame(shape=(700, 760))
    y, x = np.mgrid[:700, :760].astype(np.float64)
    from_lenslet = frame.lattice_error(np.stack([x, y], axis=-1)).reshape(700, 760, 2)
    from_middle = np.stack([x - 379.5, y - 349.5], axis=-1) - from_lenslet
    # A second disc of the same size that slides inwards by up to 3 px cuts the outer side of each micro-image.
    slide = 3.0 * (np.hypot(*np.moveaxis(from_middle, -1, 0)) / 516 - 0.45).clip(0) / 0.55
    inwards = -from_middle / np.maximum(np.hypot(*np.moveaxis(from_middle, -1, 0)), 1)[..., None]
    cut = 1 / (1 + np.exp((np.hypot(*np.moveaxis(from_lenslet - slide[..., None] * inwards, -1, 0)) - 6.6) / 0.3))
    light = np.where(np.hypot(*np.moveaxis(from_lenslet, -1, 0)) < 6.6, cut, 1.0)
    mosaic = np.round(64 + (frame.capture.mosaic - 64.0) * light).astype(np.uint16)
    capture = replace(frame.capture, mosaic=mosaic)

    def centre_of_light() -> float:
        near = np.hypot(*np.moveaxis(from_lenslet, -1, 0)) < 7
        outer = near & (slide > 2)
        weight = (mosaic - 64.0)[outer]
        return float((weight * (from_lenslet * inwards).sum(-1)[outer]).sum() / weight.sum())

    assert centre_of_light() > 0.5
    assert rms(frame.lattice_error(fit_grid(capture).centres())) < SHADED_RMS_PX
