"""The camera as a thin lens before an array of lenslets: where a calibration starts, and what bounds it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lfstereo.container.metadata import FrameMetadata
from lfstereo.rig.rig import PlenopticCamera

Range = tuple[float, float]
_FOCAL_LENGTH_RANGE = (0.85, 1.18)
"""Of the focal length that metadata tell; a zoom lens of two groups is no thin lens."""
_GAP_RANGE = (0.8, 1.25)
"""Likewise of the distance from lenslets to sensor."""
_NEAREST_FOCALS = 8.0
"""The nearest plane of zero slope, in focal lengths."""
FARTHEST_M = 1000.0
"""The farthest one: beyond, it cannot be told from infinity."""


@dataclass(frozen=True, slots=True)
class ThinLens:
    """Main lens, lenslets and sensor, all in metres."""

    focal_length_m: float
    image_distance_m: float
    """Main lens to lenslets, b."""
    lenslet_gap_m: float
    """Lenslets to sensor, g."""
    exit_pupil_m: float
    """Lenslets to exit pupil, e; large for a telecentric lens."""
    pixel_pitch_m: float
    """p."""

    @property
    def focal_px(self) -> float:
        """Sensor px per tangent on the lattice of micro-image centres: ``b (1 + g/e) / p``.

        Examples
        --------
        >>> round(ThinLens(0.02, 0.020482, 38.4e-6, 0.020482, 1.4e-6).focal_px, 1)
        14657.4
        """
        return self.image_distance_m * (1 + self.lenslet_gap_m / self.exit_pupil_m) / self.pixel_pitch_m

    @property
    def pupil_m_per_px(self) -> float:
        """Metres on the pupil per sensor px inside a micro-image: ``p b / g``."""
        return self.pixel_pitch_m * self.image_distance_m / self.lenslet_gap_m

    @property
    def vergence_per_m(self) -> float:
        """Inverse of the distance of the plane of zero slope: ``1/f - 1/b``."""
        return 1 / self.focal_length_m - 1 / self.image_distance_m


@dataclass(frozen=True, slots=True)
class LensBounds:
    """Between which values a camera's lens can lie."""

    focal_px: Range
    vergence_per_m: Range
    pupil_m_per_px: Range


def thin_lens_of_metadata(metadata: FrameMetadata) -> ThinLens:
    """Return the lens as the camera wrote it down, focused at infinity."""
    lens = metadata.lens
    return ThinLens(
        focal_length_m=lens.focal_length_m,
        image_distance_m=lens.focal_length_m,
        lenslet_gap_m=metadata.lenslets.offset_m[2],
        exit_pupil_m=lens.exit_pupil_offset_m,
        pixel_pitch_m=metadata.pixel_pitch_m,
    )


def thin_lens_of_camera(camera: PlenopticCamera, start: ThinLens) -> ThinLens:
    """Return the thin lens that sees as a calibrated camera does; exit pupil and pixels as the metadata tell.

    From ``fx p = b (1 + g/e)`` and ``g = p b / m`` follows ``b^2 p/(m e) + b - fx p = 0``.
    """
    pitch, exit_pupil = start.pixel_pitch_m, start.exit_pupil_m
    focal_m = math.sqrt(camera.focal_px[0] * camera.focal_px[1]) * pitch
    curve = pitch / (camera.pupil_m_per_px * exit_pupil)
    distance = 2 * focal_m / (1 + math.sqrt(1 + 4 * curve * focal_m))
    return ThinLens(
        focal_length_m=1 / (1 / distance + 1 / camera.focus_distance_m),
        image_distance_m=distance,
        lenslet_gap_m=pitch * distance / camera.pupil_m_per_px,
        exit_pupil_m=exit_pupil,
        pixel_pitch_m=pitch,
    )


def lens_bounds(start: ThinLens) -> LensBounds:
    """Return what the lens can be, from the focal length and the distance of the lenslets in the metadata.

    The image lies between the focal length, focused at infinity, and 8/7 of it, focused at eight focal lengths.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), section 3: the thin lens and the pinhole lenslets.
    """
    f, low, high = start.focal_length_m, *_FOCAL_LENGTH_RANGE
    reach = _NEAREST_FOCALS / (_NEAREST_FOCALS - 1)
    stretch = 1 + start.lenslet_gap_m / start.exit_pupil_m
    pupil = start.pixel_pitch_m * f / start.lenslet_gap_m
    return LensBounds(
        focal_px=(low * f * stretch / start.pixel_pitch_m, high * reach * f * stretch / start.pixel_pitch_m),
        vergence_per_m=(1 / FARTHEST_M, 1 / (_NEAREST_FOCALS * low * f)),
        pupil_m_per_px=(pupil * low / _GAP_RANGE[1], pupil * high * reach / _GAP_RANGE[0]),
    )
