"""``lfstereo doctor``: check this installation and say what to do."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from lfstereo.errors import AssetError


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("-o", "--output", type=Path, default=Path(), help="folder for results, to look at its disk")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON on stdout")
    parser.epilog = "Exit code 0: everything that lfstereo needs is there (advice may follow); 3: something is wrong."


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.doctor import check_installation

    findings = check_installation(arguments.output)
    wrong = [finding for finding in findings if finding.state == "wrong"]
    if arguments.json:
        print(json.dumps({"ready": not wrong, "findings": [asdict(finding) for finding in findings]}, indent=2))
    else:
        for finding in findings:
            print(f"{finding.state:<8}{finding.name:<32}{finding.found}")
            if finding.to_do:
                print(f"{'':<8}{'':<32}-> {finding.to_do}")
        print(f"{len(wrong)} of {len(findings)} wrong; see the arrows" if wrong else "ready")
    return AssetError.exit_code if wrong else 0
