"""`gusset check` from Python."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _toml
from ._binary import binary
from ._errors import RunError


@dataclass(frozen=True)
class Finding:
    """One finding of a check."""

    severity: str
    """"error", "warning" or "note"."""
    key: str
    """Key of the test file that it concerns, as a dotted path."""
    text: str
    """What was found."""
    data: dict[str, Any]
    """The finding as `gusset check --json` writes it, with its numbers in SI units."""


@dataclass(frozen=True)
class Check:
    """What `gusset check` found. Nothing moved."""

    findings: list[Finding]
    """All findings, the worst first."""
    is_allowed: bool
    """False if a finding forbids the test."""
    data: dict[str, Any]
    """The whole document of `gusset check --json`."""


def check(test: str | os.PathLike[str], *, set: Mapping[str, Any] | None = None, rehearse: bool = False) -> Check:
    """Checks a test file without moving anything.

    Args:
        test: The test file.
        set: Overrides by their dotted path, for example {"integrator.lambda": 4}. Values are in SI units.
        rehearse: Also certifies the test: many rehearsals with its uncertainties.

    Raises:
        RunError: The test file is not valid (exit code 2).
    """
    arguments = ["check", str(Path(test)), "--json", *_toml.overrides(set)]
    if rehearse:
        arguments.append("--rehearse")
    done = subprocess.run([binary(), *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or not done.stdout.strip():
        raise RunError(done.returncode, done.stderr.strip(), None, done.stderr)
    data = json.loads(done.stdout)
    found = (data.get("verdict") or {}).get("findings") or data.get("findings") or []
    findings = [Finding(f.get("severity", ""), f.get("key") or "", f.get("text") or f.get("message") or "", f) for f in found]
    return Check(findings, done.returncode == 0, data)
