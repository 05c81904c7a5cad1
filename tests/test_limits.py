"""Text files and small files that lie about their size: bounded, and refused on one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container.describe import describe
from lfstereo.container.factory_files import parse_factory_lattices, parse_serial
from lfstereo.container.format import FILE_HEAD, section_bytes
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.reader import parse_json, read_container
from lfstereo.depth.pfm import read_pfm
from lfstereo.errors import AssetError, ConfigError, ContainerError, InputError, MetadataError
from lfstereo.lenslet.library import library_from_json
from lfstereo.lenslet.remembered_grid import grid_from_json
from lfstereo.lightfield.interchange.description import from_text
from lfstereo.network.card import read_card
from lfstereo.options import LARGEST_TOML_BYTES, from_mapping, read_toml
from lfstereo.pipeline import RunOptions
from lfstereo.rig.rig import read_rig


def test_json_nested_more_than_a_camera_nests() -> None:
    assert parse_json(b'{"a": ' * 60 + b"1" + b"}" * 60, "a")
    for depth in (70, 100_000):
        with pytest.raises(ContainerError, match="nested too deeply"):
            parse_json(b'{"a": ' * depth + b"1" + b"}" * depth, "a")


def test_container_of_sections_without_end(tmp_path: Path) -> None:
    empty = b"".join(section_bytes("content", b""))
    (tmp_path / "a.LFR").write_bytes(FILE_HEAD + empty * 10_001)
    with pytest.raises(ContainerError, match="more than 10000 sections"):
        read_container(tmp_path / "a.LFR")


def test_describing_long_keys_and_many_references_takes_no_longer(tmp_path: Path) -> None:
    """Paths inside the table are cut, so that they cannot fill the memory; every section is looked up once."""
    name = '"sha1-' + "a" * 40 + '"'
    inner = "[" + ",".join(f'{{"xRef": {name}}}' for _ in range(2000)) + "]"
    toc = f'{{"{"k" * 100_000}": {inner}, "views": [], "accelerations": [{{"lambda": {"9" * 400}}}]}}'
    pieces = section_bytes("toc", toc.encode())
    (tmp_path / "a.LFR").write_bytes(FILE_HEAD + b"".join(pieces))
    found = describe(tmp_path / "a.LFR")
    assert len(found.missing) == 2000
    assert max(map(len, found.missing)) < 100


@pytest.mark.parametrize("number", ["9" * 400, "1e999", "NaN", "true"])
def test_factory_numbers_that_cannot_be(number: str) -> None:
    table = f'{{"zoomPosition": [{number}], "focusPosition": [[0]]}}'
    with pytest.raises(MetadataError, match="field zoomPosition: found no list of numbers"):
        parse_factory_lattices(table.encode(), "a")


@pytest.mark.parametrize("serial", ['"a\\nb"', '"\\ud800"', '"\\u0000"', '"' + "x" * 300 + '"'])
def test_serial_numbers_that_are_no_line_of_text(serial: str) -> None:
    with pytest.raises(MetadataError, match=r"field camera\.serialNumber: found"):
        parse_serial(b'{"camera": {"serialNumber": ' + serial.encode() + b"}}", "a")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = " + "[" * 5000, "not valid TOML .nested too deeply"),
        ("a = " + "9" * 5000, "not valid TOML"),
        ("a = 1" + " " * LARGEST_TOML_BYTES, "expected a TOML file of a few pages"),
        ("a = \ud800", "not valid TOML"),
    ],
)
def test_toml_that_cannot_be(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.toml").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(ConfigError, match=message):
        read_toml(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"slices": float("inf")}, "slices = inf does not fit"),
        ({"slices": []}, "expected a number"),
        ({"model": "a\0b"}, "expected text"),
        ({"x" * 1000: 1}, "is not an option"),
        ([1, 2], "expected a table of options"),
    ],
)
def test_options_that_cannot_be(values: object, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        from_mapping(RunOptions, values, "a")  # type: ignore[arg-type]
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("number", ["1" * 400, "inf", "1e300"])
def test_rig_numbers_that_cannot_be(tmp_path: Path, number: str) -> None:
    (tmp_path / "a.toml").write_text(f'format = "lfstereo rig 1"\nnear_m = {number}\n[right_from_left]\n')
    with pytest.raises(ConfigError, match=r"near_m = .*, expected 1 finite number"):
        read_rig(tmp_path / "a.toml")


def test_camera_profile_without_levels(tmp_path: Path) -> None:
    from lfstereo.assets import asset_folder

    text = (asset_folder("calib") / "cameras" / "lytro-f01.toml").read_text("utf-8")
    (tmp_path / "a.toml").write_text(text.replace("[levels_8_bit]", "[others]"))
    with pytest.raises(MetadataError, match=r"found no tables \[image\] and \[levels_8_bit\]"):
        read_camera_profile(str(tmp_path / "a.toml"), bits=8)


@pytest.mark.parametrize(
    "text", ["views = [inf, 2]", f"views = [{'9' * 400}, 2]", "views = " + "[" * 5000, "views = [2, 2]\nserial = 'a\0'"]
)
def test_descriptions_that_cannot_be(text: str) -> None:
    with pytest.raises(ContainerError):
        from_text(text, "a")


@pytest.mark.parametrize("text", ["architecture = 5", "metrics = 5", "[[metrics]]\nname = 1", "name = []"])
def test_cards_that_cannot_be(tmp_path: Path, text: str) -> None:
    (tmp_path / "card.toml").write_text(text)
    with pytest.raises(AssetError):
        read_card(tmp_path / "card.toml")


def test_pfm_that_says_it_is_huge(tmp_path: Path) -> None:
    (tmp_path / "a.pfm").write_bytes(b"Pf\n65536 65536\n-1.0\n" + np.zeros(4, "<f4").tobytes())
    with pytest.raises(InputError, match="need 17179869184 bytes of pixels, found 16"):
        read_pfm(tmp_path / "a.pfm")


@pytest.mark.parametrize("build", [lambda value: library_from_json(value, Path("a")), grid_from_json])
@pytest.mark.parametrize("stored", [None, 7, [], {}, {"whites": [{}], "problems": []}, {"whites": 5, "problems": []}])
def test_cache_entries_of_another_form(build: Callable[[object], object], stored: object) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        build(stored)
