"""A light-field camera as glass and silicon: thin main lens, hexagonal lenslet array, Bayer sensor.

All geometry is derived here from the distances between the parts; nothing is shared with the decoder.
The stored mosaic is upright (turned by 180 degrees against the image on the sensor), so in stored px the chief
ray of a scene point ``X`` in camera axes crosses the lenslet array at ``D X/Z`` and pixels further to +x inside a
micro-image look through pupil points further to +x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.rig.rig import PlenopticCamera

PIXEL_PITCH_M: Final = 1.4e-6
LENSLET_PITCH_M: Final = 20e-6
SENSORS: Final[dict[str, tuple[int, int]]] = {"illum": (7728, 5368), "small": (1546, 1074)}
"""Sensor profile -> (width, height) in px. ``small`` is a crop: a fifth of the field, everything else as it is."""


@dataclass(frozen=True, slots=True)
class SimulatedCamera:
    """One camera, all its parts in metres."""

    serial: str
    sensor_px: tuple[int, int]
    """(width, height)."""
    focal_length_m: float
    f_number: float
    focus_m: float
    """Object distance of the plane that the main lens images onto the lenslet array."""
    lenslet_gap_m: float
    """Lenslet array to sensor, g."""
    lenslet_offset_m: tuple[float, float]
    """(x, y) of lenslet (0, 0) against the optical axis, on the array."""
    lenslet_rotation_rad: float
    """Rotation of the array on the sensor, x towards y."""
    lenslet_scale: tuple[float, float]
    """Stretch of the array along its own x and y."""
    principal_px: tuple[float, float]
    """(cx, cy) of the optical axis on the sensor, 0-based px."""
    distortion_k1: float = 0.0
    """Picture points move out from the axis to ``r (1 + k1 r^2)``, r the tangent of the ideal direction."""

    @property
    def image_distance_m(self) -> float:
        """Distance D of the lenslet array from the main lens: ``1/D = 1/f - 1/Zf``.

        Examples
        --------
        f = 20 mm focused at 0.85 m: D = 1 / (1/0.02 - 1/0.85) = 0.020482 m.
        """
        return 1 / (1 / self.focal_length_m - 1 / self.focus_m)

    @property
    def focal_px(self) -> float:
        """Distance pupil to sensor in px: ``(D + g) / pixel pitch``, the scale of the micro-image centres."""
        return (self.image_distance_m + self.lenslet_gap_m) / PIXEL_PITCH_M

    @property
    def pupil_radius_m(self) -> float:
        """Radius of the aperture."""
        return self.focal_length_m / self.f_number / 2

    @property
    def pupil_m_per_px(self) -> float:
        """Metres on the pupil per sensor px inside a micro-image: ``pixel pitch * D / g``."""
        return PIXEL_PITCH_M * self.image_distance_m / self.lenslet_gap_m

    @property
    def magnification(self) -> float:
        """Spacing of the micro-images over that of the lenslets: ``1 + g/D``."""
        return 1 + self.lenslet_gap_m / self.image_distance_m

    @property
    def zoom_step(self) -> int:
        """State of the zoom lens as the camera writes it."""
        return round(905 - 40e3 * self.focal_length_m)

    @property
    def focus_step(self) -> int:
        """State of its focus as the camera writes it."""
        return round(250 / self.focus_m - 300)

    def lattice(self) -> Float64:
        """Return ``(3, 2)``: origin, step along a row, step to the next row of the micro-image centres, (x, y) px.

        Centre ``(i, j)`` lies at ``origin + (j + (i mod 2) / 2) * row_step + i * next_row``; i and j may be negative.
        """
        c, s = math.cos(self.lenslet_rotation_rad), math.sin(self.lenslet_rotation_rad)
        array_from_lattice = np.array([[c, -s], [s, c]]) @ np.diag(self.lenslet_scale) * LENSLET_PITCH_M
        px_per_m = self.magnification / PIXEL_PITCH_M
        lattice: Float64 = np.empty((3, 2))
        lattice[0] = np.asarray(self.principal_px) + px_per_m * np.asarray(self.lenslet_offset_m)
        lattice[1] = px_per_m * array_from_lattice @ [1.0, 0.0]
        lattice[2] = px_per_m * array_from_lattice @ [0.0, math.sqrt(3) / 2]
        return lattice

    def optics(self) -> Float64:
        """Return the numbers that the ray tracer needs, ``(11,)``; see ``trace``."""
        return np.array(
            [
                self.principal_px[0],
                self.principal_px[1],
                PIXEL_PITCH_M / self.magnification,
                self.image_distance_m,
                self.focus_m,
                self.pupil_m_per_px,
                self.pupil_radius_m,
                _RIM_DISTANCE * self.focal_length_m,
                _RIM_RADIUS * self.pupil_radius_m,
                LENSLET_PITCH_M,
                self.distortion_k1,
            ]
        )

    def plenoptic(self) -> PlenopticCamera:
        """Return what a perfect calibration of this camera would find."""
        return PlenopticCamera(
            serial=self.serial,
            sensor_px=self.sensor_px,
            focal_px=(self.focal_px, self.focal_px),
            principal_px=self.principal_px,
            focus_distance_m=self.focus_m,
            pupil_m_per_px=self.pupil_m_per_px,
            distortion=(self.distortion_k1, 0.0, 0.0, 0.0, 0.0),
            zoom_step=self.zoom_step,
            focus_step=self.focus_step,
        )


_RIM_DISTANCE: Final = 0.6
"""Front rim of the barrel before the pupil, in focal lengths; it cuts oblique bundles (cat's eye)."""
_RIM_RADIUS: Final = 1.5
"""Radius of that rim in pupil radii."""
