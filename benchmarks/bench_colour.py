"""Photograph a chart of 24 patches with the simulated sensor, decode it, and print what is left of its colours.

Run ``python benchmarks/bench_colour.py``, or with ``--full`` at the full size of the sensor (several minutes). The
target is a mean difference of 2 (CIEDE2000) per chart, and greys that stay neutral however far they are overexposed.

Two sensors: one that obeys its colour matrix, and one with the measured sensitivities of a real camera, whose matrices
were fitted to 99 other surfaces under 2850, 4150 and 6500 K as a factory would. No matrix is right for the second.
"""

from __future__ import annotations

import argparse
import io
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image

from lfstereo.arrays import Float64
from lfstereo.container import Capture
from lfstereo.container.jpeg_mosaic import restore_mosaic
from lfstereo.container.metadata import FrameMetadata
from lfstereo.develop.colour_spaces import conversion
from lfstereo.develop.options import DevelopOptions
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.decoding import calibrate, views_from
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.options import DecodeOptions
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.capture import take_white_image
from lfstereo.simulate.chart import patch_means, photograph_chart
from lfstereo.simulate.frame_metadata import picture_metadata
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig
from lfstereo.simulate.sensor import picture_filters
from lfstereo.simulate.spectral_camera import describe, photograph_spectra, sensor_filters

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour

XYZ_FROM_SRGB: Float64 = np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ, np.float64)
RINGS = (3.2, 5.2, 6.3, 7.2)
WIDE = DevelopOptions(colour_space="prophoto")


class Bench:
    """A camera with its white image processed."""

    def __init__(self, full: bool) -> None:
        self.options = SimulateOptions(sensor="illum" if full else "small")
        rig = build_rig(self.options)
        white = take_white_image(rig, "left", self.options)
        self.camera: SimulatedCamera = rig.left
        self.grid: LensletGrid
        self.grid, self.shading = calibrate(white, white)
        self.metadata = picture_metadata(rig.left, "left")

    def decode(
        self, colours: Float64, filters: Float64, metadata: FrameMetadata, develop: DevelopOptions
    ) -> tuple[Float64, LightField]:
        """Return the mean colours ``(T, S, 24, 3)`` and the light field."""
        capture = photograph_chart(colours, filters, metadata, self.camera, self.options)
        found = views_from(capture, self.grid, self.shading, DecodeOptions(develop=develop))
        return patch_means(found, self.camera), found


def difference(means: Float64, true_xyz: Float64) -> Float64:
    """Return CIEDE2000 of linear ProPhoto colours."""
    xyz = means @ (XYZ_FROM_SRGB @ conversion("prophoto", "srgb")).T
    found: Float64 = colour.delta_E(_lab(xyz), _lab(true_xyz), method="CIE 2000")
    return found


def _lab(xyz: Float64) -> Any:
    return colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(XYZ_FROM_SRGB.sum(1)))


def report(name: str, bench: Bench, colours: Float64, filters: Float64, metadata: FrameMetadata, xyz: Float64) -> None:
    """Decode one chart and print its figures."""
    means, found = bench.decode(colours, filters, metadata, WIDE)
    error = difference(means, xyz)
    centre = error[found.centre]
    rows, columns = found.views.shape[:2]
    print(f"{name}: {rows} x {columns} views of {found.views.shape[3]} x {found.views.shape[2]} px")
    for row in centre.reshape(4, 6):
        print("    " + "".join(f"{value:6.2f}" for value in row))
    t0, s0 = found.centre
    radius = np.hypot(*np.mgrid[-t0 : rows - t0, -s0 : columns - s0])
    apart = difference(means, means[found.centre] @ (XYZ_FROM_SRGB @ conversion("prophoto", "srgb")).T).mean(2)
    print(f"    centre view: mean {centre.mean():.2f}, largest {centre.max():.2f}; all views by distance from it:")
    for inner, outer in zip((0.0, *RINGS[:-1]), RINGS, strict=True):
        ring = (radius >= inner) & (radius < outer)
        print(
            f"    {inner:.1f} to {outer:.1f} steps, {ring.sum():3d} views: to the truth "
            f"{error.mean(2)[ring].mean():.2f}, worst view {error.mean(2)[ring].max():.2f}; to the centre view "
            f"{apart[ring].mean():.2f}"
        )


def grey_ramp(bench: Bench) -> None:
    """Print how neutral greys stay that are exposed up to eight times white."""
    levels = np.geomspace(0.05, 8.0, 24)
    colours = np.repeat(levels[:, None], 3, axis=1)
    means, found = bench.decode(colours, picture_filters(bench.metadata), bench.metadata, DevelopOptions())
    centre = means[found.centre]
    print("grey ramp in the centre view: level exposed, level found, spread of the three colours in % of it")
    for level, value in zip(levels[::2], centre[::2], strict=True):
        print(f"    {level:6.2f}{value.mean():8.3f}{100 * np.ptp(value) / value.mean():7.1f}")


def jpeg_mosaic(bench: Bench, colours: Float64, xyz: Float64) -> None:
    """Print what is left of the chart after its mosaic was stored as a JPEG of 8 bits."""
    meta = bench.metadata
    raw = photograph_chart(colours, picture_filters(meta), meta, bench.camera, bench.options).mosaic
    eight = np.rint(16 + (raw.astype(np.float64) - 64) / (1023 - 64) * (255 - 16)).clip(0, 255).astype(np.uint8)
    red, green, _, blue = (1 / gain for gain in meta.white_balance)
    white = {"r": red, "g": green, "b": blue}
    b0, b1, b2, b3 = (white[colour] for colour in meta.bayer)
    levels = replace(meta, black=(256.0,) * 4, white=(4080.0,) * 4, bits_per_pixel=16)
    print("mosaic stored as JPEG: mean of the 24 patches in the centre view, as decompressed and restored")
    for quality in (75, 90, 100):
        stored = io.BytesIO()
        Image.fromarray(eight).save(stored, "JPEG", quality=quality)
        picture = Image.open(stored)
        pixels, steps = np.array(picture), np.reshape(picture.quantization[0], (8, 8))  # type: ignore[attr-defined]
        errors = []
        for mosaic in (pixels.astype(np.float32), restore_mosaic(pixels, steps, 16.0, (b0, b1, b2, b3))):
            numbers = np.rint(16 * mosaic).clip(0, 4080).astype(np.uint16)
            views = views_from(Capture(numbers, levels, "jpeg"), bench.grid, bench.shading, DecodeOptions(develop=WIDE))
            errors.append(difference(patch_means(views, bench.camera), xyz)[views.centre].mean())
        print(f"    quality {quality:3d}: {errors[0]:.1f} and {errors[1]:.1f}")


def main() -> None:
    """Print a block per chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="full sensor size, one light instead of four")
    full = parser.parse_args().full
    bench = Bench(full)
    chart = colour.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"]
    xyz = colour.xyY_to_XYZ(np.array(list(chart.data.values())))
    adapt = colour.adaptation.matrix_chromatic_adaptation_VonKries
    xyz = xyz @ adapt(colour.xy_to_XYZ(chart.illuminant), XYZ_FROM_SRGB.sum(1), transform="Bradford").T
    srgb = xyz @ np.linalg.inv(XYZ_FROM_SRGB).T
    report("sensor that obeys its matrix", bench, srgb, picture_filters(bench.metadata), bench.metadata, xyz)
    for kelvin in (5200.0,) if full else (2850.0, 3505.0, 5200.0, 6500.0):
        shot = photograph_spectra(kelvin)
        metadata = describe(bench.metadata, shot, kelvin, 0.9)
        name = f"measured sensitivities, {kelvin:.0f} K"
        report(name, bench, shot.responses, sensor_filters(metadata), metadata, shot.true_xyz)
    grey_ramp(bench)
    if not full:
        jpeg_mosaic(bench, srgb, xyz)


if __name__ == "__main__":
    main()
