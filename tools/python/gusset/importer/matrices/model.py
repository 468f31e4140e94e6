"""Checks matrices, converts them to SI units, and writes them with a test file."""

from __future__ import annotations

import csv
import os
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from .. import Refused
from ..units import Units
from .formats import DIRECTIONS, Dof, Matrix

ASYMMETRY = 1e-9  # largest difference between an entry and its mirror, as a share of the largest entry
SUPPORT = 1e30  # Abaqus writes 1e36 on the diagonal of a supported direction


@dataclass(frozen=True)
class Model:
    """Symmetric matrices in SI units, the names of their rows, and what was left out."""

    dofs: list[Dof]
    matrices: dict[str, Any]
    notes: list[str]


def checked(matrix: Matrix) -> Matrix:
    """The matrix in compressed rows: real, square and finite."""
    if matrix.matrix.dtype.kind == "c":
        raise Refused(f"{matrix.name} is complex, but must be real")
    rows, columns = matrix.matrix.shape
    if rows != columns:
        raise Refused(f"{matrix.name} has {rows} rows and {columns} columns, but must be square")
    values = scipy.sparse.csr_array(matrix.matrix, dtype=np.float64)
    values.eliminate_zeros()
    if not np.all(np.isfinite(values.data)):
        place = values.tocoo()
        at = np.flatnonzero(~np.isfinite(place.data))[0]
        raise Refused(f"{matrix.name}: entry ({place.row[at] + 1}, {place.col[at] + 1}) is {place.data[at]}, but must be finite")
    return replace(matrix, matrix=values)


def placed(matrix: Matrix, places: Sequence[int], size: int) -> Matrix:
    """The matrix in a larger one, whose row `places[i]` is its row i."""
    entries = matrix.matrix.tocoo()
    to = np.asarray(places, dtype=np.int64)
    moved = scipy.sparse.coo_array((entries.data, (to[entries.row], to[entries.col])), shape=(size, size))
    return replace(matrix, matrix=moved.tocsr())


def repeated(given: str | None, size: int) -> list[Dof]:
    """The names by `--dofs`: a list of directions, repeated for every node."""
    if given is None:
        raise Refused(
            f"these matrices do not name their {size} degrees of freedom. Give the directions of one node, or of all degrees of "
            "freedom, for example --dofs x,y,rz, or --dofs x if all are displacements in x"
        )
    directions = [part.strip() for part in given.split(",")]
    for part in directions:
        if part not in DIRECTIONS:
            raise Refused(f"--dofs: {part!r} is no direction; the directions are {', '.join(DIRECTIONS)}")
    if size % len(directions) != 0:
        raise Refused(f"--dofs has {len(directions)} directions, but the {size} degrees of freedom are no multiple of them")
    return [Dof(str(place // len(directions) + 1), directions[place % len(directions)]) for place in range(size)]


def convert(dofs: list[Dof], matrices: dict[str, Any], units: Units) -> Model:
    """The model in SI units, without supported directions and without rows of zeros."""
    notes = []
    supported = np.abs(matrices["stiffness"].diagonal()) >= SUPPORT
    empty = ~supported
    for matrix in matrices.values():
        empty &= np.diff(matrix.indptr) == 0
    for reason, left_out in (
        ("supported (1e30 or more on the diagonal of the stiffness matrix)", supported),
        ("without mass and stiffness", empty),
    ):
        if left_out.any():
            some = [f"{dofs[at].node}.{dofs[at].direction}" for at in np.flatnonzero(left_out)[:6]]
            more = ", ..." if left_out.sum() > len(some) else ""
            notes.append(f"{left_out.sum()} degrees of freedom are {reason} and were left out: {', '.join(some)}{more}")
    kept = np.flatnonzero(~(supported | empty))
    if len(kept) == 0:
        raise Refused("no degree of freedom is left. " + "; ".join(notes))
    dofs = [dofs[at] for at in kept]
    # With displacements u in the unit of length and rotations in rad, the energy u·K·u/2 is in force times length.
    length = np.array([1.0 if dof.is_rotation else units.length for dof in dofs])
    times = {"mass": units.time**2, "stiffness": 1.0, "damping": units.time}
    converted = {}
    for role, matrix in matrices.items():
        entries = symmetric(role, matrix[kept][:, kept], dofs).tocoo()
        scale = units.force * units.length * times[role] / (length[entries.row] * length[entries.col])
        converted[role] = scipy.sparse.csr_array((entries.data * scale, (entries.row, entries.col)), shape=entries.shape)
    semi_definite(converted["mass"], dofs)
    return Model(dofs, converted, notes)


def symmetric(role: str, matrix: Any, dofs: list[Dof]) -> Any:
    """The mean of the matrix and its mirror, if they are almost equal."""
    difference = abs(matrix - matrix.T).tocoo()
    largest = abs(matrix).max()
    if difference.nnz > 0 and difference.data.max() > ASYMMETRY * largest:
        at = difference.data.argmax()
        row, column = difference.row[at], difference.col[at]
        raise Refused(
            f"the {role} matrix is not symmetric: row {called(dofs, row)}, column {called(dofs, column)} has "
            f"{matrix[row, column]:.9g}, but its mirror has {matrix[column, row]:.9g}. A difference of {ASYMMETRY:g} of the "
            f"largest entry, {largest:.3g}, is allowed"
        )
    return (matrix + matrix.T) / 2


def called(dofs: list[Dof], at: int) -> str:
    return f"{at + 1} ({dofs[at].node}.{dofs[at].direction})"


def semi_definite(mass: Any, dofs: list[Dof]) -> None:
    """Refuses a mass matrix with a negative diagonal, or with an entry that is too large for its two diagonal entries."""
    diagonal = mass.diagonal()
    if diagonal.min() < 0.0:
        at = int(diagonal.argmin())
        raise Refused(f"the mass of {called(dofs, at)} is {diagonal[at]:.4g} in SI units, but must not be negative")
    entries = mass.tocoo()
    excess = entries.data**2 - diagonal[entries.row] * diagonal[entries.col] * (1.0 + 1e-9)
    if excess.max(initial=0.0) > 0.0:
        at = int(excess.argmax())
        row, column = entries.row[at], entries.col[at]
        raise Refused(
            f"the mass matrix gives a negative kinetic energy: the entry of {called(dofs, row)} and {called(dofs, column)} is "
            f"{entries.data[at]:.4g}, with {diagonal[row]:.4g} and {diagonal[column]:.4g} on the diagonal"
        )


def write(model: Model, direction: str, units: str, sources: list[str], out: Path) -> None:
    """Writes the folder, or nothing."""
    influence = np.array([1.0 if dof.direction == direction else 0.0 for dof in model.dofs])
    if not influence.any():
        counts = Counter(dof.direction for dof in model.dofs)
        there = ", ".join(f"{counts[one]} in {one}" for one in DIRECTIONS if counts[one])
        raise Refused(f"--direction {direction}: no degree of freedom has this direction; there are {there}")
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise Refused(f"--out {out} exists and is not an empty folder; nothing was written. Choose another one")
    moved_mass = float(influence @ (model.matrices["mass"] @ influence))
    report = [
        *sources,
        f"{len(model.dofs)} degrees of freedom, {sum(dof.is_rotation for dof in model.dofs)} of them rotations",
        f"the mass that a translation in {direction} moves is {moved_mass:.6g} kg",
        *model.notes,
    ]
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=".gusset-import-") as temporary:
            folder = Path(temporary) / "model"
            folder.mkdir()
            for role, matrix in model.matrices.items():
                scipy.io.mmwrite(
                    str(folder / f"{role}.mtx"), matrix.tocoo(), comment=f" {role} in SI units", precision=17, symmetry="symmetric"
                )
            with (folder / "dofs.csv").open("w", newline="") as file:
                table = csv.writer(file)
                table.writerow(["dof", "node", "direction"])
                table.writerows((number, dof.node, dof.direction) for number, dof in enumerate(model.dofs, start=1))
            (folder / "model.toml").write_text(test_file(model, direction, influence, units, report), encoding="utf-8")
            os.replace(folder, out)
    except OSError as reason:
        raise Refused(f"--out {out}: {reason.strerror}") from None
    print(f"Written to {out}: {', '.join(sorted(os.listdir(out)))}")
    for line in report:
        print(f"  {line}")
    print(f"Next: read model.toml, then gusset check {out / 'model.toml'}")


def rows_of(numbers: Sequence[float]) -> str:
    """Numbers of a TOML list, 30 in a line."""
    texts = [str(int(number)) for number in numbers]
    lines = [", ".join(texts[at : at + 30]) for at in range(0, len(texts), 30)]
    return lines[0] if len(lines) == 1 else "\n    " + ",\n    ".join(lines) + ",\n"


def printable(text: str) -> str:
    """A text that cannot end a comment."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def test_file(model: Model, direction: str, influence: Any, units: str, comments: list[str]) -> str:
    """The commented test file."""
    rotations = [number for number, dof in enumerate(model.dofs, start=1) if dof.is_rotation]
    damping = "damping" in model.matrices
    example = int(np.flatnonzero(influence)[0])
    node = printable(model.dofs[example].node)
    row = ", ".join("1" if at == example else "0" for at in range(len(influence))) if len(influence) <= 30 else "..."
    about = "".join(f"#   {printable(line)}\n" for line in comments)
    structure = f"[structure]\nrotations = [{rows_of(rotations)}]\n\n" if rotations else ""
    no_damping = """
# There was no damping matrix. Without a rule the structure has no damping. For 2 % of critical damping in the first two modes:
# [structure.damping.rayleigh_ratio]
# ratio = 0.02
# modes = [1, 2]
"""
    specimen = f"""
# The specimen. The matrices must not contain its stiffness, or it acts twice. A row has one number for each DOF. For an axis that
# follows DOF {example + 1}, node {node}, direction {direction}, there is a 1 at this DOF:
# [[specimen]]
# name = "specimen"
# rows = [[{row}]]
# law.linear = {{ stiffness_n_per_m = 1e6 }}
"""
    return f"""# A structure from matrices of another program, converted to SI units. Its units were {printable(units)}.
{about}#
#   gusset check model.toml                  # reads and rehearses the test; nothing moves
#   gusset run model.toml --out runs/model   # runs it; the page runs/model/report.html shows the result
#
# dofs.csv has the number, the node and the direction of every degree of freedom. The directions are those of the nodes in the other
# program. More: gusset guide import

title = "Structure from matrices" # heading of the report

# Step, length and clock of the test.
[time]
rate_hz = 1024      # integration steps per second of test time, Hz
duration_s = 20     # length of the test, s
clock = "simulated" # "simulated": as fast as possible, for specimens that are computed; "real": in real time

{structure}# The influence vector is 1 for each displacement in {direction}, so the ground moves in {direction}.
[structure.matrices]
mass_file = "mass.mtx"
stiffness_file = "stiffness.mtx"
{'damping_file = "damping.mtx"' + chr(10) if damping else ""}influence = [{rows_of(influence)}]
{"" if damping else no_damping}
# A synthetic earthquake of 0.1 g, to be replaced by yours. More: gusset guide excitation
[excitation.ground_acceleration.signal.kanai_tajimi]
ground_frequency_hz = 2.4
ground_damping_ratio = 0.6
envelope = {{ jennings_housner = {{ rise_s = 2, strong_s = 8, decay_per_s = 0.4 }} }}
duration_s = 20
seed = 7
peak = 0.1
unit = "g"
{specimen}"""
