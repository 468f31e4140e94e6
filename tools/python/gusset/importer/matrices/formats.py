"""Reads the files in which programs write their assembled matrices. The content of a file tells its format.

Sources: Matrix Market: R. Boisvert, R. Pozo and K. Remington, NISTIR 5935 (1996). Harwell-Boeing: I. Duff, R. Grimes and J. Lewis,
Users' guide for the Harwell-Boeing sparse matrix collection, TR/PA/92/86 (1992). Abaqus: manual, "Generating matrices" and keyword
*MATRIX INPUT. ANSYS: manual of the commands HBMAT and *EXPORT. SAP2000: help on the options of the solver.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from .. import Refused

LARGEST = 100_000  # rows of a matrix of a test file
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
ANSYS_DIRECTIONS = dict(zip(("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ"), DIRECTIONS))
HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Dof:
    """A degree of freedom: a node by its name in the other program, and one of the directions."""

    node: str
    direction: str

    @property
    def is_rotation(self) -> bool:
        return self.direction.startswith("r")

    def order(self) -> tuple[int, int]:
        """By nodes that are numbers, then by directions."""
        return int(self.node), DIRECTIONS.index(self.direction)


@dataclass(frozen=True)
class Matrix:
    """A matrix of a file.

    `name` is the path of the file, or the name of the variable in it. `dofs` names the rows where the file does. A file that
    `is_open` gives no size: rows of zeros may follow. `title` is the title in the file.
    """

    name: str
    matrix: Any
    format: str
    dofs: list[Dof] | None = None
    is_open: bool = False
    title: str = ""


@dataclass(frozen=True)
class Names:
    """A file that names the rows of matrices in other files."""

    name: str
    dofs: list[Dof]


def read(path: Path) -> list[Matrix] | Names:
    """Everything that a file holds."""
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise Refused(f"{path}: {reason.strerror}") from None
    try:
        if content.startswith(b"%%MatrixMarket"):
            return [Matrix(str(path), market(content), "Matrix Market")]
        if content[:10] == b"MATLAB 5.0":
            return variables(of_library(scipy.io.loadmat, str(path)), "MATLAB 5")
        if HDF5 in (content[:8], content[512:520]):
            return variables(of_library(hdf5, path), "MATLAB 7.3")
        return text(str(path), content)
    except Refused as reason:
        raise Refused(f"{path}: {reason}") from None
    except (ValueError, OverflowError) as reason:
        raise Refused(f"{path}: cannot be read: {reason}. Write the file again with the other program") from None


def of_library(call: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a library. Libraries raise many kinds of exceptions for bytes that are no matrix."""
    try:
        return call(*arguments)
    except (Refused, ModuleNotFoundError):
        raise
    except Exception as reason:
        raise ValueError(str(reason) or type(reason).__name__) from None


def bounded(rows: int, columns: int) -> None:
    """Refuses a size before memory is reserved for it."""
    if not (0 < rows <= LARGEST and 0 < columns <= LARGEST):
        raise Refused(f"the file claims {rows} rows and {columns} columns, but 1 to {LARGEST} of each are allowed")


def market(content: bytes) -> Any:
    rows, columns, _, _, field, symmetry = of_library(scipy.io.mminfo, io.BytesIO(content))
    bounded(rows, columns)
    if field not in ("real", "integer", "double", "unsigned-integer") or symmetry not in ("general", "symmetric"):
        raise Refused(f"the matrix is {field} {symmetry}, but must be real or integer, and general or symmetric")
    return of_library(scipy.io.mmread, io.BytesIO(content))


def variables(found: dict[str, Any], kind: str) -> list[Matrix]:
    """The matrices among the variables of a MATLAB file."""
    matrices = []
    for name, value in found.items():
        if name.startswith("__") or getattr(value, "ndim", 0) != 2 or value.dtype.kind not in "fiubc" or min(value.shape) == 0:
            continue
        if hasattr(value, "check_format"):
            value.check_format(full_check=True)
        matrices.append(Matrix(name, value, kind))
    # A number is a matrix of one row to MATLAB.
    matrices = [one for one in matrices if one.matrix.shape != (1, 1)] or matrices
    if not matrices:
        names = ", ".join(name for name in found if not name.startswith("__")) or "none"
        raise Refused(f"no variable is a matrix of numbers; the variables are {names}. Save M and K as matrices")
    return matrices


def hdf5(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file of version 7.3. MATLAB stores columns first."""
    import h5py

    found: dict[str, Any] = {}
    with h5py.File(path, "r") as file:
        for name, value in file.items():
            if name.startswith("#"):
                continue
            if isinstance(value, h5py.Dataset):
                found[name] = array(value).T
            elif "MATLAB_sparse" in value.attrs:
                starts = np.asarray(value["jc"], dtype=np.int64)
                shape = (int(value.attrs["MATLAB_sparse"]), len(starts) - 1)
                bounded(*shape)
                # A matrix of zeros has neither `data` nor `ir`.
                data = array(value["data"]) if "data" in value else np.zeros(0)
                rows = np.asarray(value["ir"], dtype=np.int64) if "ir" in value else np.zeros(0, dtype=np.int64)
                found[name] = scipy.sparse.csc_array((data, rows, starts), shape=shape)
            else:
                found[name] = None
    return found


def array(dataset: Any) -> Any:
    """The numbers of a dataset. Complex ones have two fields."""
    values = np.asarray(dataset)
    return values["real"] + 1j * values["imag"] if values.dtype.names else values


def text(name: str, content: bytes) -> list[Matrix] | Names:
    """A file of one of the text formats."""
    if b"\0" in content:
        raise Refused("the format is not known. Write text, Matrix Market or a MATLAB file of version 7 or 7.3")
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    if len(lines) > 2 and re.match(r"[RCP][SUHZR][AE]\s", lines[2], re.IGNORECASE):
        return [Matrix(name, harwell_boeing(lines), "Harwell-Boeing", title=lines[0][:72])]
    numbered = [(number, line.strip()) for number, line in enumerate(lines, start=1)]
    # Abaqus begins comments and keywords with an asterisk.
    numbered = [(number, line) for number, line in numbered if line and not line.startswith("*")]
    if not numbered:
        raise Refused("the file holds no numbers")
    head = numbered[0][1].replace(",", " ").split() or [""]
    if head[0].lower() == "joint":
        return Names(name, equations(numbered[1:]))
    if head[0].lower() == "row":
        return [Matrix(name, triples(numbered[1:]), "SAP2000", is_open=True)]
    if any(mapped(line) for _, line in numbered[:3]):
        return Names(name, mapping(numbered))
    if len(head) == 5:
        return [labelled(name, numbered)]
    if len(head) == 3:
        return [Matrix(name, triples(numbered), "rows, columns and values", is_open=True)]
    number, line = numbered[0]
    raise Refused(
        f"line {number}: {line[:60]!r} is of no known format. Known are Matrix Market, MATLAB, Abaqus (MATRIX INPUT, "
        "COORDINATE), Harwell-Boeing and its .mapping, and SAP2000 (.TXE, .TXK, .TXM)"
    )


def fields(numbered: list[tuple[int, str]], count: int) -> tuple[Any, Any]:
    """Lines of `count - 1` whole numbers and a value: the whole numbers as rows of an array, and the values."""
    whole, values = [], []
    for number, line in numbered:
        parts = line.replace(",", " ").split()
        try:
            if len(parts) != count:
                raise ValueError
            whole.append([int(part) for part in parts[:-1]])
            values.append(real_number(parts[-1]))
        except ValueError:
            raise Refused(f"line {number}: {line[:60]!r} must be {count - 1} whole numbers and a value") from None
    return np.array(whole, dtype=np.int64).reshape(-1, count - 1), np.array(values)


def real_number(found: str) -> float:
    """A number, also of Fortran: 1.5D+03."""
    return float(found.replace("D", "e").replace("d", "e"))


def triples(numbered: list[tuple[int, str]]) -> Any:
    """A matrix of lines with row, column and value; of a symmetric matrix also one triangle alone."""
    places, values = fields(numbered, 3)
    if len(values) == 0:
        raise Refused("the file holds no entries")
    if places.min() < 1:
        raise Refused(f"row or column {places.min()}, but both count from 1")
    bounded(int(places.max()), int(places.max()))
    return whole_matrix(places[:, 0] - 1, places[:, 1] - 1, values, int(places.max()))


def whole_matrix(rows: Any, columns: Any, values: Any, size: int) -> Any:
    """The matrix of entries of both triangles, or of one triangle of a symmetric matrix."""
    keys = rows * size + columns
    if len(np.unique(keys)) != len(keys):
        raise Refused("an entry is given twice. Write the assembled matrix, not those of the elements")
    if np.all(rows >= columns) or np.all(rows <= columns):
        mirrored = rows != columns
        values = np.concatenate([values, values[mirrored]])
        rows, columns = np.concatenate([rows, columns[mirrored]]), np.concatenate([columns, rows[mirrored]])
    return scipy.sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsr()


def labelled(name: str, numbered: list[tuple[int, str]]) -> Matrix:
    """Abaqus, FORMAT=MATRIX INPUT: node and degree of freedom of the row, those of the column, and the value."""
    labels, values = fields(numbered, 5)
    ends = np.concatenate([labels[:, :2], labels[:, 2:]])
    if ends[:, 0].min() < 1:
        raise Refused(
            f"node {ends[:, 0].min()} is internal to Abaqus, and the motion of its degrees of freedom is not known. Replace "
            "elements that have such nodes (B31 instead of B33, no hybrid elements), contact and connectors"
        )
    if not np.all((1 <= ends[:, 1]) & (ends[:, 1] <= 6)):
        other = ends[(ends[:, 1] < 1) | (ends[:, 1] > 6)][0]
        raise Refused(
            f"degree of freedom {other[1]} of node {other[0]} is neither a displacement nor a rotation (1 to 6). Export the "
            "structure alone"
        )
    known, places = np.unique(ends[:, 0] * 8 + ends[:, 1], return_inverse=True)
    rows, columns = places.reshape(2, -1)
    bounded(len(known), len(known))
    dofs = [Dof(str(key // 8), DIRECTIONS[key % 8 - 1]) for key in known]
    return Matrix(name, whole_matrix(rows, columns, values, len(known)), "Abaqus", dofs)


def equations(numbered: list[tuple[int, str]]) -> list[Dof]:
    """SAP2000, .TXE: a joint and the equations of its six directions. Zero is restrained, a negative number constrained.

    The numbers of a joint may go on in the next line. The joint of a constraint may share the equations of another joint.
    """
    separator = "\t" if any("\t" in line for _, line in numbered) else None
    parts = [part.strip() for _, line in numbered for part in line.split(separator) if part.strip()]
    found: dict[int, Dof] = {}
    for at in range(0, len(parts), 7):
        joint, *words = parts[at : at + 7]
        try:
            numbers = [int(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) != 6:
            raise Refused(f"joint {joint} has the numbers {' '.join(words)}, but needs six numbers of equations")
        for equation, direction in zip(numbers, DIRECTIONS):
            if equation > 0 and found.setdefault(equation, Dof(joint, direction)).direction != direction:
                raise Refused(f"equation {equation} is given to two directions, also to {direction} of joint {joint}")
    return in_order(found)


def mapped(line: str) -> re.Match[str] | None:
    return re.fullmatch(r"(\d+)[,\s]+(\d+)[,\s]+([A-Z][A-Z0-9]*)", line)


def mapping(numbered: list[tuple[int, str]]) -> list[Dof]:
    """ANSYS, .mapping: number of the equation, node and label of the direction. Lines before them are a heading."""
    found: dict[int, Dof] = {}
    for number, line in numbered:
        match = mapped(line)
        if match is None:
            if not found:
                continue
            raise Refused(f"line {number}: {line[:60]!r} must be a number of an equation, a node and a label")
        equation, node, label = match.groups()
        if label not in ANSYS_DIRECTIONS:
            raise Refused(f"line {number}: {label} is no displacement or rotation ({', '.join(ANSYS_DIRECTIONS)})")
        found[int(equation)] = Dof(node, ANSYS_DIRECTIONS[label])
    return in_order(found)


def in_order(found: dict[int, Dof]) -> list[Dof]:
    """The names of the equations 1 to n."""
    missing = next((number for number in range(1, len(found) + 1) if number not in found), None)
    if missing is not None or not found:
        raise Refused(f"equation {missing or 1} has no name, and {len(found)} have one")
    return [found[number] for number in range(1, len(found) + 1)]


def harwell_boeing(lines: list[str]) -> Any:
    """Columns, rows and values by Fortran formats. SciPy reads no symmetric matrix and no right-hand side."""
    kind = lines[2][:3].upper()
    if kind[0] != "R" or kind[1] not in "SU" or kind[2] != "A":
        raise Refused(f"the type is {kind}, but must be RSA or RUA: a real, assembled matrix with values")
    cards = [int(part) for part in lines[1].split()[:5]]
    rows, columns, entries = (int(part) for part in lines[2][3:].split()[:3])
    bounded(rows, columns)
    has_rhs = len(cards) == 5 and cards[4] > 0
    widths = [int(width) for width in re.findall(r"[IEDFG]\s*(\d+)", lines[3].upper())]
    if len(cards) < 4 or len(widths) < 3:
        raise Refused("the header has no formats of pointers, rows and values")
    at = 5 if has_rhs else 4
    parts = []
    for count, width, wanted in zip(cards[1:4], widths, (columns + 1, entries, entries)):
        section = lines[at : at + count]
        fixed = " ".join(section).split()
        if len(fixed) != wanted:  # numbers of fixed width may touch
            fixed = [line[place : place + width] for line in section for place in range(0, len(line.rstrip()), width)]
        if len(fixed) != wanted:
            raise Refused(f"{len(fixed)} numbers from line {at + 1} on, but the header claims {wanted}")
        parts.append(fixed)
        at += count
    pointers, places = (np.array([int(part) - 1 for part in fixed], dtype=np.int64) for fixed in parts[:2])
    values = np.array([real_number(part) for part in parts[2]])
    matrix = scipy.sparse.csc_array((values, places, pointers), shape=(rows, columns))
    matrix.check_format(full_check=True)
    if kind[1] == "S":
        entries_of = matrix.tocoo()
        return whole_matrix(entries_of.row.astype(np.int64), entries_of.col.astype(np.int64), matrix.data, rows)
    return matrix
