"""Runs an importer: the only argument is a JSON object with the options, and its `source` names the importer."""

from __future__ import annotations

import json
import sys
import traceback
from importlib import import_module

from . import Refused

# Packages that an importer needs beyond those of Gusset.
PACKAGES = {"scipy": "scipy", "h5py": "h5py", "openseespy": "openseespy"}


def main(options: str) -> int:
    """Exit code of the importer: 2 if it refuses the model, 5 after an internal error."""
    given = json.loads(options)
    source = given["source"]
    try:
        return int(import_module(f"gusset.importer.{source}").run(given))
    except Refused as reason:
        print(f"error: {reason}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as missing:
        name = (missing.name or "").split(".")[0]
        if missing.name == f"gusset.importer.{source}":
            print(f"error: this installation of Gusset has no importer for {source}", file=sys.stderr)
            return 2
        if name in PACKAGES:
            install = f"{sys.executable} -m pip install {PACKAGES[name]}"
            print(f"error: gusset import {source} needs the Python package {name}. Install it: {install}", file=sys.stderr)
            return 2
        traceback.print_exc()
    except KeyboardInterrupt:
        return 130
    except Exception:
        traceback.print_exc()
    print("error: this is a fault of gusset itself, not of the model", file=sys.stderr)
    return 5


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
