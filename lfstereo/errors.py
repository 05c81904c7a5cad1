"""Every deliberate error of lfstereo and the exit code the command line gives it.

A message says where, what was found, what was expected and what to do, on one line.
"""

from __future__ import annotations

from typing import ClassVar


class LfstereoError(Exception):
    """Base of all errors that lfstereo raises on purpose."""

    exit_code: ClassVar[int] = 1


class InputError(LfstereoError, ValueError):
    """Something handed in cannot be used as it is."""

    exit_code: ClassVar[int] = 3


class ContainerError(InputError):
    """A file is not a readable Lytro container, raw frame or light-field file."""


class MetadataError(InputError):
    """Camera metadata lacks a field, or holds a value that cannot be."""


class ConfigError(InputError):
    """An option or a TOML file holds a value that cannot be used."""


class AssetError(InputError):
    """A rig, white image, camera profile or model weights cannot be found or do not fit."""


class ShapeError(InputError):
    """An array has the wrong shape or type, or two that must agree do not."""


class OutputError(InputError):
    """A result cannot be written: it exists already, or the place is full or read-only."""


class QualityError(LfstereoError):
    """A result was computed but cannot be trusted."""

    exit_code: ClassVar[int] = 4


class GridFitError(QualityError):
    """No lenslet grid could be fitted well enough to decode with."""


class TargetNotFoundError(QualityError):
    """No calibration target was found in an image that should show one."""


class AlignmentError(QualityError):
    """The pictures of one sweep could not be brought to coincide."""


class RigError(QualityError):
    """A rig's geometry does not allow what was asked of it."""


class MissingExtraError(LfstereoError, ImportError):
    """An optional package that the called feature needs is not installed."""

    exit_code: ClassVar[int] = 3


class QualityWarning(UserWarning):
    """A result was computed with less than it should have been, and says how good it is."""
