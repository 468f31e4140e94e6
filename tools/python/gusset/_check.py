"""`gusset check` from Python."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from . import _toml
from ._binary import binary
from ._errors import RunError


@dataclass(frozen=True)
class Finding:
    """One finding of a check.

    Attributes:
        kind: Its subject, for example "unstable".
        severity: "error", "accepted" or "warning".
        key: Dotted path of the key in the test file.
        text: The finding in words.
        numbers: The numbers that it states, in SI units; None for one that is not finite.
        help: Allowed values and advice.
    """

    kind: str
    severity: Literal["error", "accepted", "warning"]
    key: str
    text: str
    numbers: dict[str, float | None]
    help: list[str]


@dataclass(frozen=True)
class Check:
    """What `gusset check` found. Nothing moved.

    Attributes:
        findings: The findings on stability and on the needs of the test.
        warnings: Warnings on the test file, as text.
        outcome: "clear", "accepted", "simulated" or "refused".
        errors: Errors of the method ("method") and of the coupling ("coupling"), and the damping that the actuators add ("modes").
            Shares of the largest drift, the root mean square and the input energy. None without a structure.
        is_allowed: False if a finding forbids the test, or if the certificate of a rehearsal says no-go.
        data: The whole document of `gusset check --json`.
    """

    findings: list[Finding]
    warnings: list[str]
    outcome: Literal["clear", "accepted", "simulated", "refused"]
    errors: dict[str, Any] | None
    is_allowed: bool
    data: dict[str, Any]


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
    verdict = data["verdict"]
    findings = [Finding(**{name: found[name] for name in Finding.__dataclass_fields__}) for found in verdict["findings"]]
    return Check(findings, data.get("warnings", []), verdict["outcome"], verdict.get("errors"), done.returncode == 0, data)
