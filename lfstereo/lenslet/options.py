"""Options of the grid fit."""

from __future__ import annotations

from dataclasses import dataclass

from lfstereo.options import option


@dataclass(frozen=True, slots=True)
class GridOptions:
    """How the lenslet grid is fitted and when it is refused."""

    passes: int = option(10, "rounds of measuring centres and refitting the lattice, at most")
    template_share: float = option(0.3, "part of the frame's width and height that gives the mean micro-image")
    white_shading_per_px: float = option(0.05, "allowed shading across the micro-images of a white image", "1/px")
    photograph_shading_per_px: float = option(0.01, "allowed shading across those of a photograph", "1/px")
    trusted_field: float = option(0.45, "field, of the half diagonal, whose micro-images the lens does not cut")
    least_quality: float = option(0.5, "smallest share of lenslets that must agree with the lattice")
    largest_unevenness: float = option(0.12, "largest median brightness change between neighbours in a white image")
    least_brightness: float = option(0.03, "smallest mean brightness of a white image, white level = 1")
    largest_uncertainty_px: float = option(0.3, "largest standard error of the lattice over the sensor", "px")
    field_degree: int = option(0, "degree of a smooth departure from the straight lattice; 0 = straight")
    largest_offset_px: float = option(0.5, "largest distance of a white image's grid from a picture's own", "px")
