"""Rectify a pair of light fields: rows aligned, toe-in taken out, the working range at disparities 0..100 px."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numba
import numpy as np

from lfstereo.arrays import Bool, Float32, UInt8
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent
from lfstereo.rig.between_views import view_between
from lfstereo.rig.geometry import RectifiedGeometry, Side
from lfstereo.rig.match import check_camera, check_lens
from lfstereo.rig.resample import resample_view
from lfstereo.rig.rig import PlenopticCamera, StereoRig
from lfstereo.rig.view_maps import common_view_baseline_m, view_baseline_m, view_map


def rectify(
    light_field: LightField,
    rig: StereoRig,
    geometry: RectifiedGeometry,
    side: Side,
    progress: Progress = silent,
    any_zoom: bool = False,
    any_camera: bool = False,
) -> LightField:
    """Resample one light field of the pair to its rectified camera.

    The views of both cameras are read at the same pupil points, so that a disparity has one slope in both. Every view
    is a pinhole at its pupil point, so it maps by one homography and by the lens's distortion; the part of the pupil
    offset that the turn moves out of the plane is exact at ``geometry.reference_m`` and below 0.1 px elsewhere.

    Parameters
    ----------
    light_field
        The decoded light field.
    side
        Which camera of the rig it comes from.
    any_zoom
        Accept light fields taken at another zoom or focus than the rig was calibrated at.
    any_camera
        Accept light fields of cameras with other serial numbers.

    Returns
    -------
    LightField
        ``(T, S, V, U, 3)`` of ``geometry.size``, its views :func:`common_view_baseline_m` apart; samples outside the
        captured field have weight 0.

    Raises
    ------
    AssetError
        If the rig was made for another camera, or for another state of its lens.
    ShapeError
        If the light field does not cover the sensor that the rig speaks of.
    """
    camera = rig.left if side == "left" else rig.right
    check_camera(light_field, camera, side, any_camera)
    if not any_zoom:
        check_lens(light_field, camera, side)
    t_count, s_count = light_field.views.shape[:2]
    rows, columns = geometry.size
    views = np.empty((t_count, s_count, rows, columns, 3), np.float32)
    weight = np.empty((t_count, s_count, rows, columns), np.uint8)
    t0, s0 = light_field.centre
    closer = common_view_baseline_m(light_field, rig) / view_baseline_m(light_field, camera)

    def fill(t: int) -> None:
        for s in range(s_count):
            at = t0 + (t - t0) * closer, s0 + (s - s0) * closer
            view, confidence = view_between(light_field, *at)
            _resample(view, confidence, (light_field, camera, geometry, side, *at), views[t, s], weight[t, s])

    # As many at once as compiled code may use threads: a worker of a batch has its share of the processor.
    with ThreadPoolExecutor(max_workers=numba.get_num_threads()) as pool:
        for done, _ in enumerate(pool.map(fill, range(t_count))):
            progress(done + 1, t_count)
    return replace(light_field, views=views, weight=weight, sampling=None)


def field_of_view(light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side) -> Bool:
    """Return where the rectified centre view ``(V, U)`` was seen by the camera at all."""
    rows, columns = light_field.views.shape[2:4]
    whole = np.full((rows, columns), 255, np.uint8)
    nothing, seen = np.zeros((rows, columns, 3), np.float32), np.zeros(geometry.size, np.uint8)
    where = (light_field, camera, geometry, side, *light_field.centre)
    _resample(nothing, whole, where, np.empty((*geometry.size, 3), np.float32), seen)
    mask: Bool = seen == 255
    return mask


def _resample(
    view: Float32,
    weight: UInt8,
    where: tuple[LightField, PlenopticCamera, RectifiedGeometry, Side, float, float],
    out: Float32,
    out_weight: UInt8,
) -> None:
    found = view_map(*where)
    maps = (found.picture_from_rectified, found.bend, found.view_from_picture)
    resample_view(np.ascontiguousarray(view), np.ascontiguousarray(weight), *maps, out, out_weight)
