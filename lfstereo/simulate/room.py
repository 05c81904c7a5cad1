"""A random table-top scene inside the working range of a rig."""

from __future__ import annotations

import math

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.simulate import props
from lfstereo.simulate import texture as paint
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.primitives import PATCH
from lfstereo.simulate.props import Rows, Stand
from lfstereo.simulate.rigs import SimulatedRig
from lfstereo.simulate.scene import Scene, Surface, primitive, room_light, with_shadows

_REFERENCE_VIEW = 0.2636
"""Half width of the view at 1 m for which the props' sizes are meant: a full sensor at f = 20 mm."""
_REFERENCE_DEPTH_M = 0.8
_REFERENCE_RANGE_M = 0.6
"""Mid-range and length of the range for which they are meant: 0.6 to 1.2 m."""
_CROOKED = 0.006
"""Slope by which the views of a crooked rig may reach beyond those of a straight one."""


def room(options: SimulateOptions, rig: SimulatedRig) -> Scene:
    """Lay a table in front of a wall, all between near and far; in left camera axes.

    Sizes across the view follow the field of view, so that a small sensor sees the same picture; depths do not.
    """
    rng = np.random.default_rng([options.seed, 0x5CE])
    width, height = rig.left.sensor_px
    across, down = width / 2 / rig.left.focal_px, height / 2 / rig.left.focal_px
    table = _Table(options, across, down)
    rows = [table.row(rng), _wall(options, across, down, rng), _backdrop(options)]
    for build, x, depth, size in _layout(rng):
        rows += build(table.stand(x, depth, size), rng)
    for x, depth, drop, size in ((-0.5, 0.18, 0.42, 0.10), (0.6, 0.40, 0.5, 0.12)):
        rows += props.pendant(table.hanging(x + rng.uniform(-0.05, 0.05), depth, drop, size), rng)
    rows += _pictures(options, across, down, rng)
    light = room_light((-0.55 + 0.2 * rng.uniform(), -0.75, -0.55), table.plane(), 0.035 * table.unit)
    scene = with_shadows(np.stack(rows), light, (0, 1))
    return scene.seen_from(rig.left_from_bar[:, :3], rig.left_from_bar[:, 3])


def _layout(rng: np.random.Generator) -> list[tuple[props.Builder, float, float, float]]:
    """Return what stands where: (thing, x of the half view, depth of the range, height in m); nothing twice."""
    places = {
        "low": ((-0.66, 0.10, 0.075), (0.52, 0.13, 0.085), (-0.06, 0.20, 0.06)),
        "middle": ((-0.30, 0.42, 0.125), (0.34, 0.50, 0.14)),
        "tall": ((-0.74, 0.62, 0.235), (0.06, 0.76, 0.27), (0.74, 0.70, 0.25)),
    }
    layout = []
    for group, builders in (("low", props.LOW), ("middle", props.MIDDLE), ("tall", props.TALL)):
        order = rng.permutation(len(builders))
        for number, (x, depth, size) in enumerate(places[group]):
            moved = x + rng.uniform(-0.05, 0.05), depth + rng.uniform(-0.02, 0.02), size * rng.uniform(0.92, 1.08)
            layout.append((builders[int(order[number])], *moved))
    return layout


class _Table:
    """The slanted table top in bar axes."""

    def __init__(self, options: SimulateOptions, across: float, down: float) -> None:
        self.near, self.far = options.near_m, options.far_m
        self.across, self.down, self.unit = across, down, across / _REFERENCE_VIEW
        middle = 2 / (1 / self.near + 1 / self.far)
        # As large as the view at mid-range allows, but never thicker than the working range does.
        self.size = min(self.unit * middle / _REFERENCE_DEPTH_M, (self.far - self.near) / _REFERENCE_RANGE_M)
        self.baseline = options.baseline_m
        self.front = np.array([0.0, (1.04 * down + _CROOKED) * self.near, self.near])
        self.back = np.array([0.0, 0.30 * down * self.far, self.far])
        along = (self.back - self.front) / np.linalg.norm(self.back - self.front)
        self.axes = np.array([[1.0, 0.0, 0.0], [0.0, along[2], -along[1]], along])

    def row(self, rng: np.random.Generator) -> Float64:
        seed = int(rng.integers(1, 9999))
        wood = Surface(paint.WOOD, ("#a8754a", "#7a4e2e", "#c99a68"), 0.035 * self.unit, 0.3, seed)
        cloth = Surface(paint.WEAVE, ("#5a7480", "#c8c2b0", "#303a40"), 0.012 * self.unit, 0.3, seed)
        stone = Surface(paint.TERRAZZO, ("#c9c1b4", "#6a6258", "#a45a44"), 0.016 * self.unit, 0.2, seed)
        surface = (wood, cloth, stone)[int(rng.integers(3))]
        half = (1.35 * self.across * self.far + self.baseline, float(np.linalg.norm(self.back - self.front)) / 2, 1.0)
        axes = np.stack([self.axes[0], -self.axes[2], self.axes[1]])
        return primitive(PATCH, (self.front + self.back) / 2, axes, half, surface)

    def plane(self) -> tuple[float, float, float, float]:
        up = -self.axes[1]
        return float(up[0]), float(up[1]), float(up[2]), float(up @ self.front)

    def stand(self, x: float, depth: float, size: float) -> Stand:
        z = self.near + depth * (self.far - self.near)
        share = (z - self.near) / (self.far - self.near)
        foot = self.front + share * (self.back - self.front) + [x * self.across * z, 0.0, 0.0]
        return Stand(foot, self.axes, size * self.size)

    def hanging(self, x: float, depth: float, drop: float, size: float) -> Stand:
        z = self.near + depth * (self.far - self.near)
        return Stand(np.array([x * self.across * z, -self.down * z * drop, z]), np.eye(3), size * self.size)


def _wall(options: SimulateOptions, across: float, down: float, rng: np.random.Generator) -> Float64:
    """Return the wall, slightly turned, its far edge at the far end of the range."""
    half = (1.3 * across * options.far_m + options.baseline_m, 1.4 * down * options.far_m, 1.0)
    turn = float(rng.choice([-1.0, 1.0])) * rng.uniform(0.03, 0.06)
    c, s = math.cos(turn), math.sin(turn)
    centre = (0.0, 0.0, options.far_m * 0.985 - half[0] * abs(s))
    unit, seed = across / _REFERENCE_VIEW, int(rng.integers(1, 9999))
    brick = Surface(paint.BRICK, ("#9a5a44", "#b87a5c", "#c8bfb0"), 0.026 * unit, 0.4, seed)
    tiles = Surface(paint.CHECKER, ("#6f8f96", "#cfd3c8", "#404a4c"), 0.04 * unit, 0.35, seed)
    plaster = Surface(paint.MARBLE, ("#b9a88c", "#8c9a86", "#d8ccb4"), 0.16 * unit, 0.45, seed)
    paper = Surface(paint.STRIPE, ("#8d8f78", "#b9b596", "#6f6248"), 0.06 * unit, 0.4, seed)
    axes = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    kind = int(rng.integers(4))
    if kind == 3:  # wallpaper hangs with its stripes upright
        axes, half = np.stack([axes[1], -axes[0], axes[2]]), (half[1], half[0], 1.0)
    return primitive(PATCH, centre, axes, half, (brick, tiles, plaster, paper)[kind])


def _backdrop(options: SimulateOptions) -> Float64:
    """Return what closes the room off behind everything, so that every ray ends."""
    far = options.far_m
    surface = Surface(paint.MOTTLED, ("#6a6a62", "#8c8a7e", "#504e48"), 0.05, 0.3, 3)
    return primitive(PATCH, (0.0, 0.0, 0.999 * far), np.eye(3), (3 * far, 3 * far, 1.0), surface)


def _pictures(options: SimulateOptions, across: float, down: float, rng: np.random.Generator) -> Rows:
    """Return framed pictures a little before the wall."""
    rows = []
    z = options.far_m * 0.925
    for x, y in ((-0.36, -0.58), (0.42, -0.62)):
        half = (0.17 * across * z * rng.uniform(0.9, 1.15), 0.24 * down * z * rng.uniform(0.9, 1.1), 1.0)
        skies = (("#7fb0d6", "#5d7f86", "#2f4a2c"), ("#e0a878", "#8a5a6a", "#3a2a40"))
        seed = int(rng.integers(1, 9999))
        paper = Surface(paint.LANDSCAPE, skies[int(rng.integers(2))], 0.1 * half[0], 0.15, seed)
        wood = Surface(paint.WOOD, ("#4a3020", "#2c1c12", "#6a4a30"), 0.1 * half[0], 0.2, seed)
        centre = np.array([x * across * z, y * down * z, z])
        frame = (1.14 * half[0], half[1] + 0.14 * half[0], 1.0)
        rows.append(primitive(PATCH, centre + np.array([0, 0, 0.004]), np.eye(3), frame, wood))
        rows.append(primitive(PATCH, centre, np.eye(3), half, paper))
    return rows
