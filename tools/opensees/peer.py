"""Shared by the OpenSees scripts in this folder: the import of OpenSeesPy, and a report of one JSON object a line."""
import ctypes
import importlib.util
import json
import pathlib
import sys


def opensees():
    """OpenSeesPy. Its wheel carries the libraries it needs but is not linked to find them: they are loaded first."""
    spec = importlib.util.find_spec("openseespylinux")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        for name in ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3", "libgomp.so.1"):
            library = pathlib.Path(folder, "lib", name)
            if library.exists():
                try:
                    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
                except OSError:
                    pass  # the system has its own
    import openseespy.opensees as ops

    return ops


def material(ops, tag, text):
    """Makes the uniaxial material "Steel01:60,8000,0.05"; words among the parameters stay words."""

    def value(word):
        try:
            return float(word)
        except ValueError:
            return word

    kind, _, rest = text.partition(":")
    ops.uniaxialMaterial(kind, tag, *[value(word) for word in rest.split(",")])


def tell(**report):
    """One line on stdout. OpenSees may end the process without a word, so nothing waits in a buffer."""
    sys.stdout.write(json.dumps(report) + "\n")
    sys.stdout.flush()
