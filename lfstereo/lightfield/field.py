"""The 4-D light field, the value that everything after the decode works on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from lfstereo.arrays import UInt8, Views, check_shape
from lfstereo.develop.colour_spaces import conversion
from lfstereo.develop.options import Primaries
from lfstereo.errors import ShapeError


@dataclass(frozen=True, slots=True)
class ViewSampling:
    """Where the samples of a light field lie on the sensor; ties it to a rig whatever grid was fitted."""

    origin_px: tuple[float, float]
    """(x, y) on the sensor of view pixel (0, 0) of the centre view."""
    step_px: tuple[float, float]
    """(x, y) sensor px per view pixel along u and along v; the lattice rotation has been taken out."""
    rotation_rad: float
    """Rotation of the view's u axis on the sensor, x towards y."""
    view_step_px: float
    """Sensor px between neighbouring views, inside a micro-image."""


@dataclass(frozen=True, slots=True)
class LightField:
    """Views of one scene from a regular grid of positions in the aperture."""

    views: Views
    """``(T, S, V, U, 3)`` float32 linear RGB, 1.0 = diffuse white, values above 1 kept."""
    weight: UInt8 | None
    """``(T, S, V, U)`` confidence of each sample, 255 = full; ``None`` where all count alike."""
    sampling: ViewSampling | None
    """``None`` for views that never were a lenslet image: then a rig speaks of view pixels."""
    serial: str
    """Camera serial number, empty where unknown."""
    source: str
    """File or folder it came from, for messages."""
    zoom_step: int | None = None
    """State of the zoom lens as the camera wrote it; ``None`` where unknown."""
    focus_step: int | None = None
    """Likewise of its focus."""
    colour_space: Primaries = "srgb"
    """Primaries of the linear RGB."""

    def __post_init__(self) -> None:
        check_shape(f"{self.source}: views", self.views, (None, None, None, None, 3))
        if self.weight is not None and self.weight.shape != self.views.shape[:4]:
            raise ShapeError(
                f"{self.source}: weight has shape {self.weight.shape}, expected {self.views.shape[:4]} as the views"
            )

    @property
    def centre(self) -> tuple[int, int]:
        """Row and column ``(t0, s0)`` of the centre view."""
        return self.views.shape[0] // 2, self.views.shape[1] // 2


def in_srgb(light_field: LightField) -> LightField:
    """Return a light field in linear sRGB; colours outside are cut off at 0."""
    if light_field.colour_space == "srgb":
        return light_field
    matrix = conversion(light_field.colour_space, "srgb")
    views = np.empty_like(light_field.views)
    for place in np.ndindex(views.shape[:2]):
        views[place] = np.maximum(cv2.transform(light_field.views[place], matrix), 0)
    return replace(light_field, views=views, colour_space="srgb")
