"""Options of the grid fit."""

from __future__ import annotations

from dataclasses import dataclass

from lfstereo.options import option


@dataclass(frozen=True, slots=True)
class GridOptions:
    """How the lenslet grid is fitted and when it is refused."""

    passes: int = option(4, "rounds of measuring centres and refitting the lattice")
    template_share: float = option(0.5, "part of the frame's width and height that gives the mean micro-image")
    least_quality: float = option(0.5, "smallest share of lenslets that must agree with the lattice")
    largest_unevenness: float = option(0.12, "largest median brightness change between neighbours in a white image")
    least_brightness: float = option(0.03, "smallest mean brightness of a white image, white level = 1")
