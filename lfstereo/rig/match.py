"""Refuse light fields that a rig does not hold for."""

from __future__ import annotations

from lfstereo.container.serials import camera_mark, same_camera
from lfstereo.errors import AssetError, ShapeError
from lfstereo.lightfield.field import LightField
from lfstereo.rig.geometry import Side
from lfstereo.rig.rig import PlenopticCamera, StereoRig
from lfstereo.rig.view_maps import VIEW_PIXELS

_PITCH_TOLERANCE = 5e-4
"""Relative; from one end of the zoom to the other the pitch of the micro-images changes by three times this."""
_ROTATION_TOLERANCE_RAD = 5e-4
"""Moves a corner of an Illum's frame by 2 px."""


def check_camera(light_field: LightField, camera: PlenopticCamera, side: Side, any_camera: bool = False) -> None:
    """Refuse light fields of another camera.

    Parameters
    ----------
    camera
        The rig's camera of that side.
    any_camera
        Accept another serial number; the sensor must still be as large.

    Raises
    ------
    AssetError
        If the serial numbers are known and differ.
    ShapeError
        If the light field does not cover the sensor that the rig speaks of.
    """
    if not any_camera and not same_camera(camera.serial, light_field.serial):
        raise AssetError(
            f"{light_field.source}: taken by camera {camera_mark(light_field.serial)}, but the rig's {side} camera is "
            f"{camera_mark(camera.serial)}; swap the captures, give the rig of these cameras, or accept it with "
            "--any-camera"
        )
    sampling = light_field.sampling or VIEW_PIXELS
    covered = [n * step for n, step in zip(light_field.views.shape[3:1:-1], sampling.step_px, strict=True)]
    if any(abs(c - w) > 0.03 * w for c, w in zip(covered, camera.sensor_px, strict=True)):
        raise ShapeError(
            f"{light_field.source}: covers {covered[0]:.0f} x {covered[1]:.0f} px, but the rig's {side} camera has "
            f"{camera.sensor_px[0]} x {camera.sensor_px[1]}; give the rig of this camera"
        )


def check_lens(light_field: LightField, camera: PlenopticCamera, side: Side) -> None:
    """Refuse another zoom or focus where both are known: focal length and plane of zero slope depend on them.

    The pitch of the micro-images tells of the zoom as well, where the captures do not.

    Raises
    ------
    AssetError
        If the zoom step, the focus step or the lattice of micro-images differs from the calibration's.
    """
    for name in ("zoom", "focus"):
        found, expected = getattr(light_field, f"{name}_step"), getattr(camera, f"{name}_step")
        if found is not None and expected is not None and found != expected:
            raise AssetError(
                f"{light_field.source}: taken at {name} step {found}, but the rig's {side} camera was calibrated at "
                f"{expected}; set the lens as it was, calibrate again, or accept it with --any-zoom"
            )
    sampling, grid = light_field.sampling, camera.grid
    if sampling is None or grid is None:
        return
    pairs = zip(sampling.step_px, grid.step_px, strict=True)
    stretch = max(abs(found / expected - 1) for found, expected in pairs)
    turn = abs(sampling.rotation_rad - grid.rotation_rad)
    if stretch > _PITCH_TOLERANCE or turn > _ROTATION_TOLERANCE_RAD:
        raise AssetError(
            f"{light_field.source}: rows of micro-images {sampling.step_px[1]:.4f} px apart and turned by "
            f"{sampling.rotation_rad * 1e3:.3f} mrad, but the rig's {side} camera was calibrated with "
            f"{grid.step_px[1]:.4f} px and {grid.rotation_rad * 1e3:.3f} mrad; give the white images of its zoom, "
            "calibrate again, or accept it with --any-zoom"
        )


def side_of(serial: str, rig: StereoRig) -> Side | None:
    """Return the side of the rig whose camera has a serial number or mark; ``None`` where none has it, or both."""
    cameras: tuple[tuple[Side, PlenopticCamera], ...] = (("left", rig.left), ("right", rig.right))
    sides = [side for side, camera in cameras if serial and camera.serial and same_camera(serial, camera.serial)]
    return sides[0] if len(sides) == 1 else None
