"""Run ``python -m lfstereo``."""

from __future__ import annotations

from lfstereo.cli.main import main

raise SystemExit(main())
