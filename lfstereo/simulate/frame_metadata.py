"""What the simulated cameras write down about their frames: the values of real Illums."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from lfstereo.container.metadata import FrameMetadata, LensletArray, MainLens, Quad
from lfstereo.simulate.camera import LENSLET_PITCH_M, PIXEL_PITCH_M, SimulatedCamera

ZOOM_FOCUS_NUMBER: Final = 15
"""Number of the white image (``MOD_0015``) that belongs to the captures' zoom and focus."""


@dataclass(frozen=True, slots=True)
class _Colour:
    """Colour of one camera body."""

    ccm: tuple[float, ...]
    white_balance: Quad
    white_ccm: tuple[float, ...]
    normalized_responses: Quad
    exposure_bias_ev: float


# fmt: off
_COLOURS: Final = {
    "left": _Colour(
        ccm=(2.227, -1.055, -0.172, -0.427, 1.746, -0.319, -0.205, -0.747, 1.952),
        white_balance=(1.379, 1.0, 1.0, 1.148),
        white_ccm=(2.483, -1.102, -0.381, -0.368, 1.667, -0.299, -0.187, -0.733, 1.920),
        normalized_responses=(0.776, 1.0, 1.0, 0.734),
        exposure_bias_ev=0.269,
    ),
    "right": _Colour(
        ccm=(2.190, -1.023, -0.167, -0.413, 1.765, -0.352, -0.182, -0.708, 1.890),
        white_balance=(1.512, 1.0, 1.0, 1.189),
        white_ccm=(2.483, -1.102, -0.381, -0.368, 1.667, -0.299, -0.187, -0.733, 1.920),
        normalized_responses=(0.744, 1.0, 1.0, 0.760),
        exposure_bias_ev=0.241,
    ),
}
# fmt: on


def picture_metadata(camera: SimulatedCamera, side: str) -> FrameMetadata:
    """Return the metadata of a picture."""
    colour = _COLOURS[side]
    return _metadata(camera, colour, colour.ccm, colour.white_balance, colour.exposure_bias_ev, False)


def white_metadata(camera: SimulatedCamera, side: str) -> FrameMetadata:
    """Return the metadata of the white image taken at the factory with the same zoom and focus."""
    colour = _COLOURS[side]
    return _metadata(camera, colour, colour.white_ccm, (1.0, 1.0, 1.0, 1.0), 0.0, True)


def _metadata(
    camera: SimulatedCamera,
    colour: _Colour,
    ccm: tuple[float, ...],
    white_balance: Quad,
    bias_ev: float,
    is_white: bool,
) -> FrameMetadata:
    width, height = camera.sensor_px
    return FrameMetadata(
        make="Lytro, Inc.",
        model="ILLUM",
        firmware="simulated",
        serial=camera.serial,
        width=width,
        height=height,
        bits_per_pixel=10,
        endianness="little",
        bayer="grbg",
        black=(64.0,) * 4,
        white=(1023.0,) * 4,
        white_balance=white_balance,
        ccm=ccm,
        exposure_bias_ev=bias_ev,
        normalized_responses=colour.normalized_responses,
        pixel_pitch_m=PIXEL_PITCH_M,
        iso=100.0 if is_white else 80.0,
        captured_at="2014-11-03T09:12:44.000Z" if is_white else "2015-05-13T04:46:10.000Z",
        lenslets=_lenslets(camera, is_white),
        lens=_lens(camera),
        is_white_image=is_white,
        is_dark_frame=False,
        awb_cct_k=None if is_white else 6199.0,
        exposure_s=0.008,
    )


def _lenslets(camera: SimulatedCamera, is_white: bool) -> LensletArray:
    """Return the array as written: micrometres off, and differently in every file, as in real files."""
    x, y = camera.lenslet_offset_m
    off = (-7.1e-6, 2.3e-6, 1.4e-6, -1.1e-5) if is_white else (3.9e-6, -1.6e-6, -0.8e-6, 0.6e-5)
    return LensletArray(
        pitch_m=LENSLET_PITCH_M,
        rotation_rad=camera.lenslet_rotation_rad + off[3],
        scale_x=1.0,
        scale_y=camera.lenslet_scale[1] / camera.lenslet_scale[0],
        offset_m=(x + off[0], y + off[1], camera.lenslet_gap_m + off[2]),
    )


def _lens(camera: SimulatedCamera) -> MainLens:
    return MainLens(
        focal_length_m=camera.focal_length_m,
        f_number=camera.f_number,
        zoom_step=camera.zoom_step,
        focus_step=camera.focus_step,
        exit_pupil_offset_m=camera.image_distance_m,
        infinity_lambda=15.0,
    )
