"""A chart of 24 plain patches in front of a simulated camera: known colours, for what a decode makes of them."""

from __future__ import annotations

from typing import Final

import numpy as np

from lfstereo.arrays import Float64, check_shape
from lfstereo.container import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.lightfield.field import LightField
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.primitives import COLOURS, PATCH
from lfstereo.simulate.scene import Scene, Surface, even_light, primitive
from lfstereo.simulate.sensor import expose
from lfstereo.simulate.texture import PLAIN
from lfstereo.simulate.trace import trace_light

ROWS: Final = 4
COLUMNS: Final = 6
_PATCH_SHARE: Final = 0.84
"""Side of a patch, of the distance between patches; the rest is the dark frame."""
_FRAME_LEVEL: Final = 0.03
_MARGIN_PX: Final = 3.0
"""View pixels inside the edge of a patch that are not measured."""


def chart_scene(colours: Float64, camera: SimulatedCamera) -> Scene:
    """Return a chart that fills the sensor of a camera, square on and in the plane of focus.

    Parameters
    ----------
    colours
        ``(24, 3)`` what the patches send out, row by row from the top left, in the three colours that the sensor's
        filters are given for; may be negative for colours outside their gamut.
    camera
        The camera that looks at it.
    """
    check_shape("chart", colours, (ROWS * COLUMNS, 3))
    axes, surface = np.eye(3), Surface(PLAIN, ("#000000",) * 3, 1.0, 0.0)
    behind = primitive(PATCH, (0.0, 0.0, 1.001 * camera.focus_m), axes, (camera.focus_m, camera.focus_m, 1.0), surface)
    behind[COLOURS : COLOURS + 9] = _FRAME_LEVEL * float(colours.max())
    primitives = [behind]
    half = _half_m(camera)
    for centre, colour in zip(_centres_m(camera), colours, strict=True):
        place = (float(centre[0]), float(centre[1]), camera.focus_m)
        patch = primitive(PATCH, place, axes, (half[0], half[1], 1.0), surface)
        patch[COLOURS : COLOURS + 9] = np.tile(colour, 3)
        primitives.append(patch)
    return Scene(np.stack(primitives), even_light(), np.ones((1, 2, 2), np.float32))


def photograph_chart(
    colours: Float64,
    filters: Float64,
    metadata: FrameMetadata,
    camera: SimulatedCamera,
    options: SimulateOptions,
    frame: int = 1,
) -> Capture:
    """Photograph the chart through the optics and the sensor of a simulated camera.

    Parameters
    ----------
    colours
        ``(24, 3)`` as in :func:`chart_scene`.
    filters
        ``(2, 2, 3)``: what each Bayer site makes of these colours, in shares of the white level.
    metadata
        Written beside the mosaic: levels, white balance, matrices.
    frame
        Number of the frame; the noise differs from frame to frame.
    """
    light = trace_light(camera, chart_scene(colours, camera), filters, options.samples)
    return Capture(expose(light, metadata, options, frame), metadata, "simulated chart")


def patch_means(light_field: LightField, camera: SimulatedCamera) -> Float64:
    """Return ``(T, S, 24, 3)``: the mean colour inside each patch of each view; 0 where a view is dark.

    Parameters
    ----------
    light_field
        Decoded photograph of the chart.
    camera
        The camera that took it, which says where the patches are.
    """
    sampling = light_field.sampling
    assert sampling is not None
    rows, columns, height, width = light_field.views.shape[:4]
    means: Float64 = np.zeros((rows, columns, ROWS * COLUMNS, 3))
    cos, sin = np.cos(sampling.rotation_rad), np.sin(sampling.rotation_rad)
    half = _half_m(camera) / camera.focus_m * camera.focal_px / np.asarray(sampling.step_px) - _MARGIN_PX
    for n, centre in enumerate(_centres_m(camera)):
        x, y = centre / camera.focus_m * camera.focal_px + np.asarray(camera.principal_px) - sampling.origin_px
        u, v = (cos * x + sin * y) / sampling.step_px[0], (cos * y - sin * x) / sampling.step_px[1]
        top, bottom = max(round(v - half[1]), 0), min(round(v + half[1]) + 1, height)
        left, right = max(round(u - half[0]), 0), min(round(u + half[0]) + 1, width)
        means[:, :, n] = light_field.views[:, :, top:bottom, left:right].mean((2, 3), dtype=np.float64)
    return means


def _pitch_m(camera: SimulatedCamera) -> Float64:
    """Return the distance between patches, (x, y) m."""
    size: Float64 = np.asarray(camera.sensor_px) * camera.focus_m / camera.focal_px
    return 0.96 * size / [COLUMNS, ROWS]


def _half_m(camera: SimulatedCamera) -> Float64:
    return 0.5 * _PATCH_SHARE * _pitch_m(camera)


def _centres_m(camera: SimulatedCamera) -> Float64:
    """Return ``(24, 2)`` centres of the patches, m off the optical axis."""
    middle = (np.asarray(camera.sensor_px) - 1) / 2 - np.asarray(camera.principal_px)
    grid = np.array([[i - (COLUMNS - 1) / 2, j - (ROWS - 1) / 2] for j in range(ROWS) for i in range(COLUMNS)])
    centres: Float64 = grid * _pitch_m(camera) + middle * camera.focus_m / camera.focal_px
    return centres
