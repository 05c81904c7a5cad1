"""What a picture cannot say of a light field, as a few lines of TOML that travel with it."""

from __future__ import annotations

import dataclasses
from typing import Any

from lfstereo.container.fields import LARGEST, LONGEST_TEXT
from lfstereo.develop.colour_spaces import PRIMARIES
from lfstereo.develop.options import ColourSpace
from lfstereo.errors import ContainerError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.lightfield.options import PictureOptions
from lfstereo.options import from_mapping, parse_toml, to_toml, toml_value

FILE_NAME = "light_field.toml"
"""Name of the file beside views that holds the text."""
MOST_VIEWS = 1000
"""Per direction."""


@dataclasses.dataclass(frozen=True, slots=True)
class Description:
    """What travels with the pictures of a light field."""

    views: tuple[int, int]
    """Rows and columns of views."""
    serial: str
    sampling: ViewSampling | None
    colour_space: ColourSpace
    """Primaries and curve of the pictures; only the primaries count where values are linear by their format."""
    exposure_ev: float
    """By which the pictures are brighter than the light field."""


PLAIN = PictureOptions()


def to_text(light_field: LightField, pictures: PictureOptions = PLAIN) -> str:
    """Return the number of views, the camera's serial number, the pictures' colours and the sampling as TOML."""
    rows, columns = light_field.views.shape[:2]
    lines = f"views = [{rows}, {columns}]\nserial = {toml_value(light_field.serial)}\n"
    lines += f"colour_space = {toml_value(pictures.colour_space)}\nexposure_ev = {toml_value(pictures.exposure_ev)}\n"
    if light_field.sampling is not None:
        lines += "\n[sampling]\n" + to_toml(light_field.sampling)
    return lines


def from_text(text: str, where: str) -> Description:
    """Read the text back.

    Raises
    ------
    ContainerError
        If it is not TOML, or a value in it cannot be.
    """
    try:
        table = parse_toml(text.encode("utf-8", "replace"), where)
        sampling = _sampling(table["sampling"], where) if "sampling" in table else None
        rows, columns = (int(n) for n in table["views"])
        serial, space = table["serial"], str(table.get("colour_space", PLAIN.colour_space))
        exposure = float(table.get("exposure_ev", PLAIN.exposure_ev))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise ContainerError(f"{where}: not a description of a light field ({reason}); export it again") from error
    if not isinstance(serial, str) or len(serial) > LONGEST_TEXT or not serial.isprintable():
        raise ContainerError(f"{where}: found serial {repr(serial)[:60]}, expected a text; export it again")
    if not (1 <= rows <= MOST_VIEWS and 1 <= columns <= MOST_VIEWS):
        raise ContainerError(
            f"{where}: found {rows} x {columns} views, expected 1 to {MOST_VIEWS} each; export it again"
        )
    if space not in PRIMARIES or not abs(exposure) <= 20:
        raise ContainerError(
            f"{where}: found colour space {space[:40]!r} and exposure {exposure:g} EV, expected one of "
            f"{', '.join(PRIMARIES)} and at most 20 EV; export it again"
        )
    named: ColourSpace = space
    return Description((rows, columns), serial, sampling, named, exposure)


def _sampling(table: Any, where: str) -> ViewSampling:
    sampling = from_mapping(ViewSampling, table, f"{where} [sampling]")
    numbers = (*sampling.origin_px, *sampling.step_px, sampling.rotation_rad, sampling.view_step_px)
    if not all(abs(n) <= LARGEST for n in numbers) or min(*sampling.step_px, sampling.view_step_px) <= 0:
        raise ValueError(f"found sampling {numbers}, expected finite numbers and positive steps")
    return sampling
