"""Raw capture to light field: grid, develop, resample."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfstereo.arrays import Float32, UInt16
from lfstereo.container.capture import Capture
from lfstereo.container.serials import camera_mark, same_camera
from lfstereo.develop.develop import develop, develop_mosaic, output_matrix
from lfstereo.develop.shading import shading_from_photograph, shading_from_white_image
from lfstereo.errors import AssetError, ConfigError
from lfstereo.lenslet.fit import estimate_grid_from_photograph
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.remembered_grid import remembered_grid
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.lftoolbox import decode_as_lftoolbox
from lfstereo.lightfield.micro_images import MicroImages, micro_image_operators
from lfstereo.lightfield.options import DecodeOptions, ViewOptions
from lfstereo.lightfield.resample import LensletImage, LensletReader, offsets_inside, sample_views, view_sampling
from lfstereo.progress import Progress, silent

_RIM_PX = 0.8
"""Width of a micro-image's dark rim that no view is taken from."""


def decode(
    capture: Capture,
    white: Capture | None,
    options: DecodeOptions = DecodeOptions(),
    progress: Progress = silent,
) -> LightField:
    """Decode a raw capture to its views.

    Parameters
    ----------
    capture
        The photograph.
    white
        White image of the same camera at a like zoom and focus; ``None`` takes the lenslet grid and the
        illumination of the micro-images from the photograph.
    options
        Number and distance of the views, and the options of each step.
    progress
        Told of the work done, in hundredths.

    Returns
    -------
    The light field: ``(15, 15, 434, 625, 3)`` for an Illum, about ``(9, 9, 382, 382, 3)`` for a first-generation
    camera. Values are linear RGB, not below 0 and not clipped above 1; views beyond the micro-images' radius are
    black with weight 0.

    Raises
    ------
    AssetError
        If the white image is of another camera or size.
    GridFitError
        If the white image is none, or no grid can be fitted.
    ConfigError
        If the number of views or their distance cannot be, or the toolbox's method is asked for something it lacks.
    MetadataError
        If the colour matrix cannot be used.
    """
    check_method(options, white)
    grid, shading = calibrate(capture, white, options.grid, part_of(progress, 0, 25))
    if options.method == "lftoolbox" and white is not None:
        del shading
        return decode_as_lftoolbox(capture, white, grid, part_of(progress, 25, 100))
    return views_from(capture, grid, shading, options, part_of(progress, 25, 100))


def check_method(options: DecodeOptions, white: Capture | None) -> None:
    """Refuse what the toolbox's method cannot do, before any work is done.

    Raises
    ------
    AssetError
        If it has no white image.
    ConfigError
        If it is given options of the views or of the development, which it fixes.
    """
    if options.method != "lftoolbox":
        return
    if white is None:
        raise AssetError("method lftoolbox: found no white image, expected one; give --whites, or use method direct")
    for name, given in (("views", options.view), ("development", options.develop)):
        if given != type(given)():
            raise ConfigError(
                f"method lftoolbox: found options of the {name} ({given}), expected none as the method fixes them; "
                "leave them out, or use method direct"
            )


def views_from(
    capture: Capture,
    grid: LensletGrid,
    shading: Float32,
    options: DecodeOptions = DecodeOptions(),
    progress: Progress = silent,
    hot_pixels: UInt16 | None = None,
) -> LightField:
    """Develop a capture and read its views, with a known grid and illumination; as in :func:`decode`.

    Parameters
    ----------
    capture
        The photograph.
    grid
        Its lenslet grid.
    shading
        ``(H, W)`` float32 relative illumination of its pixels, 1 = full light.
    options
        Number and distance of the views, and how the mosaic is developed.
    progress
        Told of the work done, in hundredths.
    hot_pixels
        ``(N, 2)`` (x, y) pixels that are known to be bad.
    """
    count = view_count(grid, options.view)
    upsampling, interpolation = options.view.upsampling, options.view.interpolation
    sampling = view_sampling(grid, options.view.view_step_px, upsampling)
    offsets = offsets_inside(grid, sampling, count)
    read: LensletReader
    if options.develop.demosaic == "micro-images":
        bayer, matrix = capture.metadata.bayer, output_matrix(capture.metadata, options.develop)
        with ThreadPoolExecutor(max_workers=1) as beside:
            mosaic = beside.submit(develop_mosaic, capture, shading, options.develop, hot_pixels)
            operators = micro_image_operators(grid, offsets, bayer, matrix)
        read = MicroImages(mosaic.result(), shading, grid.centres(), operators)
    else:
        picture = develop(capture, shading, options.develop, hot_pixels, grid)
        read = LensletImage(picture, grid.centres(), offsets)
    progress(30, 100)
    part = part_of(progress, 30, 100)
    views, weight = sample_views(read, shading, grid, sampling, count, part, upsampling, interpolation)
    return LightField(
        views=views,
        weight=weight,
        sampling=sampling,
        serial=capture.metadata.serial,
        source=capture.source,
        zoom_step=capture.metadata.lens.zoom_step,
        focus_step=capture.metadata.lens.focus_step,
        colour_space=options.develop.colour_space,
    )


def calibrate(
    capture: Capture, white: Capture | None, options: GridOptions = GridOptions(), progress: Progress = silent
) -> tuple[LensletGrid, Float32]:
    """Find the lenslet grid and the illumination of each pixel, from a white image or the photograph itself.

    Raises
    ------
    AssetError
        If the white image is of another camera or size.
    GridFitError
        If the white image is none, or no grid can be fitted.
    """
    if white is None:
        grid = estimate_grid_from_photograph(capture, options, progress)
        return grid, shading_from_photograph(capture, grid)
    _refuse_other_camera(capture, white)
    return remembered_grid(white, options, progress), shading_from_white_image(white)


def view_count(grid: LensletGrid, options: ViewOptions) -> int:
    """Return the number of views per direction: 15 for an Illum, 9 for a first-generation camera.

    Raises
    ------
    ConfigError
        If the options ask for an even or negative number of views, or for a distance that is not positive, or
        an upsampling that cannot be.
    """
    step = options.view_step_px
    if not 0.1 <= step <= 10:
        raise ConfigError(f"view_step_px: found {step:g}, expected 0.1 to 10 sensor px; leave it out for 0.884")
    if not 1 <= options.upsampling <= 4:
        raise ConfigError(f"upsampling: found {options.upsampling}, expected 1 to 4 view pixels per row of lenslets")
    if options.views:
        if options.views < 1 or options.views % 2 == 0:
            raise ConfigError(f"views: found {options.views}, expected an odd number so that there is a centre view")
        return options.views
    pitch = float(np.hypot(*grid.step_u_px))
    return 2 * int((0.5 * pitch - _RIM_PX) / step) + 1


def _refuse_other_camera(capture: Capture, white: Capture) -> None:
    found, wanted = white.mosaic.shape, capture.mosaic.shape
    if found != wanted:
        raise AssetError(
            f"{white.source}: found a white image of {found[1]} x {found[0]} px, expected {wanted[1]} x {wanted[0]} "
            f"as {capture.source}; give the white image of the same camera"
        )
    ours, theirs = capture.metadata.serial, white.metadata.serial
    if not same_camera(ours, theirs):
        raise AssetError(
            f"{white.source}: found a white image of camera {camera_mark(theirs)}, expected {camera_mark(ours)} as "
            f"{capture.source}; give the white image of the same camera"
        )


def part_of(progress: Progress, start: int, stop: int) -> Progress:
    """Return a progress callback whose whole is a part of another's, from ``start`` to ``stop`` hundredths."""

    def report(done: int, total: int) -> None:
        progress(start + (stop - start) * done // max(total, 1), 100)

    return report
