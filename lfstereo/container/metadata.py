"""What the camera wrote down about a frame: levels, colour, lens, lenslet array."""

from __future__ import annotations

from dataclasses import dataclass, field

from lfstereo.container.fields import Fields, Json
from lfstereo.errors import MetadataError

Quad = tuple[float, float, float, float]
"""One number per Bayer site, in the order r, gr, gb, b."""


@dataclass(frozen=True, slots=True)
class LensletArray:
    """The micro-lens array as the factory measured it: start values, never to be trusted."""

    pitch_m: float
    rotation_rad: float
    scale_x: float
    scale_y: float
    offset_m: tuple[float, float, float]
    """x, y on the sensor and the distance z from it."""


@dataclass(frozen=True, slots=True)
class MainLens:
    """State of the zoom lens at the exposure."""

    focal_length_m: float
    f_number: float
    zoom_step: int
    focus_step: int
    exit_pupil_offset_m: float
    infinity_lambda: float


@dataclass(frozen=True, slots=True)
class FrameMetadata:
    """Everything later stages need to know of one raw frame."""

    make: str
    model: str
    """``"ILLUM"`` (also written B01, here always ILLUM) or ``"F01"``."""
    firmware: str
    serial: str
    """Camera serial number; empty where the file does not tell."""
    width: int
    height: int
    bits_per_pixel: int
    """Of the packed frame: 10 (Illum) or 12 (F01); 8 or 16 for a mosaic from an image file."""
    endianness: str
    """``"little"`` or ``"big"``."""
    bayer: str
    """Colours of the top-left 2 x 2 sites row by row: ``"grbg"`` (Illum) or ``"bggr"`` (F01)."""
    black: Quad
    """Digital numbers."""
    white: Quad
    """Digital numbers."""
    white_balance: Quad
    ccm: tuple[float, ...]
    """Nine numbers, row by row: camera RGB to linear sRGB."""
    exposure_bias_ev: float
    """``modulationExposureBias``."""
    normalized_responses: Quad
    """Response of each site to the white image's illuminant, green = 1."""
    pixel_pitch_m: float
    iso: float
    captured_at: str
    """``zuluTime`` as written."""
    lenslets: LensletArray
    lens: MainLens
    is_white_image: bool
    is_dark_frame: bool
    ccm_by_cct: tuple[tuple[float, tuple[float, ...]], ...] = ()
    """The factory's colour matrices: (illuminant in kelvin, nine numbers as in ``ccm``), warm to cold."""
    awb_cct_k: float | None = None
    """Colour temperature that the camera's white balance found, kelvin."""
    exposure_s: float | None = None
    """Exposure time of a pixel, seconds."""
    geometry_ref: str = field(default="", compare=False)
    """The factory's name of the white image that the camera itself chose for a picture; empty where not told."""


EXIT_PUPIL_AT_INFINITY_M = 10000.0
"""What the cameras write as exit pupil offset where they give none."""
LARGEST_SIDE_PX = 65535
BAYER_BY_UPPER_LEFT = {"r": "rggb", "gr": "grbg", "gb": "gbrg", "b": "bggr"}
"""``mosaic.upperLeftPixel`` of the tile ``r,gr:gb,b`` -> colours row by row."""
MODELS = {"B01": "ILLUM", "ILLUM": "ILLUM", "F01": "F01"}
_TAGS = ("parameters", "vendorContent", "com.lytro.tags")


def parse_metadata(public: Json, private: Json | None, where: str) -> FrameMetadata:
    """Read the metadata of a frame in any layout that Lytro's cameras and programs write.

    Known layouts: an Illum's public metadata (``image.pixelFormat``, ``ccm``), an F01's (``image.rawDetails``,
    ``ccmRgbToSrgbArray``), the text file of a white image (``master.picture.frameArray``), and a flattened mixture
    of the first and the last, in which the flattened values count. Where a frame does not tell, the white balance
    and the normalized responses are 1, the exposure bias, the lenslet rotation and the sensor offset in x and y
    0, the lenslet scale 1, the exit pupil lies at ``EXIT_PUPIL_AT_INFINITY_M``, and texts are empty.

    Parameters
    ----------
    public
        The frame's metadata, or a whole file that holds them.
    private
        The frame's private metadata (serial numbers), where there are any.
    where
        File name for messages.

    Raises
    ------
    MetadataError
        If a field is missing, or holds a value that cannot be; the message names the field.
    """
    frame = Fields(where, _layers(public, where), _private_layers(public, private))
    width, height = frame.whole("image.width"), frame.whole("image.height")
    if not (2 <= width <= LARGEST_SIDE_PX and 2 <= height <= LARGEST_SIDE_PX):
        raise MetadataError(
            f"{where}: image.width x image.height: found {width} x {height}, expected 2 to {LARGEST_SIDE_PX} "
            "each; give the file that the camera wrote"
        )
    black, white = _levels(frame)
    return FrameMetadata(
        make=frame.text("camera.make", default=""),
        model=MODELS[frame.choice(("camera.model", "cameraModel"), tuple(MODELS))],
        firmware=frame.text("camera.firmware", default=""),
        serial=frame.private_text("camera.serialNumber"),
        width=width,
        height=height,
        bits_per_pixel=_bits(frame),
        endianness=frame.choice(
            ("image.pixelPacking.endianness", "image.rawDetails.pixelPacking.endianness"), ("little", "big")
        ),
        bayer=_bayer(frame),
        black=black,
        white=white,
        white_balance=frame.quad("image.color.whiteBalanceGain", default=(1.0, 1.0, 1.0, 1.0)),
        ccm=frame.matrix("image.color.ccm", "image.color.ccmRgbToSrgbArray"),
        exposure_bias_ev=frame.number("image.modulationExposureBias", default=0.0),
        normalized_responses=frame.quad("devices.sensor.normalizedResponses.0", default=(1.0, 1.0, 1.0, 1.0)),
        pixel_pitch_m=frame.positive("devices.sensor.pixelPitch"),
        iso=frame.positive("image.iso", "devices.sensor.iso"),
        captured_at=frame.text("devices.clock.zuluTime", default=""),
        lenslets=_lenslets(frame),
        lens=_lens(frame),
        is_white_image=frame.flag((*_TAGS, "modulationFrame")),
        is_dark_frame=frame.flag((*_TAGS, "darkFrame")),
        ccm_by_cct=_matrices(frame),
        awb_cct_k=frame.optional("algorithms.awb.computed.cct"),
        exposure_s=frame.optional("devices.shutter.pixelExposureDuration"),
    )


def _layers(public: Json, where: str) -> tuple[Json, ...]:
    """Return the objects to search for a field, the first that has it counts."""
    layers = [public] if isinstance(public.get("image"), dict) else []
    for entry in frame_entries(public):
        frame = entry.get("frame")
        if isinstance(frame, dict) and isinstance(frame.get("metadata"), dict):
            layers.append(frame["metadata"] | {"parameters": entry.get("parameters", {})})
    if not layers:
        raise MetadataError(
            f"{where}: field 'image' is missing; expected the metadata of a Lytro frame (JSON with image, devices, "
            "camera); give the file that the camera wrote"
        )
    return tuple(layers)


def _private_layers(public: Json, private: Json | None) -> tuple[Json, ...]:
    frames = (entry.get("frame") for entry in frame_entries(public))
    inside = [frame.get("privateMetadata") for frame in frames if isinstance(frame, dict)]
    return tuple(layer for layer in (private, public, *inside) if isinstance(layer, dict))


def frame_entries(toc: Json) -> list[Json]:
    """Return the entry of the first frame in each list of frames of a table of contents, whatever its age."""
    entries = []
    for path in (("frames",), ("picture", "frameArray"), ("master", "picture", "frameArray")):
        value: object = toc
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        if isinstance(value, list) and value and isinstance(value[0], dict):
            entries.append(value[0])
    return entries


def _bits(frame: Fields) -> int:
    bits = frame.whole("image.pixelPacking.bitsPerPixel", "image.rawDetails.pixelPacking.bitsPerPixel")
    if bits not in (8, 10, 12, 16):
        raise MetadataError(f"{frame.where}: bitsPerPixel: found {bits}, expected 8, 10, 12 or 16")
    return bits


def _bayer(frame: Fields) -> str:
    frame.choice(("image.mosaic.tile", "image.rawDetails.mosaic.tile"), ("r,gr:gb,b",))
    names = ("image.mosaic.upperLeftPixel", "image.rawDetails.mosaic.upperLeftPixel")
    return BAYER_BY_UPPER_LEFT[frame.choice(names, tuple(BAYER_BY_UPPER_LEFT))]


def _levels(frame: Fields) -> tuple[Quad, Quad]:
    black = frame.quad("image.pixelFormat.black", "image.rawDetails.pixelFormat.black")
    white = frame.quad("image.pixelFormat.white", "image.rawDetails.pixelFormat.white")
    if any(not 0 <= b < w <= 65535 for b, w in zip(black, white, strict=True)):
        raise MetadataError(
            f"{frame.where}: pixelFormat: found black {black} and white {white}, expected 0 <= black < white <= 65535"
        )
    return black, white


def _lenslets(frame: Fields) -> LensletArray:
    return LensletArray(
        pitch_m=frame.positive("devices.mla.lensPitch"),
        rotation_rad=frame.number("devices.mla.rotation", default=0.0),
        scale_x=frame.positive("devices.mla.scaleFactor.x", default=1.0),
        scale_y=frame.positive("devices.mla.scaleFactor.y", default=1.0),
        offset_m=(
            frame.number("devices.mla.sensorOffset.x", default=0.0),
            frame.number("devices.mla.sensorOffset.y", default=0.0),
            frame.positive("devices.mla.sensorOffset.z"),
        ),
    )


def _lens(frame: Fields) -> MainLens:
    return MainLens(
        focal_length_m=frame.positive("devices.lens.focalLength"),
        f_number=frame.positive("devices.lens.fNumber"),
        zoom_step=frame.whole("devices.lens.zoomStep", "zoomStep"),
        focus_step=frame.whole("devices.lens.focusStep", "focusStep"),
        exit_pupil_offset_m=frame.number("devices.lens.exitPupilOffset.z", default=EXIT_PUPIL_AT_INFINITY_M),
        infinity_lambda=frame.number("devices.lens.infinityLambda"),
    )


def _matrices(frame: Fields) -> tuple[tuple[float, tuple[float, ...]], ...]:
    field = "devices.sensor.perCcm"
    rows = range(frame.count(field))
    matrices = ((frame.positive(f"{field}.{i}.cct"), frame.matrix(f"{field}.{i}.ccm")) for i in rows)
    return tuple(sorted(matrices))
