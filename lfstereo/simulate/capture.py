"""Press the button: a picture or a white image of a simulated camera."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.container import Capture
from lfstereo.progress import Progress, silent
from lfstereo.rig.geometry import Side
from lfstereo.simulate.frame_metadata import picture_metadata, white_metadata
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig
from lfstereo.simulate.scene import Scene
from lfstereo.simulate.sensor import expose, picture_filters, white_filters
from lfstereo.simulate.trace import trace_light, vignetting


def take_picture(
    scene: Scene, rig: SimulatedRig, side: Side, options: SimulateOptions, frame: int = 1, progress: Progress = silent
) -> Capture:
    """Photograph a scene with one camera of the rig.

    Parameters
    ----------
    scene
        In left camera axes.
    frame
        Number of the frame; the noise differs from frame to frame.
    """
    camera = rig.left if side == "left" else rig.right
    if side == "right":
        scene = scene.seen_from(rig.stereo.right_from_left, np.asarray(rig.stereo.translation_m))
    metadata = picture_metadata(camera, side)
    filters = options.exposure * picture_filters(metadata)
    light = trace_light(camera, scene, filters, options.samples, progress)
    return Capture(expose(light, metadata, options, frame), metadata, f"simulated {side} picture")


def take_white_image(rig: SimulatedRig, side: Side, options: SimulateOptions) -> Capture:
    """Photograph an evenly lit white area through the same optics, as the factory does for every zoom and focus."""
    camera = rig.left if side == "left" else rig.right
    metadata = white_metadata(camera, side)
    light = vignetting(camera)
    filters: Float64 = white_filters(metadata)
    for row in (0, 1):
        for column in (0, 1):
            light[row::2, column::2] *= np.float32(filters[row, column])
    return Capture(expose(light, metadata, options, 0), metadata, f"simulated {side} white image")
