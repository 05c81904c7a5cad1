"""Camera metadata as the JSON objects that Lytro's cameras write: the inverse of `parse_metadata`.

What `FrameMetadata` does not hold (battery, accelerometer, settings) is written with neutral values, so that the
files have the fields which other programs expect.
"""

from __future__ import annotations

import re

from lfstereo.container.fields import Json
from lfstereo.container.metadata import BAYER_BY_UPPER_LEFT, FrameMetadata, Quad

GENERATOR = "lfstereo"
_SITES = ("r", "gr", "gb", "b")
_SCHEMAS = "http://schema.lytro.com/lfp"


def public_metadata(metadata: FrameMetadata) -> Json:
    """Return the public metadata of a picture in the layout of its camera."""
    return _f01_public(metadata, metadata.model) if metadata.model == "F01" else _illum_public(metadata)


def private_metadata(metadata: FrameMetadata) -> Json:
    """Return the private metadata (serial numbers) of a picture in the layout of its camera."""
    private: Json = {"devices": {"sensor": {"sensorSerial": "0x00000000"}}, "camera": {"serialNumber": metadata.serial}}
    if metadata.model == "F01":
        return private
    schema = f"{_SCHEMAS}/lytro_illum_private/1.1.1/lytro_illum_private_schema.json"
    return {"generator": GENERATOR, "schema": schema, **private, "devices": {"sensor": {"serialNumber": "00000000"}}}


def sidecar_metadata(metadata: FrameMetadata) -> Json:
    """Return the text file that accompanies a bare raw frame, in the layout of the cameras' white images."""
    frame: Json = {
        "privateMetadata": {
            "camera": {"serialNumber": metadata.serial},
            "devices": {"sensor": {"sensorSerial": "0x00000000"}},
        },
        "metadata": _f01_public(metadata, "F01" if metadata.model == "F01" else "B01"),
        "imageRef": "unknown",
    }
    date = re.match(r"\d{4}-\d{2}-\d{2}", metadata.captured_at)
    return {
        "master": {
            "version": {"major": 1, "minor": 0, "provisionalDate": date.group() if date else "2011-08-03"},
            "picture": {
                "viewArray": [],
                "accelerationArray": [],
                "frameArray": [{"frame": frame, "parameters": frame_parameters(metadata)}],
                "derivationArray": [],
            },
            "thumbnailArray": [],
        },
    }


def f01_toc(metadata: FrameMetadata, references: dict[str, str]) -> Json:
    """Return the table of contents of an F01 picture from its references (``imageRef`` and so on)."""
    return {
        "picture": {
            "frameArray": [{"frame": references, "parameters": frame_parameters(metadata)}],
            "viewArray": [{"type": "com.lytro.stars", "vendorContent": {"starred": False}}],
            "accelerationArray": [],
            "derivationArray": [],
        },
        "thumbnailArray": [],
        "version": {"major": 1, "minor": 0, "provisionalDate": "2011-08-03"},
    }


def illum_toc(metadata: FrameMetadata, references: dict[str, str], thumbnail: Json) -> Json:
    """Return the table of contents of an Illum picture from its references and the entry of its thumbnail."""
    entry: Json = {"assignedProperties": {}, "accelerations": [], "frame": references}
    if metadata.is_white_image or metadata.is_dark_frame:
        entry["parameters"] = frame_parameters(metadata)
    return {
        "schema": f"{_SCHEMAS}/picture/2.1.6/picture_schema.json",
        "generators": [GENERATOR],
        "thumbnails": [thumbnail],
        "derivations": [],
        "frames": [entry],
        "annotations": [],
        "views": [],
    }


def frame_parameters(metadata: FrameMetadata) -> Json:
    """Return what a table of contents says of a frame: whether it is dark or of a white target."""
    tags = {"darkFrame": metadata.is_dark_frame, "modulationFrame": metadata.is_white_image}
    return {"vendorContent": {"com.lytro.tags": tags}}


def _sites(values: Quad) -> dict[str, float]:
    return {site: _tidy(value) for site, value in zip(_SITES, values, strict=True)}


def _tidy(value: float) -> float:
    """Return a whole number as int, as the cameras write it."""
    return int(value) if float(value).is_integer() else value


def _mosaic(metadata: FrameMetadata) -> Json:
    upper_left = next(site for site, bayer in BAYER_BY_UPPER_LEFT.items() if bayer == metadata.bayer)
    return {"tile": "r,gr:gb,b", "upperLeftPixel": upper_left}


def _raw_details(metadata: FrameMetadata) -> Json:
    return {
        "pixelFormat": {"rightShift": 0, "black": _sites(metadata.black), "white": _sites(metadata.white)},
        "pixelPacking": {"endianness": metadata.endianness, "bitsPerPixel": metadata.bits_per_pixel},
        "mosaic": _mosaic(metadata),
    }


def _camera(metadata: FrameMetadata, model: str) -> Json:
    return {"make": metadata.make, "model": model, "firmware": metadata.firmware}


def _sensor(metadata: FrameMetadata) -> Json:
    sensor: Json = {
        "bitsPerPixel": metadata.bits_per_pixel,
        "mosaic": _mosaic(metadata),
        "iso": _tidy(metadata.iso),
        "analogGain": _sites((1.0, 1.0, 1.0, 1.0)),
        "pixelPitch": metadata.pixel_pitch_m,
        "normalizedResponses": [{"cct": 5100, **_sites(metadata.normalized_responses)}],
    }
    if metadata.ccm_by_cct:
        sensor["perCcm"] = [{"cct": _tidy(cct), "ccm": list(ccm)} for cct, ccm in metadata.ccm_by_cct]
    return sensor


def _mla(metadata: FrameMetadata) -> Json:
    lenslets = metadata.lenslets
    x, y, z = lenslets.offset_m
    return {
        "config": "com.lytro.mla.3",
        "tiling": "hexUniformRowMajor",
        "lensPitch": lenslets.pitch_m,
        "rotation": lenslets.rotation_rad,
        "defectArray": [],
        "scaleFactor": {"x": lenslets.scale_x, "y": lenslets.scale_y},
        "sensorOffset": {"x": x, "y": y, "z": z},
    }


def _lens(metadata: FrameMetadata) -> Json:
    lens = metadata.lens
    return {
        "infinityLambda": lens.infinity_lambda,
        "focalLength": lens.focal_length_m,
        "zoomStep": lens.zoom_step,
        "focusStep": lens.focus_step,
        "fNumber": lens.f_number,
        "exitPupilOffset": {"z": _tidy(lens.exit_pupil_offset_m)},
        "opticalCenterOffset": {"x": 0, "y": 0},
    }


def _shutter(metadata: FrameMetadata, mechanism: str) -> Json:
    shutter: Json = {"mechanism": mechanism}
    if metadata.exposure_s is not None:
        shutter |= {"frameExposureDuration": metadata.exposure_s, "pixelExposureDuration": metadata.exposure_s}
    return shutter


def _awb(metadata: FrameMetadata) -> Json:
    if metadata.awb_cct_k is None:
        return {}
    computed = {"cct": _tidy(metadata.awb_cct_k), "gain": _sites(metadata.white_balance)}
    return {"awb": {"roi": "fullFrame", "computed": computed}}


def _f01_public(metadata: FrameMetadata, model: str) -> Json:
    public: Json = {
        "type": "lightField",
        "image": {
            "width": metadata.width,
            "height": metadata.height,
            "orientation": 1,
            "representation": "rawPacked",
            "rawDetails": _raw_details(metadata),
            "color": {
                "ccmRgbToSrgbArray": list(metadata.ccm),
                "gamma": 0.41666001081466675,
                "applied": {},
                "whiteBalanceGain": _sites(metadata.white_balance),
            },
            "modulationExposureBias": _tidy(metadata.exposure_bias_ev),
            "limitExposureBias": 0,
        },
        "devices": {
            "clock": {"zuluTime": metadata.captured_at},
            "sensor": _sensor(metadata),
            "lens": _lens(metadata),
            "ndfilter": {"exposureBias": 0},
            "shutter": _shutter(metadata, "sensorOpenApertureClose"),
            "accelerometer": {"sampleArray": [{"x": 0, "y": 1, "z": 0, "time": 0}]},
            "mla": _mla(metadata),
        },
        "modes": {"creative": "auto"},
        "camera": _camera(metadata, model),
    }
    return public | ({"algorithms": _awb(metadata)} if metadata.awb_cct_k is not None else {})


def _illum_public(metadata: FrameMetadata) -> Json:
    sensor = _sensor(metadata) | {"pixelWidth": metadata.width, "pixelHeight": metadata.height, "baseIso": 80}
    del sensor["iso"]
    return {
        "generator": GENERATOR,
        "schema": f"{_SCHEMAS}/lytro_illum_public/1.3.5/lytro_illum_public_schema.json",
        "camera": _camera(metadata, metadata.model),
        "image": {
            "width": metadata.width,
            "height": metadata.height,
            "orientation": 1,
            "originOnSensor": {"x": 0, "y": 0},
            "iso": _tidy(metadata.iso),
            "modulationExposureBias": metadata.exposure_bias_ev,
            "limitExposureBias": 0,
            **_raw_details(metadata),
            "color": {"whiteBalanceGain": _sites(metadata.white_balance), "ccm": list(metadata.ccm)},
        },
        "devices": {
            "clock": {"zuluTime": metadata.captured_at, "isTimeValid": True},
            "sensor": sensor,
            "shutter": _shutter(metadata, "focalPlaneCurtain") | {"maxSyncSpeed": 0.004},
            "mla": _mla(metadata),
            "lens": _lens(metadata),
            "battery": {"make": "Lytro", "chargeLevel": 100, "model": "B01-3760", "cycleCount": 1},
            "accelerometer": {"samples": [{"x": 0, "y": 9.81, "z": 0, "time": 0}]},
        },
        "settings": _neutral_settings(),
        "algorithms": {
            **_awb(metadata),
            "ae": {"computed": {"ev": 0}, "roi": "followAf", "mode": "live"},
            "af": {"computed": {"focusStep": metadata.lens.focus_step}, "roi": "focusRoi"},
        },
        "picture": {"totalFrames": 1, "frameIndex": 0, "dcfDirectory": "100PHOTO", "dcfFile": "IMG_0001"},
    }


def _neutral_settings() -> Json:
    whole = [{"top": 0, "left": 0, "bottom": 1, "right": 1}]
    bracket = {"bracketEnable": False, "bracketCount": 3, "bracketOffset": 0}
    return {
        "exposure": {
            "mode": "manual",
            "compensation": 0,
            "aeLock": False,
            "meter": {"mode": "evaluative", "roiMode": "af", "roi": whole},
            **bracket,
            "bracketStep": 1,
        },
        "whiteBalance": {"mode": "auto", "cct": 5100, "tint": 0},
        "shutter": {"driveMode": "single", "selfTimerEnable": False, "selfTimerDuration": 2},
        "focus": {
            "mode": "manual",
            "afActuationMode": "single",
            "afDriveMode": "single",
            "ringLock": False,
            "roi": whole,
            "captureLambda": 0,
            **bracket,
            "bracketStep": 3,
        },
        "zoom": {"ringLock": False},
        "flash": {
            "mode": "unknown",
            "zoomMode": "auto",
            "exposureCompensation": 0,
            "curtainTriggerSync": "front",
            "afAssistMode": "auto",
        },
        "depth": {"assist": "off", "histogram": "off", "overlay": "off"},
    }
