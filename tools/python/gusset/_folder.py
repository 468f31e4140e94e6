"""Reads run folders. Arrays are views into the mapped file `samples.bin`; nothing is copied."""

from __future__ import annotations

import difflib
import functools
import json
import mmap
import os
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _toml
from ._errors import GussetError

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas

Array = npt.NDArray[np.float64]

MARK = int.from_bytes(b"ROW\n", "little")
STEP, TRIPPED = 3.0, 8.0  # states of ticks: a step ends here, a limit ended the test
RUNNING = (STEP, 11.0, 12.0, 13.0)  # a step, and ticks between two steps
QUANTITIES = {
    "disp": "x",
    "vel": "v",
    "acc": "a",
    "displacement": "x",
    "velocity": "v",
    "acceleration": "a",
}


class FolderError(GussetError, ValueError):
    """A folder that is no run folder, or whose samples cannot be read."""


@dataclass(frozen=True)
class Column:
    """A column of `samples.bin`."""

    name: str
    unit: str
    meaning: str
    is_timing: bool
    """True if the values depend on wall time. All other columns are equal in every repetition."""
    place: int
    """Place in a row, from 0."""


class Run:
    """A run folder.

    All arrays are read-only views into the file `samples.bin`, one value per tick; change a copy, `numpy.array(run.time)`. They
    cover the ticks from t = 0 to the end of the test, holds included. `all_rows` also has the ticks before and after. For n
    ticks, a column has the shape (n,). A tick is a step of the integration, or a part of one in a multi-rate test.

    Attributes:
        folder: The run folder.
        columns: The columns by name, with unit and meaning.
        is_complete: False if the test still runs or was killed: then there is no summary.
        rows_lost: Number of rows that are missing between the recorded ones.
    """

    def __init__(self, folder: str | os.PathLike[str], *, verify: bool = False) -> None:
        self.folder = Path(folder)
        layout = self._layout()
        self.columns: dict[str, Column] = {
            c["name"]: Column(c["name"], c["unit"], c["meaning"], c["timing"], place) for place, c in enumerate(layout["columns"])
        }
        rows = self._map(layout, verify)
        self._rows: npt.NDArray[Any] = rows
        shape = (len(rows), len(self.columns))
        self._matrix: Array = np.ndarray(shape, "<f8", rows, 8, (layout["stride"], 8)) if len(rows) else np.empty(shape)
        sequence = rows["sequence"]
        self.rows_lost = int(sequence[-1]) + 1 - len(rows) if len(rows) else 0
        self._span = self._test_rows()
        release(rows)
        self.is_complete = (self.folder / "summary.json").exists()

    def _layout(self) -> dict[str, Any]:
        path = self.folder / "samples.json"
        try:
            layout: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (FileNotFoundError, NotADirectoryError):
            kind = "is not a run folder: it has no samples.json" if self.folder.is_dir() else "no such run folder"
            raise FolderError(f"{self.folder}: {kind}") from None
        except ValueError as reason:
            raise FolderError(f"{path}: {reason}") from None
        if layout.get("format") != "gusset-samples" or layout.get("version") != 1:
            raise FolderError(
                f"{path} is not a layout of samples, version 1: install the version of this package that wrote the run"
            )
        if layout["stride"] != 16 + 8 * len(layout["columns"]):
            raise FolderError(f"{path}: {len(layout['columns'])} columns do not have the stride {layout['stride']}")
        return layout

    def _map(self, layout: dict[str, Any], verify: bool) -> npt.NDArray[Any]:
        """Maps the rows up to the last whole one that has its mark, its checksum and a higher number than the row before."""
        path, stride = self.folder / "samples.bin", layout["stride"]
        dtype = np.dtype(layout["numpy_dtype"])
        try:
            count = path.stat().st_size // stride
        except FileNotFoundError:
            raise FolderError(f"{self.folder} has no samples.bin") from None
        if not count:
            return np.empty(0, dtype)
        rows = np.memmap(path, dtype, "r", shape=(count,))
        sound = rows["marker"] == MARK
        sound[1:] &= rows["sequence"][1:] > rows["sequence"][:-1]
        count = count if sound.all() else int(sound.argmin())
        data = memoryview(rows.view(np.ndarray).view(np.uint8))  # type: ignore[arg-type]
        checked = range(count) if verify else range(max(0, count - 1), count)
        for row in checked:
            if not has_checksum(data[row * stride : (row + 1) * stride]):
                count = row
                break
        return rows[:count]

    def _test_rows(self) -> slice:
        """The rows from t = 0 to the end of the test. The row of a trip is the last one, if its step is a new one."""
        state, step = (self._matrix[:, self.columns[name].place] for name in ("state", "step"))
        running = np.isin(state, RUNNING)
        if not running.any():
            return slice(0, 0)
        end = len(running) - int(running[::-1].argmax())
        if end < len(state) and state[end] == TRIPPED and step[end] != step[end - 1]:
            end += 1
        return slice(int(running.argmax()), end)

    def __repr__(self) -> str:
        status = self.summary.get("status") if self.is_complete else "without summary"
        return f"<gusset.Run {self.folder}: {status}, {len(self)} ticks, {len(self.columns)} columns>"

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the folder, which the other process opens."""
        return Run, (self.folder.resolve(),)

    def __bool__(self) -> bool:
        """True, also without any tick."""
        return True

    def __len__(self) -> int:
        """Number of ticks."""
        return len(range(*self._span.indices(len(self._rows))))

    def __getitem__(self, key: str | tuple[str, int]) -> Array:
        """One column, or the response of degrees of freedom.

        `run["force_1_1"]` is a column by its name, see `columns`. `run["disp", 3]` is the displacement of degree of freedom 3
        (counted from 1), shape (n,), in m (rad). `run["disp"]` has all recorded ones, shape (n, degrees of freedom). The same
        with "vel" in m/s and "acc" in m/s2. All are relative to the ground. For a storey, `run["acc", 3] + run.ground` is the
        absolute acceleration.
        """
        if isinstance(key, tuple):
            if len(key) != 2 or key[0] not in QUANTITIES:
                raise KeyError(f'{key!r}: write run["disp", DOF]; the quantities are "disp", "vel" and "acc"')
            name = f"{QUANTITIES[key[0]]}{key[1]}"
            if name not in self.columns:
                raise KeyError(f"degree of freedom {key[1]} is not recorded; recorded are {numbers(self.dofs)}")
            return self._column(name)
        if key in QUANTITIES:
            return self._block([f"{QUANTITIES[key]}{dof}" for dof in self.dofs])
        return self._column(key)

    def _column(self, name: str) -> Array:
        column = self.columns.get(name)
        if column is None:
            near = difflib.get_close_matches(str(name), self.columns, 3)
            help = f"; did you mean {', '.join(near)}?" if near else "; run.columns has all names"
            raise KeyError(f"{self.folder} has no column {name!r}{help}")
        return self._matrix[self._span, column.place]

    def _block(self, names: list[str]) -> Array:
        """Several columns side by side, as one view: their distance in a row is constant."""
        places = [self.columns[name].place for name in names]
        steps = set(np.diff(places).tolist()) or {1}
        if len(steps) > 1:
            raise FolderError(f"the columns {', '.join(names)} have no constant distance; read them one by one")
        step = steps.pop()
        return self._matrix[self._span, places[0] : places[-1] + 1 : step] if places else self._matrix[self._span, :0]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    @property
    def time(self) -> Array:
        """Test time of each tick, s, shape (n,)."""
        return self._column("time")

    @property
    def ground(self) -> Array:
        """Acceleration of the ground, m/s2, shape (n,)."""
        return self._column("ground")

    @property
    def rows(self) -> npt.NDArray[Any]:
        """The rows as a structured array of shape (n,), with the fields `sequence` and one for each column."""
        return self._rows[self._span]

    @property
    def all_rows(self) -> Run:
        """This run with all recorded ticks, also those before t = 0 and after the end of the test."""
        other = Run.__new__(Run)  # not `copy`, which would open the folder again
        other.__dict__.update(self.__dict__)
        other._span = slice(0, len(self._rows))
        return other

    @functools.cached_property
    def dofs(self) -> list[int]:
        """Numbers of the recorded degrees of freedom, from 1."""
        return [int(name[1:]) for name in self.columns if name[0] == "x" and name[1:].isdecimal()]

    @functools.cached_property
    def config(self) -> dict[str, Any]:
        """The complete configuration, `resolved.toml`."""
        return _toml.read(self.folder / "resolved.toml")

    @functools.cached_property
    def specimens(self) -> list[str]:
        """Names of the specimens, in the order of the test file."""
        return [specimen["name"] for specimen in self.config.get("specimen", [])]

    def specimen(self, name: str) -> RunSpecimen:
        """The response of one specimen, by its name in the test file."""
        if name not in self.specimens:
            raise KeyError(f"{self.folder} has no specimen {name!r}; it has {', '.join(map(repr, self.specimens)) or 'none'}")
        return RunSpecimen(self, name, self.specimens.index(name) + 1)

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """The content of `summary.json`: status, reason, peaks, timing, limits. Empty while the test runs, and after a crash.

        The values are in SI units. `summary["peak"]["displacement"]` has one number for each degree of freedom, m.
        """
        path = self.folder / "summary.json"
        summary: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return summary

    @functools.cached_property
    def events(self) -> list[dict[str, Any]]:
        """The events of `events.jsonl`, in their order. A line that a crash cut short is left out."""
        path = self.folder / "events.jsonl"
        if not path.exists():
            return []
        lines = path.read_text(encoding="utf-8").split("\n")
        return [json.loads(line) for line in lines[:-1] if line]

    @property
    def status(self) -> str | None:
        """How the test ended: "completed", "stopped", "interrupted" or "failed"; None without a summary."""
        return self.summary.get("status")

    @property
    def reason(self) -> str | None:
        """Why the test ended; None without a summary."""
        return self.summary.get("reason")

    def step_rows(self) -> npt.NDArray[np.intp]:
        """Places of the rows of a CSV export among the ticks of this run: the last tick of each step, shape (steps,)."""
        ends = np.flatnonzero(np.isin(self._column("state"), (STEP, TRIPPED)))
        step = self._column("step")[ends]
        return ends[np.append(step[1:] != step[:-1], True)] if len(step) else ends

    def to_pandas(self, columns: Iterable[str] | None = None, *, rate: str = "step") -> pandas.DataFrame:
        """Copies columns into a DataFrame, with the test time in s as its index. Needs pandas.

        Args:
            columns: Names of columns; all by default.
            rate: "step" has the rows of `gusset export`, one for each step. "tick" has all ticks.
        """
        if rate not in ("step", "tick"):
            raise ValueError(f'rate {rate!r}: write "step" or "tick"')
        pandas = need("pandas")
        names = list(self.columns) if columns is None else list(columns)
        rows = self.step_rows() if rate == "step" else slice(None)
        data = {name: self._column(name)[rows] for name in names if name != "time"}
        return pandas.DataFrame(data, index=pandas.Index(self.time[rows], name="time"), copy=True)

    def plot(self, file: str | os.PathLike[str] | None = None) -> matplotlib.figure.Figure:
        """Draws the ground motion, the displacements, and force over displacement of each specimen. Needs matplotlib.

        Args:
            file: Where to save the picture (PNG, SVG or PDF by its ending). Without it, the figure is only returned: a notebook
                shows it, and in a script `matplotlib.pyplot.show()` does.
        """
        from ._plot import plot

        return plot(self, file)


class RunSpecimen:
    """The response of one specimen. Arrays are views of shape (n,) for one axis, else of shape (n, axes)."""

    def __init__(self, run: Run, name: str, number: int) -> None:
        self.run, self.name, self.number = run, name, number
        prefix = f"force_{number}_"
        self.axes = sum(column.startswith(prefix) for column in run.columns)

    def __repr__(self) -> str:
        return f"<specimen {self.name!r} of {self.run.folder}: {self.axes} axes>"

    def __getitem__(self, quantity: str) -> Array:
        """A column of each axis by the start of its name, for example "kt" for `kt_1_1`, or one of the specimen, "status"."""
        names = [f"{quantity}_{self.number}_{axis + 1}" for axis in range(self.axes)]
        if names and all(name in self.run.columns for name in names):
            block = self.run._block(names)
            return block[:, 0] if self.axes == 1 else block
        return self.run._column(f"{quantity}_{self.number}")

    @property
    def target(self) -> Array:
        """Displacement that the structure asks for, m (rad)."""
        return self["target"]

    @property
    def command(self) -> Array:
        """Displacement that was sent, in the unit of the specimen (m by default)."""
        return self["cmd"]

    @property
    def disp(self) -> Array:
        """Measured displacement as the loop used it, m (rad)."""
        return self["meas"]

    @property
    def force(self) -> Array:
        """Measured force as the loop used it, N (N*m)."""
        return self["force"]

    @property
    def status(self) -> Array:
        """Status bits of the specimen and of its link, shape (n,)."""
        return self["status"]


def open(folder: str | os.PathLike[str], *, verify: bool = False) -> Run:
    """Opens a run folder, also of a test that still runs or was killed.

    The numbers and marks of all rows are checked, and the checksum of the last one. The run ends before the first damaged row.

    Args:
        folder: The run folder.
        verify: Checks the checksums of all rows, about 1 s per million rows.
    """
    return Run(folder, verify=verify)


def release(rows: npt.NDArray[Any]) -> None:
    """Returns the memory of a mapped file to the system. The next use of a row maps it again."""
    base: Any = rows
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap):
        base.madvise(mmap.MADV_DONTNEED)


def has_checksum(row: Any) -> bool:
    """True if the CRC-32 of a row is right."""
    (checksum,) = struct.unpack_from("<I", row, len(row) - 8)
    return bool(checksum == zlib.crc32(row[:-8]))


def numbers(values: list[int]) -> str:
    """A list for people: 1 to 5, 9."""
    parts: list[list[int]] = []
    for value in values:
        if parts and parts[-1][-1] == value - 1:
            parts[-1] = [parts[-1][0], value]
        else:
            parts.append([value])
    return ", ".join(" to ".join(map(str, part)) for part in parts) or "none"


def need(package: str) -> Any:
    """Imports an optional package."""
    try:
        return __import__(package, fromlist=["_"])
    except ModuleNotFoundError:
        name = package.split(".")[0]
        raise ImportError(f"this method needs {name}: pip install {name}") from None
