"""The table that describes a scene: one row per layer, one column per property."""

from __future__ import annotations

import enum


class Column(enum.IntEnum):
    """Columns of the layer table."""

    SHAPE = 0  # index into SHAPES
    CX = 1  # centre, px of the left view
    CY = 2
    HALF_W = 3  # half size, px
    HALF_H = 4
    COS = 5  # turn of the silhouette
    SIN = 6
    D = 7  # disparity at the centre, px
    D_X = 8  # its slope
    D_Y = 9
    BUMP = 10  # how far the surface falls back towards the rim, px of disparity
    RIPPLE = 11  # amplitude, px of disparity
    WAVE_X = 12  # rad per px
    WAVE_Y = 13
    PHASE = 14
    POINTS = 15  # points of a star, teeth of a comb
    DEPTH = 16  # depth of a star's notches, width of a frame, duty of a comb
    TEXTURE = 17  # index into the bank
    TEX_COS = 18  # texels per px, turned
    TEX_SIN = 19
    TEX_U = 20
    TEX_V = 21
    GAIN = 22  # three channels
    OFFSET = 25  # three channels
    COUNT = 28


SHAPES = ("everywhere", "box", "ellipse", "star", "frame", "comb")
NEWTON_STEPS = 3
"""Steps with which a ray meets a curved surface."""
