"""Options of the decode: of the views, and of the steps before them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from lfstereo.develop.options import DevelopOptions
from lfstereo.lenslet.options import GridOptions
from lfstereo.options import option

DecodeMethod = Literal["direct", "lftoolbox"]


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """Which views are taken from the micro-images."""

    view_step_px: float = option(0.884, "distance between neighbouring views inside a micro-image", "sensor px")
    views: int = option(0, "views per direction, odd; 0 = as many as the micro-images hold")


@dataclass(frozen=True, slots=True)
class DecodeOptions:
    """How a raw capture becomes a light field."""

    method: DecodeMethod = option(
        "direct", "one careful resampling, or the numbers of the Light Field Toolbox for MATLAB"
    )
    view: ViewOptions = field(default_factory=ViewOptions)
    grid: GridOptions = field(default_factory=GridOptions)
    develop: DevelopOptions = field(default_factory=DevelopOptions)
