"""Writes a test file from the mass, stiffness and damping matrices of another program."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from .. import Refused, units
from . import formats, model
from .formats import DIRECTIONS, Dof, Matrix, Names

# Words of a name or a title that say which matrix it is. Those of structural damping (Abaqus: DMPS) are missing: it is not viscous.
WORDS = {
    "mass": {"m", "mass", "massmatrix", "mmatrix", "mgg", "mff", "txm"},
    "stiffness": {"k", "stiffness", "stiff", "stif", "stiffnessmatrix", "kmatrix", "kgg", "kff", "txk"},
    "damping": {"c", "damping", "damp", "dampingmatrix", "cmatrix", "cgg", "cff", "dmpv"},
}


def run(options: dict[str, Any]) -> int:
    """Reads, checks and converts the matrices, and writes the folder. Returns the exit code."""
    scale = units.parse(options["units"])
    direction = options["direction"]
    if direction not in DIRECTIONS[:3]:
        raise Refused(f"--direction {direction}: x, y or z is needed")
    matrices: list[Matrix] = []
    names: list[Names] = []
    for file in options["files"]:
        found = formats.read(Path(file))
        if isinstance(found, Names):
            names.append(found)
        else:
            matrices.extend(found)
    chosen: dict[str, Matrix] = {}
    for role in WORDS:
        matrix = choose(role, options[role], matrices)
        if matrix is not None:
            if any(matrix is other for other in chosen.values()):
                raise Refused(
                    f"{matrix.name} would be two matrices of the model. Choose them with --mass, --stiffness and --damping"
                )
            chosen[role] = matrix
        elif role != "damping":
            raise Refused(f"no {role} matrix was found; the matrices are {listed(matrices)}. Choose one with --{role} NAME")
    dofs = align(chosen, names, options["dofs"])
    result = model.convert(dofs, {role: matrix.matrix for role, matrix in chosen.items()}, scale)
    sources = [f"{role}: {matrix.name}, {matrix.format}" for role, matrix in chosen.items()]
    model.write(result, direction, options["units"], sources, Path(options["out"]))
    return 0


def listed(matrices: list[Matrix]) -> str:
    return ", ".join(matrix.name for matrix in matrices) or "none"


def words(matrix: Matrix) -> set[str]:
    """The words of the name and of the title."""
    return set(re.split("[^a-z]+", f"{Path(matrix.name).name} {matrix.title}".lower()))


def choose(role: str, wanted: str | None, matrices: list[Matrix]) -> Matrix | None:
    """The matrix of this role: that of the option, or else the only one with a fitting name."""
    if wanted is not None:
        fitting = [matrix for matrix in matrices if wanted in (matrix.name, Path(matrix.name).name)]
        if not fitting:
            raise Refused(f"--{role} {wanted}: there is no such matrix; the matrices are {listed(matrices)}")
    else:
        fitting = [matrix for matrix in matrices if WORDS[role] & words(matrix)]
        if role == "damping":  # C may also be the matrix of outputs of a state space
            fitting = [matrix for matrix in fitting if matrix.matrix.shape[0] == matrix.matrix.shape[1]]
    if len(fitting) > 1:
        raise Refused(f"{len(fitting)} matrices can be the {role} matrix: {listed(fitting)}. Choose one with --{role} NAME")
    return fitting[0] if fitting else None


def align(chosen: dict[str, Matrix], names: list[Names], given: str | None) -> list[Dof]:
    """Brings the matrices to one order of rows, and returns the names of these rows."""
    for role, matrix in chosen.items():
        chosen[role] = model.checked(matrix)
    labels = {role: matrix.dofs for role, matrix in chosen.items() if matrix.dofs is not None}
    named = [chosen[role].name for role in labels] + [one.name for one in names]
    if named and given is not None:
        raise Refused(f"--dofs is for matrices without names, but {named[0]} has names")
    if labels:
        if len(labels) < len(chosen) or names:
            raise Refused(f"{named[0]} names its degrees of freedom, and another file does it otherwise. Export all in one format")
        dofs = sorted({dof for found in labels.values() for dof in found}, key=Dof.order)
        places = {dof: place for place, dof in enumerate(dofs)}
        for role, found in labels.items():
            chosen[role] = model.placed(chosen[role], [places[dof] for dof in found], len(dofs))
        return dofs
    if names:
        dofs = names[0].dofs
        for other in names[1:]:
            if other.dofs != dofs:
                raise Refused(f"{names[0].name} and {other.name} name different degrees of freedom")
        size, source = len(dofs), names[0].name
    else:
        sizes = {role: matrix.matrix.shape[0] for role, matrix in chosen.items()}
        role = max(sizes, key=lambda role: sizes[role])
        size, source = sizes[role], chosen[role].name
        dofs = model.repeated(given, size)
    for role, matrix in chosen.items():
        rows = matrix.matrix.shape[0]
        if rows > size or (rows < size and not matrix.is_open):
            raise Refused(f"{matrix.name} has {rows} rows, but {source} has {size}. Export them from the same model")
        chosen[role] = model.placed(matrix, range(rows), size)
    return dofs
