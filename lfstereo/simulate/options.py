"""Options of the simulator: what lies in front of the rig, and the rig itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lfstereo.errors import ConfigError
from lfstereo.options import option

SensorName = Literal["illum", "small"]


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """A simulated capture of a dual-Illum rig."""

    seed: int = option(7, "scene and noise; the same seed gives the same bytes")
    sensor: SensorName = option("illum", "sensor profile: the real Illum, or a fifth of it in both directions")
    focal_length_m: float = option(0.020, "focal length of the main lenses", "m")
    f_number: float = option(2.0, "aperture of the main lenses")
    focus_m: float = option(0.85, "depth on which both main lenses are focused", "m")
    distortion_k1: float = option(0.0, "radial distortion of both lenses: r (1 + k1 r^2), r = tangent off the axis")
    baseline_m: float = option(0.095, "distance between the two pupils", "m")
    near_m: float = option(0.60, "near end of the working range", "m")
    far_m: float = option(1.20, "far end of the working range, where the background is", "m")
    samples: int = option(4, "rays per sensor pixel")
    exposure: float = option(1.0, "light of the pictures; at 1, white is just below the white level")
    noise: bool = option(True, "photon noise, read noise and hot pixels")
    full_well_e: float = option(5000.0, "electrons that a pixel holds at the white level", "e-")
    read_noise_dn: float = option(1.5, "standard deviation of the read noise", "DN")
    hot_pixels: int = option(300, "stuck bright pixels per camera")
    boards: int = option(0, "number of calibration shots of a checkerboard to add")
    board_corners: tuple[int, int] | None = option(None, "inner corners of the board, across and down")
    board_square_m: float | None = option(None, "side of one square of the board", "m")

    def __post_init__(self) -> None:
        optics = ("focal_length_m", "f_number", "focus_m", "baseline_m", "near_m")
        for name in (*optics, "samples", "exposure", "full_well_e"):
            _check(name, getattr(self, name), getattr(self, name) > 0, "a positive number")
        for name in ("read_noise_dn", "hot_pixels", "boards", "seed"):
            _check(name, getattr(self, name), getattr(self, name) >= 0, "zero or more")
        _check("far_m", self.far_m, self.far_m > self.near_m, f"more than near_m = {self.near_m}")
        _check("focal_length_m", self.focal_length_m, self.focal_length_m < 0.5 * self.near_m, "under half of near_m")
        _check("focus_m", self.focus_m, self.focus_m > 2 * self.focal_length_m, "over twice the focal length")
        _check("samples", self.samples, self.samples <= 1024, "at most 1024")
        _check("boards", self.boards, self.boards <= 99, "at most 99")
        _check("f_number", self.f_number, self.f_number >= 1.8, "1.8 or more, or micro-images overlap")
        _check("distortion_k1", self.distortion_k1, abs(self.distortion_k1) <= 0.5, "-0.5 to 0.5")
        if self.board_square_m is not None:
            _check("board_square_m", self.board_square_m, self.board_square_m > 0, "a positive number")


def _check(name: str, value: object, good: bool, expected: str) -> None:
    if not good:
        raise ConfigError(f"{name} = {value}, expected {expected}; correct the option")
