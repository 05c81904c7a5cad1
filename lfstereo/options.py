"""Options declared once: a frozen dataclass is the default, the TOML table and the command line.

Supported field types: ``bool``, ``int``, ``float``, ``str``, ``Path``, a ``Literal`` of strings, a fixed or
open ``tuple`` of one of the numbers, and any of these ``| None``. ``field(metadata={"help": ..., "unit": ...})``
gives the help text.
"""

from __future__ import annotations

import argparse
import dataclasses
import tomllib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from lfstereo.errors import ConfigError

OptionsT = TypeVar("OptionsT")
LARGEST_TOML_BYTES = 1 << 20
_LONGEST_SHOWN = 60
_TRUE, _FALSE = ("true", "yes", "1", "on"), ("false", "no", "0", "off")


def option(default: Any, help: str, unit: str = "") -> Any:
    """Declare one option of an options dataclass with its help text and unit."""
    text = f"{help} [{unit}]" if unit else help
    return dataclasses.field(default=default, metadata={"help": text})


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    ConfigError
        If the file cannot be read, is far larger than any of lfstereo's, or is not TOML.
    """
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_TOML_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); give the path of a TOML file") from error
    if len(data) > LARGEST_TOML_BYTES:
        raise ConfigError(f"{path}: found more than {LARGEST_TOML_BYTES} bytes, expected a TOML file of a few pages")
    return parse_toml(data, str(path))


def parse_toml(data: bytes, where: str) -> dict[str, Any]:
    """Parse TOML.

    Raises
    ------
    ConfigError
        If it is not TOML, is nested too deeply, or holds a number or date that cannot be.
    """
    try:
        return tomllib.loads(data.decode("utf-8"))
    except RecursionError as error:
        raise ConfigError(f"{where}: not valid TOML (nested too deeply); correct that place") from error
    except ValueError as error:
        raise ConfigError(f"{where}: not valid TOML ({error}); correct that place") from error


def from_mapping(
    cls: type[OptionsT], values: Mapping[str, Any], where: str, given: Mapping[str, Any] | None = None
) -> OptionsT:
    """Build options from a parsed TOML table.

    Parameters
    ----------
    cls
        The options dataclass.
    values
        Names and values; names not given keep their defaults.
    where
        File and table, for messages.
    given
        Fields that are built already.

    Raises
    ------
    ConfigError
        If the values are no table, for a name that is no option, or a value of the wrong type.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where}: found {_cut(values)}, expected a table of options")
    hints = typing.get_type_hints(cls)
    known = [f.name for f in dataclasses.fields(typing.cast(Any, cls))]
    resolved: dict[str, Any] = {}
    for name, value in values.items():
        if name not in known:
            raise ConfigError(f"{where}: {_cut(name)} is not an option; known are {', '.join(known)}")
        try:
            resolved[name] = _convert(value, hints[name])
        except (TypeError, ValueError, OverflowError) as error:
            raise ConfigError(f"{where}: {name} = {_cut(value)} does not fit: {_cut(str(error), 200)}") from error
    return cls(**resolved, **(given or {}))


def _cut(value: object, longest: int = _LONGEST_SHOWN) -> str:
    """Return a value for a message: on one line and not longer than that."""
    shown = value if isinstance(value, str) and value.isprintable() and longest > _LONGEST_SHOWN else repr(value)
    return shown if len(shown) <= longest else shown[: longest - 3] + "..."


def to_toml(options: Any) -> str:
    """Return options as the lines of a TOML table; an unset (``None``) option is left out."""
    rows = ((f.name, getattr(options, f.name)) for f in dataclasses.fields(options))
    return "".join(f"{name} = {toml_value(value)}\n" for name, value in rows if value is not None)


def toml_value(value: Any) -> str:
    """Return one value in TOML notation.

    Examples
    --------
    >>> toml_value((1, 2.5)), toml_value(True), toml_value('a"b')
    ('[1, 2.5]', 'true', '"a\\\\"b"')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, int):
        return repr(int(value))
    if isinstance(value, tuple | list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    text = "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in text)
    return f'"{text}"'


def add_arguments(parser: argparse.ArgumentParser, cls: type[Any]) -> None:
    """Add one ``--name`` per option; an option not given on the command line stays unset in the namespace."""
    hints = typing.get_type_hints(cls)
    for f in dataclasses.fields(cls):
        kind, _ = _without_none(hints[f.name])
        flag = "--" + f.name.replace("_", "-")
        text = f"{f.metadata.get('help', '')} (default: {_shown(f.default)})"
        extra: dict[str, Any] = {
            "dest": f.name,
            "default": argparse.SUPPRESS,
            "help": text.replace("%", "%%"),
        }
        if kind is bool:
            parser.add_argument(flag, action=argparse.BooleanOptionalAction, **extra)
        elif typing.get_origin(kind) is typing.Literal:
            parser.add_argument(flag, choices=typing.get_args(kind), **extra)
        elif typing.get_origin(kind) is tuple:
            inner = typing.get_args(kind)
            count: int | str = "+" if inner[-1] is Ellipsis else len(inner)
            parser.add_argument(flag, nargs=count, type=inner[0], metavar=inner[0].__name__.upper(), **extra)
        else:
            parser.add_argument(flag, type=kind, metavar=kind.__name__.upper(), **extra)


def from_arguments(
    cls: type[OptionsT],
    arguments: argparse.Namespace,
    file_values: Mapping[str, Any] | None = None,
    where: str = "",
) -> OptionsT:
    """Build options: the command line over the TOML table over the defaults."""
    names = {f.name for f in dataclasses.fields(typing.cast(Any, cls))}
    given = {name: value for name, value in vars(arguments).items() if name in names}
    base = from_mapping(cls, file_values or {}, where)
    return from_mapping(cls, dataclasses.asdict(typing.cast(Any, base)) | given, "command line")


def _shown(default: Any) -> str:
    return "none" if default is None else toml_value(default).strip('"')


def _without_none(kind: Any) -> tuple[Any, bool]:
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        inner = [k for k in typing.get_args(kind) if k is not type(None)]
        return inner[0], True
    return kind, False


def _convert(value: Any, kind: Any) -> Any:
    kind, optional = _without_none(kind)
    if value is None:
        if optional:
            return None
        raise TypeError("a value is needed")
    origin = typing.get_origin(kind)
    if origin is typing.Literal:
        if value not in typing.get_args(kind):
            raise ValueError(f"expected one of {', '.join(map(str, typing.get_args(kind)))}")
        return value
    if origin is tuple:
        return _convert_tuple(value, typing.get_args(kind))
    if kind is bool:
        if isinstance(value, bool):
            return value
        if str(value).lower() in _TRUE + _FALSE:
            return str(value).lower() in _TRUE
        raise TypeError("expected true or false")
    if isinstance(value, bool):
        raise TypeError(f"expected {kind.__name__}, found true/false")
    if kind is int and isinstance(value, float) and not value.is_integer():
        raise ValueError("expected a whole number")
    if kind in (str, Path):
        if not isinstance(value, str | Path) or "\0" in str(value):
            raise TypeError("expected text")
    elif not isinstance(value, str | int | float):
        raise TypeError("expected a number")
    return kind(value)


def _convert_tuple(value: Any, inner: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise TypeError("expected a list")
    if inner[-1] is not Ellipsis and len(value) != len(inner):
        raise ValueError(f"expected {len(inner)} values, found {len(value)}")
    return tuple(_convert(v, inner[0]) for v in value)
