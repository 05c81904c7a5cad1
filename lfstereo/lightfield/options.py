"""Options of the decode: of the views, and of the steps before them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from lfstereo.develop.options import ColourSpace, DevelopOptions
from lfstereo.lenslet.options import GridOptions
from lfstereo.options import option

DecodeMethod = Literal["direct", "lftoolbox"]


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """Which views are taken from the micro-images."""

    view_step_px: float = option(0.884, "distance between neighbouring views inside a micro-image", "sensor px")
    views: int = option(0, "views per direction, odd; 0 = as many as the micro-images hold")
    upsampling: int = option(1, "view pixels per row of lenslets, 1 to 4; the memory grows with its square")
    interpolation: Literal["kriging", "barycentric"] = option(
        "kriging", "how the hexagonal lattice of lenslets becomes square pixels: best linear estimate, or triangles"
    )


@dataclass(frozen=True, slots=True)
class DecodeOptions:
    """How a raw capture becomes a light field."""

    method: DecodeMethod = option(
        "direct", "one careful resampling, or the numbers of the Light Field Toolbox for MATLAB"
    )
    view: ViewOptions = field(default_factory=ViewOptions)
    grid: GridOptions = field(default_factory=GridOptions)
    develop: DevelopOptions = field(default_factory=DevelopOptions)


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """How the linear light of a view becomes a picture."""

    colour_space: ColourSpace = option("srgb", "primaries and curve of the pictures")
    highlights: Literal["clip", "soft"] = option("clip", "values above white: cut off, or bent below it from 0.8 on")
    exposure_ev: float = option(0.0, "brighten the pictures; negative makes room for highlights above white", "EV")
