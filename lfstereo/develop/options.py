"""Options of the development of a raw mosaic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lfstereo.options import option

Primaries = Literal["srgb", "display-p3", "prophoto"]
"""What the three numbers of linear light stand for."""
ColourSpace = Literal["srgb", "linear", "display-p3", "prophoto"]
"""Primaries and transfer curve of a picture; ``linear`` has those of sRGB and no curve."""
DemosaicMethod = Literal["micro-images", "david2017", "malvar2004", "menon2007", "bilinear", "opencv-edge-aware"]


@dataclass(frozen=True, slots=True)
class DevelopOptions:
    """How a raw mosaic becomes linear RGB."""

    demosaic: DemosaicMethod = option(
        "micro-images", "how missing colours are found: per micro-image, straight to the views, or on the whole mosaic"
    )
    white_balance: Literal["camera", "grey-world"] = option("camera", "gains that the camera wrote, or a grey mean")
    shading_floor: float = option(0.05, "least relative illumination that devignetting divides by")
    hot_pixels: bool = option(True, "repair pixels that their neighbours of the same colour contradict")
    hot_pixel_excess: float = option(0.5, "relative distance from the neighbours' range that makes a pixel hot")
    exposure_bias: bool = option(True, "apply the camera's exposure bias")
    colour_matrix: bool = option(True, "turn camera colours into linear RGB of the colour space")
    temperature_k: float | None = option(
        None, "light's colour temperature, to interpolate the factory's colour matrices; none = as the camera did", "K"
    )
    colour_space: Primaries = option("srgb", "primaries of the light field; wide ones keep colours outside sRGB")
