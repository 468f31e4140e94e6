"""Reads run folders. A column is read from `samples.bin` when it is first used: the file is never mapped, so that a file that
becomes shorter is an error and not a crash."""

from __future__ import annotations

import collections
import difflib
import functools
import json
import os
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from . import _toml
from ._errors import GussetError, UsageError
from ._files import Status, Summary

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas
    import xarray

Array = npt.NDArray[np.float64]
Quantity = Literal["disp", "vel", "acc", "displacement", "velocity", "acceleration"]
Rate = Literal["step", "tick"]

MARK = int.from_bytes(b"ROW\n", "little")
BLOCK = 1 << 22  # bytes of the file that are read at a time
MOST_EVENTS = 10_000  # of each kind in `Run.events`
LONGEST_LINE = 1 << 20  # bytes of a line of `events.jsonl`
KIND = re.compile(rb'"event": ?"([a-z_]{1,64})"')
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


@dataclass(frozen=True)
class Found:
    """The sound rows of a file."""

    count: int
    """Number of rows."""
    made: int
    """Number of rows that were made, with those that are missing between the others."""
    begin: int
    """The first row of the test, from 0."""
    end: int
    """The row after the last one of the test; 0 without any."""


class Run:
    """A run folder.

    All arrays are read-only, with one value per tick; change a copy, `numpy.array(run.time)`. They cover the ticks from t = 0 to
    the end of the test, holds included. `all_rows` also has the ticks before and after. For n ticks, a column has the shape
    (n,). A tick is a step of the integration, or a part of one in a multi-rate test.

    A column is read from `samples.bin` when it is first used, and then stays in memory. If the file has become shorter since
    the folder was opened, this raises `FolderError`.

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
        # A server numbers exchanges, some of which are trials; the steps are those of its controller.
        self._step = "commits" if "commits" in self.columns else "step"
        self._stride: int = layout["stride"]
        self._dtype = np.dtype(layout["numpy_dtype"])
        self._read: dict[tuple[str, ...], Array] = {}
        path = self.folder / "samples.bin"
        try:
            places = path.stat().st_size // self._stride
        except FileNotFoundError:
            raise FolderError(f"{self.folder} has no samples.bin") from None
        found = self._sound_rows(places, verify)
        if found.count and not verify and not has_checksum(self._bytes(found.count - 1, found.count)):
            found = self._sound_rows(found.count - 1, False)
        self._count = found.count
        self.rows_lost = found.made - found.count
        self._span = self._test_rows(found)
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

    def _blocks(self, start: int, stop: int) -> Iterator[npt.NDArray[np.uint64]]:
        """The rows from `start` to `stop` in blocks of some megabytes, as words: number, values, checksum and mark."""
        path = self.folder / "samples.bin"
        most = max(1, BLOCK // self._stride)
        with path.open("rb", buffering=0) as file:
            file.seek(start * self._stride)
            for first in range(start, stop, most):
                block = np.empty((min(most, stop - first), self._stride // 8), "<u8")
                room = block.data.cast("B")
                while room:
                    read = file.readinto(room)
                    if not read:
                        size = path.stat().st_size
                        raise FolderError(
                            f"{path} has become shorter since it was opened: it has {size} bytes, but row {stop - 1} ends at "
                            f"{stop * self._stride}. Open the folder again"
                        )
                    room = room[read:]
                yield block

    def _bytes(self, start: int, stop: int) -> memoryview:
        """The bytes of some rows."""
        blocks = list(self._blocks(start, stop))
        return np.concatenate(blocks).data.cast("B") if blocks else memoryview(b"")

    def _sound_rows(self, places: int, verify: bool) -> Found:
        """Finds the last whole row that has its mark and a higher number than the row before; `verify`: also its checksum.

        The file is read up to the first damaged row, whatever its length.
        """
        state = 1 + self.columns["state"].place
        count, made, begin, end = 0, 0, 0, 0
        for block in self._blocks(0, places):
            numbers = block[:, 0]
            sound = block.view("<u4")[:, -1] == MARK
            sound[0] &= numbers[0] >= made
            sound[1:] &= numbers[1:] > numbers[:-1]
            whole = len(block) if sound.all() else int(sound.argmin())
            if verify:
                right = (has_checksum(memoryview(block[row]).cast("B")) for row in range(whole))
                whole = next((row for row, is_right in enumerate(right) if not is_right), whole)
            running = np.flatnonzero(np.isin(block[:whole, state].view("<f8"), RUNNING))
            if len(running):
                begin = begin if end else count + int(running[0])
                end = count + int(running[-1]) + 1
            count += whole
            if whole:
                made = int(numbers[whole - 1]) + 1
            if whole < len(block):
                break
        return Found(count, made, begin, end)

    def _test_rows(self, found: Found) -> slice:
        """The rows from t = 0 to the end of the test. The row of a trip is the last one, if its step is a new one."""
        begin, end = found.begin, found.end
        if 0 < end < found.count:
            values = np.frombuffer(self._bytes(end - 1, end + 1), "<f8").reshape(2, -1)
            state, step = (values[:, 1 + self.columns[name].place] for name in ("state", self._step))
            end += bool(state[1] == TRIPPED and step[1] != step[0])
        return slice(begin, end)

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
        return len(range(self._span.start, self._span.stop))

    def __getitem__(self, key: str | tuple[Quantity, int]) -> Array:
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
        return self._block([self._known(name)])[:, 0]

    def _known(self, name: str) -> str:
        """The name, if there is such a column."""
        if name in self.columns:
            return name
        near = difflib.get_close_matches(str(name), self.columns, 3)
        help = f"; did you mean {', '.join(near)}?" if near else "; run.columns has all names"
        raise KeyError(f"{self.folder} has no column {name!r}{help}")

    def _block(self, names: Sequence[str]) -> Array:
        """Several columns side by side."""
        key = tuple(names)
        if key not in self._read:
            places = [1 + self.columns[name].place for name in names]
            values = np.empty((len(places), self._count)).T  # each column without gaps
            done = 0
            for block in self._blocks(0, self._count if places else 0):
                values[done : done + len(block)] = block.view("<f8")[:, places]
                done += len(block)
            values.flags.writeable = False
            self._read[key] = values
        return self._read[key][self._span]

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
        """The rows as a structured array of shape (n,), with the fields `sequence` and one for each column.

        All of them are read into memory.
        """
        rows: npt.NDArray[Any] = np.frombuffer(self._bytes(self._span.start, self._span.stop), self._dtype)
        rows.flags.writeable = False
        return rows

    @property
    def all_rows(self) -> Run:
        """This run with all recorded ticks, also those before t = 0 and after the end of the test."""
        other = Run.__new__(Run)  # not `copy`, which would open the folder again
        other.__dict__.update(self.__dict__)
        other._span = slice(0, self._count)
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
    def summary(self) -> Summary:
        """The content of `summary.json`: status, reason, peaks, timing, limits. Empty while the test runs, and after a crash.

        The values are in SI units. `summary["peak"]["displacement"]` has one number for each degree of freedom, m.
        """
        path = self.folder / "summary.json"
        summary: Summary = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return summary

    @property
    def events(self) -> list[dict[str, Any]]:
        """The events of `events.jsonl`, in their order: the first 10 000 of each kind. A line that a crash cut short is left out.

        `event_lines` reads all of them, one after the other.
        """
        return self._events[0]

    @property
    def events_left_out(self) -> dict[str, int]:
        """Number of events of each kind that are in `events.jsonl`, but not in `events`."""
        return self._events[1]

    @functools.cached_property
    def _events(self) -> tuple[list[dict[str, Any]], dict[str, int]]:
        events, counts = [], collections.Counter[bytes]()
        for line in self._event_texts():
            found = KIND.search(line)
            kind = found[1] if found else b""
            counts[kind] += 1
            if counts[kind] <= MOST_EVENTS:
                events.append(json.loads(line))
        return events, {kind.decode(): count - MOST_EVENTS for kind, count in counts.items() if count > MOST_EVENTS}

    def event_lines(self) -> Iterator[dict[str, Any]]:
        """Reads the events of `events.jsonl` one after the other, however many there are."""
        for line in self._event_texts():
            yield json.loads(line)

    def _event_texts(self) -> Iterator[bytes]:
        """The whole lines of `events.jsonl`; none that is longer than any event."""
        path = self.folder / "events.jsonl"
        if not path.exists():
            return
        with path.open("rb") as file:
            while line := file.readline(LONGEST_LINE):
                is_whole = line.endswith(b"\n")
                if is_whole and line.strip():
                    yield line
                while not is_whole and (rest := file.readline(LONGEST_LINE)):
                    is_whole = rest.endswith(b"\n")

    @property
    def status(self) -> Status | None:
        """How the test ended: "completed", "stopped", "interrupted" or "failed"; None without a summary."""
        return self.summary.get("status")

    @property
    def reason(self) -> str | None:
        """Why the test ended; None without a summary."""
        return self.summary.get("reason")

    @property
    def errors(self) -> dict[str, Any] | None:
        """Errors of the method ("method") and of the coupling ("coupling"), and the damping that the actuators add ("modes").

        Shares of the largest drift, the root mean square and the input energy. None if they were not computed.
        """
        return (self.summary.get("verdict") or {}).get("errors")

    def step_rows(self) -> npt.NDArray[np.intp]:
        """Places of the rows of a CSV export among the ticks of this run: the last tick of each step, shape (steps,)."""
        step, state = self._column(self._step), self._column("state")
        ends = np.flatnonzero(np.isin(state, (STEP, TRIPPED)))
        is_new = np.diff(step[ends], prepend=step[ends[:1]]) != 0
        ends = ends[(state[ends] == STEP) | is_new]  # the row of a trip within a step is not its end
        rows: npt.NDArray[np.intp] = ends[np.diff(step[ends], append=np.nan) != 0]
        return rows

    def to_pandas(self, columns: Iterable[str] | None = None, *, rate: Rate = "step") -> pandas.DataFrame:
        """Copies columns into a DataFrame, with the test time in s as its index. Needs pandas.

        `attrs["units"]` has the unit of each column and of the index by name, for example "m" for "x1".

        Args:
            columns: Names of columns; all by default.
            rate: "step" has the rows of `gusset export`, one for each step. "tick" has all ticks.

        Raises:
            KeyError: There is no such column.
            UsageError: Another word for `rate`.
            ImportError: pandas is not installed.
        """
        package = need("pandas")
        time, data = self._copied(columns, rate)
        frame: pandas.DataFrame = package.DataFrame(data, index=package.Index(time, name="time"))
        frame.attrs["units"] = {name: self.columns[name].unit for name in ("time", *data)}
        return frame

    def to_xarray(self, columns: Iterable[str] | None = None, *, rate: Rate = "step") -> xarray.Dataset:
        """Copies columns into a Dataset, with the test time in s as the coordinate "time". Needs xarray.

        Each column is a variable of shape (time,). The attributes `units` and `long_name` of each variable, and of "time", are the
        unit and the meaning of the column.

        Args:
            columns: Names of columns; all by default.
            rate: "step" has the rows of `gusset export`, one for each step. "tick" has all ticks.

        Raises:
            KeyError: There is no such column.
            UsageError: Another word for `rate`.
            ImportError: xarray is not installed.
        """
        package = need("xarray")
        time, data = self._copied(columns, rate)

        def variable(name: str, values: Array) -> tuple[str, Array, dict[str, str]]:
            return "time", values, {"units": self.columns[name].unit, "long_name": self.columns[name].meaning}

        series = {name: variable(name, values) for name, values in data.items()}
        dataset: xarray.Dataset = package.Dataset(series, coords={"time": variable("time", time)})
        return dataset

    def _copied(self, columns: Iterable[str] | None, rate: Rate) -> tuple[Array, dict[str, Array]]:
        """Copies of the test time and of columns by name, at this rate."""
        if rate not in get_args(Rate):
            raise UsageError(f'rate {rate!r}: write "step" or "tick"')
        names = list(self.columns) if columns is None else list(columns)
        rows = self.step_rows() if rate == "step" else np.arange(len(self))
        block = self._block([self._known(name) for name in names])
        data = {name: block[rows, place] for place, name in enumerate(names) if name != "time"}
        return self.time[rows], data

    def plot(self, file: str | os.PathLike[str] | None = None) -> matplotlib.figure.Figure:
        """Draws the ground motion, the displacements, and force over displacement of each specimen. Needs matplotlib.

        Args:
            file: Where to save the picture (PNG, SVG or PDF by its ending). Without it, the figure is only returned: a notebook
                shows it as the value of a cell, and in a script `matplotlib.pyplot.show()` does.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from ._plot import plot

        return plot(self, file)

    def _repr_png_(self) -> bytes | None:
        """The picture of `plot`, with which a notebook shows the run; None without matplotlib."""
        from ._plot import picture

        try:
            return picture(self)
        except ImportError:
            return None


class RunSpecimen:
    """The response of one specimen. Arrays have the shape (n,) for one axis, else (n, axes)."""

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
