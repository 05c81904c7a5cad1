"""Look up and check single fields of camera metadata, by dotted path, in several layouts at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

from lfstereo.errors import MetadataError

Json: TypeAlias = dict[str, Any]
"""A parsed JSON object."""
LARGEST = 1e30
"""No number in metadata is near it; keeps whole numbers of any length convertible to float."""
LONGEST_TEXT = 256
"""The longest that a camera writes is a date of 24 characters."""
_ABSENT, _DEFAULT = object(), object()


@dataclass(frozen=True, slots=True)
class Fields:
    """Metadata in one or more layers; a field is taken from the first layer and the first path that has it.

    A path names the keys from the top joined by dots; a number picks from a list. Every method raises
    `MetadataError` naming the field where it is missing (and no default is given) or of the wrong kind.
    """

    where: str
    """File name for messages."""
    layers: tuple[Json, ...]
    private: tuple[Json, ...]

    def number(self, *paths: str, default: float | None = None) -> float:
        """Return a finite number."""
        value = self._find(paths, _ABSENT if default is None else default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not -LARGEST <= value <= LARGEST:
            raise self._unfit(paths, value, "a finite number")
        return float(value)

    def positive(self, *paths: str, default: float | None = None) -> float:
        """Return a number above zero."""
        value = self.number(*paths, default=default)
        if value <= 0:
            raise self._unfit(paths, value, "a number above 0")
        return value

    def optional(self, *paths: str) -> float | None:
        """Return a number above zero, or None where the field is missing."""
        return None if self._find(paths, None) is None else self.positive(*paths)

    def whole(self, *paths: str) -> int:
        """Return a whole number."""
        value = self.number(*paths)
        if not value.is_integer():
            raise self._unfit(paths, value, "a whole number")
        return int(value)

    def text(self, *paths: str, default: str | None = None) -> str:
        """Return a short text on one line."""
        return self._short_text(paths, self._find(paths, _ABSENT if default is None else default))

    def choice(self, paths: tuple[str, ...], allowed: tuple[str, ...]) -> str:
        """Return one of the allowed texts."""
        value = self.text(*paths)
        if value not in allowed:
            raise self._unfit(paths, value, " or ".join(f"'{text}'" for text in allowed))
        return value

    def quad(
        self, *paths: str, default: tuple[float, float, float, float] | None = None
    ) -> tuple[float, float, float, float]:
        """Return the four numbers of an object with the keys r, gr, gb, b, in this order."""
        if default is not None and self._find(paths, _DEFAULT) is _DEFAULT:
            return default
        value = self._find(paths, _ABSENT)
        if not isinstance(value, dict):
            raise self._unfit(paths, value, "an object with r, gr, gb, b")
        r, gr, gb, b = (self.number(*(f"{path}.{site}" for path in paths)) for site in ("r", "gr", "gb", "b"))
        return r, gr, gb, b

    def matrix(self, *paths: str) -> tuple[float, ...]:
        """Return the nine numbers of a 3 x 3 matrix, row by row."""
        value = self._find(paths, _ABSENT)
        if not isinstance(value, list) or len(value) != 9:
            raise self._unfit(paths, value, "a list of 9 numbers")
        return tuple(self.number(*(f"{path}.{i}" for path in paths)) for i in range(9))

    def count(self, path: str) -> int:
        """Return the length of a list; 0 where it is missing."""
        value = self._find((path,), [])
        if not isinstance(value, list):
            raise self._unfit((path,), value, "a list")
        return len(value)

    def flag(self, keys: tuple[str, ...]) -> bool:
        """Return true or false; false where the first layer does not say (later layers describe another frame)."""
        value = _walk(self.layers[0], keys)
        if value is _ABSENT:
            return False
        if not isinstance(value, bool):
            raise self._unfit((".".join(keys),), value, "true or false")
        return value

    def private_text(self, path: str) -> str:
        """Return a short text of the private metadata; empty where it is missing."""
        found = (_walk(layer, tuple(path.split("."))) for layer in self.private)
        return self._short_text((path,), next((v for v in found if v is not _ABSENT), ""))

    def _short_text(self, paths: tuple[str, ...], value: object) -> str:
        if not isinstance(value, str) or len(value) > LONGEST_TEXT or not value.isprintable():
            raise self._unfit(paths, value, f"a text on one line of at most {LONGEST_TEXT} characters")
        return value

    def _find(self, paths: tuple[str, ...], default: object) -> Any:
        for layer in self.layers:
            for path in paths:
                value = _walk(layer, tuple(path.split(".")))
                if value is not _ABSENT:
                    return value
        if default is _ABSENT:
            names = " or ".join(f"'{path}'" for path in paths)
            raise MetadataError(
                f"{self.where}: field {names} is missing; expected the complete metadata of a Lytro frame, "
                "give the file that the camera wrote"
            )
        return default

    def _unfit(self, paths: tuple[str, ...], value: object, expected: str) -> MetadataError:
        shown = repr(value)
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        return MetadataError(
            f"{self.where}: field '{paths[0]}': found {shown}, expected {expected}; give the file that the camera wrote"
        )


def _walk(value: Any, keys: tuple[str, ...]) -> Any:
    for key in keys:
        if isinstance(value, dict) and key in value:
            value = value[key]
        elif isinstance(value, list) and key.isdigit() and int(key) < len(value):
            value = value[int(key)]
        else:
            return _ABSENT
    return value
