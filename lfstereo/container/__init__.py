"""Stage 1: bytes of a file to a raw frame with its metadata, and back."""

from __future__ import annotations

import logging

from lfstereo.container.capture import Capture, read_capture
from lfstereo.container.format import Container
from lfstereo.container.metadata import FrameMetadata
from lfstereo.container.reader import read_container
from lfstereo.container.writer import write_capture

__all__ = ["Capture", "Container", "FrameMetadata", "read_capture", "read_container", "write_capture"]

logging.getLogger("tifffile").addHandler(logging.NullHandler())  # what is wrong with a file is said once, by an error
