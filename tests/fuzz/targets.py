"""What is fuzzed: every parser of foreign bytes, as a function of those bytes.

A parser may return, or raise an error of lfstereo with a message of one line. Anything else is a finding.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from unittest import mock

from lfstereo.container import read_capture
from lfstereo.container.describe import describe
from lfstereo.container.dng import read_dng
from lfstereo.container.factory_files import (
    parse_factory_lattices,
    parse_hot_pixels,
    parse_manifest,
    parse_serial,
)
from lfstereo.container.layouts import private_metadata, public_metadata
from lfstereo.container.members import list_members
from lfstereo.container.metadata import parse_metadata
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.reader import parse_json
from lfstereo.depth.pfm import read_pfm
from lfstereo.errors import LfstereoError
from lfstereo.lenslet.library import library_from_json, open_library
from lfstereo.lenslet.remembered_grid import grid_from_json
from lfstereo.lightfield import read_light_field
from lfstereo.options import from_mapping, read_toml
from lfstereo.rig.rig import read_rig
from tests.fuzz import inputs
from tests.fuzz.repair import repaired_container, repaired_png, repaired_tar

SHARED_MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class Target:
    """One parser."""

    seeds: Callable[[], list[bytes]]
    """Valid inputs to start from; the first byte chooses a variant."""
    read: Callable[[bytes], object]
    """Raises only what a user may see."""


def _folder() -> Path:
    place = SHARED_MEMORY if SHARED_MEMORY.is_dir() else None
    return Path(tempfile.mkdtemp(prefix="fuzz", dir=place))


FOLDER = _folder()
"""In memory where the system allows; one per process."""
atexit.register(shutil.rmtree, FOLDER, True)
SEEDS = FOLDER / "valid"
SEEDS.mkdir()
_PATHS: dict[str, Path] = {}


def _put(name: str, data: bytes) -> Path:
    path = _PATHS.get(name) or _PATHS.setdefault(name, FOLDER / name)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.write(descriptor, data)
    os.close(descriptor)
    return path


class InMemory(PurePosixPath):
    """A file's name with its bytes: spares the system calls where a parser only opens and reads."""

    data = b""

    def open(self, mode: str = "rb") -> io.BytesIO:
        """Return the bytes as a file."""
        assert mode == "rb"
        return io.BytesIO(self.data)

    def is_dir(self) -> bool:
        """Return False: it is a file."""
        return False


def _in_memory(name: str, data: bytes) -> Any:
    found = InMemory(name)
    found.data = data
    return found


RETURNED: list[str] = []
"""Grows by one for each parser that took its input; so tests see that the seeds are valid."""


def _each(*readers: Callable[[], object]) -> None:
    for read in readers:
        try:
            read()
            RETURNED.append("")
        except LfstereoError as error:
            if "\n" in str(error):
                raise AssertionError(f"message of several lines: {error!r}") from error


def _marked(seeds: Iterable[bytes], marks: bytes) -> list[bytes]:
    return [bytes([mark]) + seed for seed in seeds for mark in marks]


def container(data: bytes) -> None:
    """An LFR or LFP; the first byte says whether its checksums are made right."""
    body = repaired_container(data[1:]) if data[:1] >= b"\x80" else data[1:]
    path = _in_memory("a.LFR", body)
    _each(lambda: read_capture(path), lambda: describe(path))


def raw(data: bytes) -> None:
    """A bare frame of as many bytes as the first one says, with its text file."""
    path = _put("b.RAW", bytes(data[0]) if data else b"")
    _put("b.TXT", data[1:])
    _each(lambda: read_capture(path), lambda: describe(path))


def metadata(data: bytes) -> None:
    """Metadata as JSON: read; and, one in eight, written in the camera's layout and read again, they are the same."""

    def read() -> None:
        found = parse_metadata(parse_json(data, "a"), None, "a")
        if len(data) % 8:
            return
        public = json.loads(json.dumps(public_metadata(found), allow_nan=False))
        again = parse_metadata(public, private_metadata(found), "a")
        assert again.lens == found.lens and again.black == found.black and again.ccm == found.ccm

    _each(read)


_PARSERS: tuple[Callable[[bytes, str], object], ...] = (
    parse_serial,
    parse_hot_pixels,
    parse_factory_lattices,
    parse_manifest,
)


def factory(data: bytes) -> None:
    """The small files beside white images; the first byte says which."""
    parse = _PARSERS[(data[0] if data else 0) % len(_PARSERS)]
    _each(lambda: parse(data[1:], "a"))


def archive(data: bytes) -> None:
    """A tar archive or a backup volume, by the first byte's first bit; its second: checksums are made right."""
    mark, body = data[:1] or b"\0", data[1:]
    if mark[0] & 0x80:
        path = _in_memory("w.tar", repaired_tar(body) if mark[0] & 0x40 else body)
    else:
        path = _in_memory("data.C.0", repaired_container(body) if mark[0] & 0x40 else body)

    def read() -> None:
        for member in list_members(path):
            assert ".." not in member.name.split("/") and not member.name.startswith("/")
            _each(member.read)

    _each(read)


def library(data: bytes) -> None:
    """White images inside an archive."""
    path = _put("v.tar", repaired_tar(data))

    def read() -> None:
        for white in open_library(path).whites:
            _each(white.read, white.bad_pixels, white.factory_lattices)

    with mock.patch.dict(os.environ, {"LFSTEREO_HOME": str(FOLDER / "home")}):
        _each(read)


def _light_field(name: str) -> Callable[[bytes], None]:
    return lambda data: _each(lambda: read_light_field(_put(name, data)))


def eslf(data: bytes) -> None:
    """A lenslet-packed picture with right checksums."""
    _light_field("a.png")(repaired_png(data))


def description(data: bytes) -> None:
    """What lies beside views: a description, or the HCI benchmark's parameters, by the first byte."""
    from lfstereo.lightfield.interchange.picture_folders import read_picture_folder

    folder = FOLDER / "views"
    if not folder.is_dir():
        from lfstereo.lightfield.views_folder import write_views_folder

        write_views_folder(folder, inputs.light_field(False))
    name = "light_field.toml" if data[:1] < b"\x80" else "parameters.cfg"
    for other in ("light_field.toml", "parameters.cfg"):
        (folder / other).unlink(missing_ok=True)
    (folder / name).write_bytes(data[1:])
    _each(lambda: read_picture_folder(folder))


def pfm(data: bytes) -> None:
    """A disparity."""
    _each(lambda: read_pfm(_put("a.pfm", data)))


def dng(data: bytes) -> None:
    """A mosaic as DNG."""
    _each(lambda: read_dng(_put("a.dng", data)))


def toml(data: bytes) -> None:
    """A TOML file as rig, as camera profile and as every kind of options."""
    from lfstereo.batch.options import BatchOptions
    from lfstereo.lightfield.options import DecodeOptions
    from lfstereo.pipeline import RunOptions

    path = _put("a.toml", data)

    def options(kind: type, name: str) -> object:
        return from_mapping(kind, read_toml(path).get(name, {}), "a")

    kinds = ((RunOptions, "run"), (BatchOptions, "batch"), (DecodeOptions, "decode"))
    _each(
        lambda: read_rig(path),
        *(lambda bits=bits: read_camera_profile(str(path), bits) for bits in (None, 8)),
        *(lambda kind=kind, name=name: options(kind, name) for kind, name in kinds),
    )


def card(data: bytes) -> None:
    """A model's card."""
    from lfstereo.network.card import read_card

    _each(lambda: read_card(_put("card.toml", data)))


def cache(data: bytes) -> None:
    """What a cache file may hold: an index of white images, a grid."""

    def read() -> None:
        found: Any = json.loads(data)
        for build in (lambda value: library_from_json(value, Path("a")), grid_from_json):
            try:
                build(found)
                RETURNED.append("")
            except (TypeError, ValueError, KeyError):  # computed again
                continue

    with contextlib.suppress(ValueError, RecursionError):
        read()


def safetensors(data: bytes) -> None:
    """Weights, as `load_model` reads them once their sha256 is right."""
    from lfstereo.network.weights import parse_weights

    _each(lambda: parse_weights(data, Path("a")))


OPTIONS_TOML = b"""[run]
slices = 16
model = "binocular-v3"
device = "auto"
any_zoom = false
[batch]
clock_tolerance_s = 2.0
shard = "1/8"
"""

TARGETS: dict[str, Target] = {
    "container": Target(lambda: _marked(inputs.containers(), b"\0\xff"), container),
    "raw": Target(lambda: [mark + text for mark, text in zip((b"\x0a", b"\x0c"), inputs.texts(), strict=True)], raw),
    "metadata": Target(lambda: inputs.texts() + inputs.publics(), metadata),
    "factory": Target(lambda: [bytes([n]) + d for n, d in enumerate(inputs.factory_files().values())], factory),
    "archive": Target(lambda: _marked(inputs.tars(), b"\x80\xc0") + _marked(inputs.volumes(), b"\0\x40"), archive),
    "library": Target(lambda: inputs.tars(), library),
    "hdf5": Target(lambda: inputs.stores(SEEDS), _light_field("a.h5")),
    "mat": Target(lambda: inputs.mats(SEEDS), _light_field("a.mat")),
    "eslf": Target(lambda: inputs.eslfs(SEEDS), eslf),
    "description": Target(
        lambda: [mark + text for mark, text in zip((b"\0", b"\xff"), inputs.descriptions(), strict=True)], description
    ),
    "pfm": Target(lambda: inputs.pfms(SEEDS), pfm),
    "dng": Target(lambda: inputs.dngs(SEEDS), dng),
    "toml": Target(lambda: [*inputs.rigs(), *inputs.profiles(), OPTIONS_TOML], toml),
    "card": Target(inputs.cards, card),
    "cache": Target(inputs.caches, cache),
    "safetensors": Target(inputs.safetensors, safetensors),
}
"""Name -> parser."""
