"""Reads test files, and writes values for `--set`."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from ._errors import UsageError


def read(path: Path) -> dict[str, Any]:
    """The tables of a TOML file."""
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such test file") from None
    except IsADirectoryError:
        raise UsageError(f"{path} is a folder, not a test file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as reason:
        raise UsageError(f"{path}: {reason}") from None


def value(given: Any, key: str) -> str:
    """A Python value as TOML, for the override of `key`."""
    if hasattr(given, "tolist"):  # numbers and arrays of NumPy
        given = given.tolist()
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, (int, float)):
        return repr(given)
    if isinstance(given, (str, Path)):
        return json.dumps(str(given), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, (list, tuple)):
        return "[" + ", ".join(value(entry, key) for entry in given) + "]"
    if isinstance(given, Mapping):
        entries = (f"{json.dumps(str(name), ensure_ascii=False)} = {value(entry, key)}" for name, entry in given.items())
        return "{ " + ", ".join(entries) + " }"
    raise UsageError(f"set[{key!r}] is {given!r}; a number, text, bool, list or dict is needed")


def overrides(given: Mapping[str, Any] | None) -> list[str]:
    """The arguments `--set KEY=VALUE` of the program."""
    arguments = []
    for key, entry in (given or {}).items():
        arguments += ["--set", f"{key}={value(entry, key)}"]
    return arguments
