"""A chart of 24 patches, photographed by the simulated sensor and decoded: what is left of its colours."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from lfstereo.develop.colour_spaces import conversion
from lfstereo.develop.options import DevelopOptions, Primaries
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.decoding import calibrate, views_from
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.options import DecodeOptions
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.capture import take_white_image
from lfstereo.simulate.chart import patch_means, photograph_chart
from lfstereo.simulate.frame_metadata import picture_metadata
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig
from lfstereo.simulate.sensor import picture_filters
from lfstereo.simulate.spectral_camera import describe, factory_matrices, photograph_spectra, sensor_filters

SMALL = SimulateOptions(sensor="small")
INNER_STEPS, LIT_STEPS = 6.3, 7.2
"""View steps from the centre: up to where no neighbouring micro-image is near, and up to where light falls."""


@dataclass(frozen=True)
class Stage:
    """A camera in front of the chart, its white image processed."""

    camera: SimulatedCamera
    grid: LensletGrid
    shading: np.ndarray

    def decode(self, colours: np.ndarray, filters: np.ndarray, metadata: Any, **develop: Any) -> LightField:
        capture = photograph_chart(colours, filters, metadata, self.camera, SMALL)
        return views_from(capture, self.grid, self.shading, DecodeOptions(develop=DevelopOptions(**develop)))


@pytest.fixture(scope="module")
def science() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip("colour")


@pytest.fixture(scope="module")
def stage() -> Stage:
    rig = build_rig(SMALL)
    white = take_white_image(rig, "left", SMALL)
    return Stage(rig.left, *calibrate(white, white))


def lab(science: Any, xyz: np.ndarray) -> np.ndarray:
    white = science.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ.sum(1)
    found: np.ndarray = science.XYZ_to_Lab(xyz, science.XYZ_to_xy(white))
    return found


def differences(science: Any, means: np.ndarray, primaries: Primaries, true_xyz: np.ndarray) -> np.ndarray:
    """Return the CIEDE2000 differences ``(T, S, 24)``."""
    matrix = science.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ @ conversion(primaries, "srgb")
    found: np.ndarray = science.delta_E(lab(science, means @ matrix.T), lab(science, true_xyz), method="CIE 2000")
    return found


def rings(light_field: LightField) -> np.ndarray:
    t0, s0 = light_field.centre
    rows, columns = light_field.views.shape[:2]
    found: np.ndarray = np.hypot(*np.mgrid[-t0 : rows - t0, -s0 : columns - s0])
    return found


def test_chart_comes_out_in_its_own_colours_in_every_view(science: Any, stage: Stage) -> None:
    """Sensor that obeys its matrix: what is left is noise, demosaicing and resampling."""
    chart = science.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"]
    xyz = science.xyY_to_XYZ(np.array(list(chart.data.values())))
    to_xyz = science.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ
    bradford = science.adaptation.matrix_chromatic_adaptation_VonKries
    xyz = xyz @ bradford(science.xy_to_XYZ(chart.illuminant), to_xyz.sum(1), transform="Bradford").T
    metadata = picture_metadata(stage.camera, "left")
    colours = xyz @ np.linalg.inv(to_xyz).T
    found = stage.decode(colours, picture_filters(metadata), metadata, colour_space="prophoto")
    assert found.colour_space == "prophoto"
    means = patch_means(found, stage.camera)
    error = differences(science, means, "prophoto", xyz)
    assert error[found.centre].mean() < 0.6
    inner, lit = rings(found) <= INNER_STEPS, rings(found) <= LIT_STEPS
    assert error.mean(2)[inner].max() < 0.8
    assert error.mean(2)[lit].max() < 2.5
    apart = differences(science, means, "prophoto", means[found.centre] @ (to_xyz @ conversion("prophoto", "srgb")).T)
    assert apart.mean(2)[inner].max() < 0.8  # consistent: no view is far from the centre one
    assert apart.mean(2)[lit].max() < 2.5


@pytest.mark.parametrize("temperature_k", [3505.0, 5200.0])
def test_measured_sensitivities_under_a_light_between_the_factory_s(
    science: Any, stage: Stage, temperature_k: float
) -> None:
    """No matrix fits such a sensor; the target is a mean CIEDE2000 of 2."""
    shot = photograph_spectra(temperature_k)
    metadata = describe(picture_metadata(stage.camera, "left"), shot, temperature_k, 0.9)
    filters = sensor_filters(metadata)
    own = stage.decode(shot.responses, filters, metadata, colour_space="prophoto")
    error = differences(science, patch_means(own, stage.camera), "prophoto", shot.true_xyz)
    print("\n".join(f"patch {n + 1:2d}  dE2000 {e:5.2f}" for n, e in enumerate(error[own.centre])))
    assert error[own.centre].mean() < 2.0
    assert error.mean(2)[rings(own) <= INNER_STEPS].max() < 2.0
    told = stage.decode(shot.responses, filters, metadata, colour_space="prophoto", temperature_k=temperature_k)
    np.testing.assert_allclose(told.views, own.views, atol=1e-5)
    plain = stage.decode(shot.responses, filters, metadata, colour_matrix=False)
    assert differences(science, patch_means(plain, stage.camera), "srgb", shot.true_xyz)[own.centre].mean() > 5.0


def test_factory_matrices_keep_greys_and_differ_by_light() -> None:
    matrices = factory_matrices()
    assert [kelvin for kelvin, _ in matrices] == [2850.0, 4150.0, 6500.0]
    for _, numbers in matrices:
        assert np.reshape(numbers, (3, 3)).sum(1) == pytest.approx([1.0] * 3)
    assert np.abs(np.subtract(matrices[0][1], matrices[2][1])).max() > 0.1


def test_overexposed_greys_stay_neutral_in_every_view(stage: Stage) -> None:
    """Grey patches from a twentieth of white to eight times white, shown up to white."""
    metadata = picture_metadata(stage.camera, "left")
    levels = np.geomspace(0.05, 8.0, 24)
    found = stage.decode(np.repeat(levels[:, None], 3, axis=1), picture_filters(metadata), metadata)
    means = patch_means(found, stage.camera)
    centre = means[found.centre]
    assert np.ptp(centre, axis=1)[levels < 0.9].max() < 0.01
    assert (np.ptp(centre, axis=1) / centre.mean(1))[levels > 1.5].max() < 0.02
    assert centre[levels > 1.6].min() > 1.4  # headroom above white is kept
    inside = rings(found) <= LIT_STEPS
    assert np.ptp(np.minimum(means[inside], 1.0), axis=2).max() < 0.08
