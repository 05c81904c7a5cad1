"""A sensor with measured spectral sensitivities, calibrated as a factory would: for colours no matrix can get right.

The colours of the simulated cameras obey their matrix exactly. A real sensor's do not: its filters are no linear
combination of the eye's, so that every matrix is a compromise, and one that was made for other lights.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.container.metadata import FrameMetadata
from lfstereo.simulate.sensor import by_site

FACTORY_LIGHTS_K: Final = (2850.0, 4150.0, 6500.0)
"""Colour temperatures of the lights that the Illum's factory matrices are for."""
_DAYLIGHT_FROM_K: Final = 4000.0
_CAMERA: Final = "Nikon 5100 (NPL)"


@dataclass(frozen=True, slots=True)
class SpectralShot:
    """The 24 patches of a chart under one light, as the sensor and as the eye sees them."""

    responses: Float64
    """``(24, 3)`` sensor response, that of a perfect white in green = 1."""
    white: Float64
    """``(3,)`` response to a perfect white."""
    true_xyz: Float64
    """``(24, 3)`` XYZ adapted to D65, Y of a perfect white = 1."""


def photograph_spectra(temperature_k: float) -> SpectralShot:
    """Return the classic chart of 24 patches under a black body, or daylight from 4000 K on.

    References
    ----------
    Darrodi, Finlayson, Goodman, Mackiewicz, "Reference data set for camera spectral sensitivity estimation" (JOSA A
    2015): the sensitivities. Pascale, "RGB coordinates of the Macbeth ColorChecker" (BabelColor 2006): the spectra.
    """
    science = _science()
    patches = np.array([_on_grid(sd) for sd in science.SDS_COLOURCHECKERS["BabelColor Average"].values()])
    return _shot(patches, temperature_k)


def factory_matrices() -> tuple[tuple[float, tuple[float, ...]], ...]:
    """Return (kelvin, nine numbers) for each factory light: least squares over 99 everyday surfaces, greys kept.

    The surfaces are those of CIE 224:2017, none of them a patch of the chart. Differences are weighted in linear
    sRGB divided by the cube root's slope, so that dark and bright surfaces count alike.
    """
    science = _science()
    surfaces = _on_grid(science.quality.cfi2017.load_TCS_CIE2017(science.SpectralShape(380, 780, 5))).T
    found = []
    for kelvin in FACTORY_LIGHTS_K:
        shot = _shot(surfaces, kelvin)
        balanced = shot.responses / shot.white
        wanted = shot.true_xyz @ np.linalg.inv(_srgb_to_xyz()).T
        weight = np.cbrt(shot.true_xyz[:, 1:2]) ** -2
        # With rows of sum 1, what is left to find is the share of the two colour differences.
        base = balanced[:, 1:2]
        shares, *_ = np.linalg.lstsq(weight * (balanced[:, [0, 2]] - base), weight * (wanted - base), rcond=None)
        matrix = np.column_stack([shares[0], 1 - shares.sum(0), shares[1]])
        found.append((kelvin, tuple(float(v) for v in matrix.ravel())))
    return tuple(found)


def describe(metadata: FrameMetadata, shot: SpectralShot, temperature_k: float, level: float) -> FrameMetadata:
    """Return a frame's metadata with the colours of this sensor.

    Parameters
    ----------
    metadata
        What is kept of the rest.
    shot
        What the sensor sees of a perfect white.
    temperature_k
        As the camera's white balance found it; the photograph's own matrix is interpolated for it.
    level
        Share of the white level that the brightest colour of a perfect white is exposed to.
    """
    matrices = factory_matrices()
    own = [np.interp(temperature_k, FACTORY_LIGHTS_K, column) for column in np.array([m for _, m in matrices]).T]
    red, green, blue = (float(v) for v in shot.white[1] / shot.white)
    return replace(
        metadata,
        white_balance=(red, green, green, blue),
        ccm=tuple(float(v) for v in own),
        ccm_by_cct=matrices,
        awb_cct_k=temperature_k,
        exposure_bias_ev=float(-np.log2(level / shot.white.max())),
    )


def sensor_filters(metadata: FrameMetadata) -> Float64:
    """Return ``(2, 2, 3)``: each Bayer site takes its own response, exposed as the metadata tell."""
    own = by_site((0, 1, 1, 2), metadata.bayer).astype(int)
    filters: Float64 = np.eye(3)[own] * 2.0**-metadata.exposure_bias_ev
    return filters


def _shot(surfaces: Float64, temperature_k: float) -> SpectralShot:
    science = _science()
    light = _light(temperature_k)
    sensor = _on_grid(science.MSDS_CAMERA_SENSITIVITIES[_CAMERA])
    eye = _on_grid(science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"])
    white, white_xyz = light @ sensor, light @ eye
    xyz = (surfaces * light) @ eye / white_xyz[1]
    d65 = _srgb_to_xyz().sum(1)
    adapt = science.adaptation.matrix_chromatic_adaptation_VonKries(white_xyz / white_xyz[1], d65, transform="Bradford")
    return SpectralShot((surfaces * light) @ sensor / white[1], white / white[1], xyz @ np.asarray(adapt).T)


def _light(temperature_k: float) -> Float64:
    science = _science()
    if temperature_k < _DAYLIGHT_FROM_K:
        return _on_grid(science.sd_blackbody(temperature_k, _shape()))
    xy = science.temperature.CCT_to_xy_CIE_D(temperature_k * 1.4388 / 1.4380)
    return _on_grid(science.sd_CIE_illuminant_D_series(xy))


def _srgb_to_xyz() -> Float64:
    return np.asarray(_science().RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ, np.float64)


def _shape() -> Any:
    return _science().SpectralShape(400, 700, 5)


def _on_grid(distribution: Any) -> Float64:
    """Return the values every 5 nm from 400 to 700 nm."""
    aligned = distribution.copy().align(_shape())
    return np.asarray(aligned.values, np.float64)


@cache
def _science() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour
