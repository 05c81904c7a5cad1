"""Draw raw frames of light fields that are known in closed form: a flat texture at one slope, seen through lenslets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.container import Capture
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import LightField

PITCH_PX = 14.3
STEP_PX = PITCH_PX * np.sqrt(3) / 2 / 14
"""Sensor px between the toolbox's views."""
BLACK, WHITE, PEAK = 64.0, 1023.0, 700.0
RESPONSES = (0.776, 1.0, 0.734)
"""Red, green and blue of an Illum's white image."""


@dataclass(frozen=True, slots=True)
class Waves:
    """A texture of many plane waves; each colour has a share of its own."""

    frequency: Float64
    """``(N, 2)`` radians per row of lenslets."""
    amplitude: Float64
    phase: Float64
    """``(4, N)``: of what the colours share, and of each colour's own part."""
    own_share: float
    """Of the variance."""

    @classmethod
    def between(cls, low: float, high: float, own_share: float, seed: int, contrast: float = 0.15) -> Waves:
        """Return waves of frequencies from ``low`` to ``high`` cycles per row of lenslets, about grey 0.5."""
        rng = np.random.default_rng(seed)
        count = 24
        length = 2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high), count))
        turn = rng.uniform(0, 2 * np.pi, count)
        return cls(
            frequency=length[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1),
            amplitude=np.full(count, contrast * np.sqrt(2 / count)),
            phase=rng.uniform(0, 2 * np.pi, (4, count)),
            own_share=own_share,
        )

    def __call__(self, x: Float64, y: Float64) -> Float64:
        """Return ``(..., 3)`` colours at places in rows of lenslets."""
        total = np.full((*x.shape, 3), 0.5)
        for n, (kx, ky) in enumerate(self.frequency):
            angle = kx * x + ky * y
            total += (self.amplitude[n] * np.sqrt(1 - self.own_share) * np.sin(angle + self.phase[0, n]))[..., None]
            if self.own_share:
                own = np.sin(angle[..., None] + self.phase[1:, n])
                total += self.amplitude[n] * np.sqrt(self.own_share) * own
        return total


@dataclass(frozen=True, slots=True)
class KnownFrame:
    """A photograph, its white image, its grid, and what every view shows."""

    photograph: Capture
    white: Capture
    grid: LensletGrid
    texture: Waves
    parallax: float
    """Px on the lattice per px inside a micro-image."""

    def view(self, field: LightField, t: int, s: int) -> Float64:
        """Return what a view shows, ``(V, U, 3)``, at the places that the light field itself tells."""
        a = field.sampling
        assert a is not None
        v, u = np.mgrid[: field.views.shape[2], : field.views.shape[3]]
        t0, s0 = field.centre
        x = u * a.step_px[0] + self.parallax * (s - s0) * a.view_step_px
        y = v * a.step_px[1] + self.parallax * (t - t0) * a.view_step_px
        cos, sin = np.cos(a.rotation_rad), np.sin(a.rotation_rad)
        row = PITCH_PX * np.sqrt(3) / 2
        return self.texture((a.origin_px[0] + cos * x - sin * y) / row, (a.origin_px[1] + sin * x + cos * y) / row)


def draw(texture: Waves, slope: float, leak_px: float = 0.0, noise_dn: float = 1.0, size: int = 400) -> KnownFrame:
    """Photograph a texture.

    Parameters
    ----------
    texture
        What is seen.
    slope
        Rows of lenslets per step between the toolbox's views.
    leak_px
        Softness of the micro-images' rim, which then reaches into the next ones; 0 lets none through.
    noise_dn
        Standard deviation of the sensor's noise.
    size
        Px of the frame's sides.
    """
    grid = _grid(size)
    down = np.asarray(grid.step_v_px) + 0.5 * np.asarray(grid.step_u_px)
    matrix = np.stack([grid.step_u_px, down], axis=1)
    row = PITCH_PX * np.sqrt(3) / 2
    parallax = slope * row / STEP_PX
    y, x = np.mgrid[:size, :size].astype(np.float64)
    index = np.floor((np.stack([x, y], -1) - grid.origin_px) @ np.linalg.inv(matrix).T)
    centres = np.stack([grid.origin_px + (index + c) @ matrix.T for c in ((0, 0), (1, 0), (0, 1), (1, 1))])
    distance = np.hypot(x - centres[..., 0], y - centres[..., 1])
    order = np.argsort(distance, axis=0)
    light, shading = np.zeros((size, size, 3)), np.zeros((size, size))
    for rank in range(2 if leak_px else 1):
        centre = np.take_along_axis(centres, order[rank][None, ..., None], 0)[0]
        dx, dy = x - centre[..., 0], y - centre[..., 1]
        radius = np.hypot(dx, dy)
        part = 1 / (1 + np.exp((radius - 0.48 * PITCH_PX) / (leak_px or 0.3)))
        part *= 1 - 0.15 * (2 * radius / PITCH_PX) ** 2
        shading += part
        seen = texture((centre[..., 0] + parallax * dx) / row, (centre[..., 1] + parallax * dy) / row)
        light += part[..., None] * seen
    rng = np.random.default_rng(5)
    sites = np.tile([[1, 0], [2, 1]], (size // 2, size // 2))
    own = np.take_along_axis(light, sites[..., None], 2)[..., 0]
    return KnownFrame(
        _capture(own, rng, noise_dn, False), _capture(shading, rng, noise_dn, True), grid, texture, parallax
    )


def _grid(size: int) -> LensletGrid:
    row, rotation = PITCH_PX * np.sqrt(3) / 2, 0.002
    cos, sin = np.cos(rotation), np.sin(rotation)
    rows, columns = int((size - 16) / row), int((size - 16) / PITCH_PX - 0.5)
    step_u, step_v = (PITCH_PX * cos, PITCH_PX * sin), (-row * sin, row * cos)
    return LensletGrid((8.37, 6.81), step_u, step_v, 1, rows, columns, (size, size), 0.0, 1.0, "given")


def _capture(light: Float64, rng: np.random.Generator, noise_dn: float, is_white: bool) -> Capture:
    size = light.shape[0]
    metadata = replace(
        read_camera_profile("lytro-illum"),
        width=size,
        height=size,
        black=(BLACK,) * 4,
        white=(WHITE,) * 4,
        bayer="grbg",
        white_balance=(1 / RESPONSES[0], 1.0, 1.0, 1 / RESPONSES[2]),
        ccm=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        exposure_bias_ev=0.0,
        is_white_image=is_white,
        is_dark_frame=False,
    )
    response = np.asarray(RESPONSES)[np.tile([[1, 0], [2, 1]], (size // 2, size // 2))]
    numbers = BLACK + PEAK * light * response + rng.normal(0, noise_dn, light.shape)
    return Capture(np.clip(np.rint(numbers), 0, 1023).astype(np.uint16), metadata, "drawn frame")
