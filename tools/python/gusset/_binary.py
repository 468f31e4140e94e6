"""Finds the program `gusset`."""

from __future__ import annotations

import os
import shutil
import sysconfig
from pathlib import Path

from ._errors import GussetError


class MissingBinary(GussetError, FileNotFoundError):
    """The program `gusset` is not installed beside this module."""


def binary() -> str:
    """Path of the program `gusset`: that of this installation, else the first one on PATH.

    The environment variable GUSSET_BINARY names another one.
    """
    named = os.environ.get("GUSSET_BINARY")
    if named:
        if not os.access(named, os.X_OK) or os.path.isdir(named):
            raise MissingBinary(f"GUSSET_BINARY names {named}, which is not a program. Correct or unset the variable.")
        return named
    for folder in _script_folders():
        path = Path(folder) / "gusset"
        if os.access(path, os.X_OK):
            return str(path)
    found = shutil.which("gusset")
    if found:
        return found
    raise MissingBinary(
        "The program gusset is neither beside this Python nor on PATH. "
        "Install the package with `pip install .` in the source folder, or set GUSSET_BINARY to the program."
    )


def _script_folders() -> list[str]:
    """Folders for programs: that of this environment, then that of `pip install --user`."""
    folders = [sysconfig.get_path("scripts")]
    user = f"{os.name}_user"
    if user in sysconfig.get_scheme_names():
        folders.append(sysconfig.get_path("scripts", user))
    return folders
