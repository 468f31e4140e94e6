"""`gusset import opensees`: runs a script of OpenSees, and writes its model as a test file."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .. import Refused
from ..units import parse
from . import write
from .frame import Frame
from .model import Model

STDERR = 2
CHILD = Path(__file__).with_name("child.py")


def run(options: dict[str, Any]) -> int:
    """Imports a model. Options: model, units, out, list, replace (TAG=specimen), accept_damping, timeout_s."""
    script = Path(options["model"])
    if not script.is_file():
        raise Refused(f"{script}: no such script")
    units = parse(options["units"])
    replaced = dict(replacement(text) for text in options.get("replace") or [])
    out = Path(options.get("out") or f"{script.stem}.toml")
    if out.exists() and not options.get("list"):
        raise Refused(f"{out} exists already; remove it, or choose another file with --out")
    with tempfile.TemporaryDirectory(prefix="gusset-import-") as folder:
        print(f"Running {script} until its first transient analysis ...", file=sys.stderr)
        record = recorded(script, Path(folder), float(options.get("timeout_s") or 300))
        model = Model(record, units, replaced, bool(options.get("accept_damping")))
        frame = Frame(model)
        if not model.mistakes:
            check_whole(model, script)
        if options.get("list"):
            for mistake in model.mistakes:
                print(mistake)
            print(f"{len(model.mistakes)} commands have no counterpart" if model.mistakes else "every command has a counterpart")
            return 2 if model.mistakes else 0
        if model.mistakes:
            more = len(model.mistakes) - 1
            rest = f"\n{more} more: --list names all of them" if more else ""
            raise Refused(f"{model.mistakes[0]}{rest}")
        return write.write(model, frame, record, script, out, Path(folder), answered)


def check_whole(model: Model, script: Path) -> None:
    """What only the whole model can lack."""
    if not any(any(values) for values in model.mass.values()):
        raise Refused(f"{script}: no node has a mass")
    known = {beam.tag for beam in model.beams}
    for tag in model.replaced:
        if tag not in known:
            raise Refused(f"--replace {tag}: there is no beam or column {tag}")
    bent = [beam.tag for beam in model.beams if beam.turned_from(model) != "Linear"]
    if model.replaced and bent:
        raise Refused(
            f"--replace: element {bent[0]} has a PDelta or Corotational transformation, whose axial force Gusset finds without the "
            "specimen. Use Linear transformations in the script"
        )


def replacement(text: str) -> tuple[int, str]:
    tag, _, word = text.partition("=")
    if not tag.isdigit() or not re.fullmatch(r"[A-Za-z0-9._-]+", word):
        raise Refused(f"--replace {text}: the tag of an element and the name of a specimen are needed, for example 1=column")
    return int(tag), word


def recorded(script: Path, folder: Path, timeout: float) -> dict[str, Any]:
    """The commands of a script up to its first transient analysis."""
    target = folder / "record.json"
    told = child([str(script.resolve()), str(target)], script.resolve().parent, timeout)
    if told is None:
        raise Refused(f"{script}: no transient `analyze` within {timeout:g} s; give more time with --timeout")
    if not target.exists():
        raise Refused(f"{script}: OpenSees ended with code {told} before a transient `analyze`")
    record: dict[str, Any] = json.loads(target.read_text())
    if record["error"]:
        raise Refused(record["error"])
    return record


def answered(question: dict[str, Any], folder: Path) -> dict[str, Any]:
    """What OpenSees finds for a recorded model."""
    asked, answer = folder / "question.json", folder / "answer.json"
    asked.write_text(json.dumps(question))
    code = child(["--again", str(asked), str(answer)], folder, 300, quiet=True)
    if not answer.exists():
        raise Refused(f"OpenSees ended with code {code} while it computed the recorded model again")
    found: dict[str, Any] = json.loads(answer.read_text())
    if "error" in found:
        raise Refused(found["error"])
    return found


def child(arguments: list[str], folder: Path, timeout: float, quiet: bool = False) -> int | None:
    """Exit code of the child; none if it took too long. What it prints goes to stderr, or nowhere."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        to = subprocess.DEVNULL if quiet else STDERR
        command = [sys.executable, str(CHILD), *arguments]
        done = subprocess.run(command, cwd=folder, timeout=timeout, stdout=to, stderr=to, env=environment)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode == 3:
        raise ModuleNotFoundError("No module named 'openseespy'", name="openseespy")
    return done.returncode
