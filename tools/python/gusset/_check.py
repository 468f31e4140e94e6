"""`gusset check` from Python."""

from __future__ import annotations

import json
import os
import subprocess
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from . import _toml
from ._binary import binary
from ._errors import RunError
from ._process import error_in

MOST_LINES, WIDTH = 10, 100  # of a printed check
Severity = Literal["error", "accepted", "warning"]


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
    severity: Severity
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

    def __repr__(self) -> str:
        """The outcome, the findings from errors to warnings, and further warnings, in at most ten lines of 100 characters."""
        findings = sorted(self.findings, key=lambda found: get_args(Severity).index(found.severity))
        texts = [f"{found.severity}: {found.key}: {'; '.join([found.text, *found.help])}" for found in findings]
        own = {found.text for found in findings}
        texts += [f"warning: {text}" for text in self.warnings if text not in own]
        verdict = f"{self.outcome}, {'allowed' if self.is_allowed else 'not allowed'}, findings and warnings: {len(texts)}"
        lines = textwrap.wrap(f"{self.data['title']}: {verdict}", WIDTH, max_lines=2)
        for place, text in enumerate(texts):
            wrapped = textwrap.wrap(text, WIDTH, subsequent_indent="  ", max_lines=3, placeholder=" …")
            if len(lines) + len(wrapped) + (place + 1 < len(texts)) > MOST_LINES:
                lines.append(f"{len(texts) - place} more in `findings` and `warnings`")
                break
            lines += wrapped
        return "\n".join(lines)


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
    done = subprocess.run([binary(), *arguments], stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", check=False)
    if done.returncode not in (0, 1) or not done.stdout.strip():
        raise RunError(done.returncode, error_in(done.stderr), None, done.stderr)
    data = json.loads(done.stdout)
    verdict = data["verdict"]
    findings = [Finding(**{name: found[name] for name in Finding.__dataclass_fields__}) for found in verdict["findings"]]
    return Check(findings, data.get("warnings", []), verdict["outcome"], verdict.get("errors"), done.returncode == 0, data)
