"""`gusset campaign` from Python: many simulated tests of one study, and the table of their results."""

from __future__ import annotations

import csv
import difflib
import functools
import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._binary import binary
from ._errors import CampaignError, Interrupted, UsageError
from ._folder import Array, FolderError, need
from ._process import execute

if TYPE_CHECKING:
    import pandas

TEXTS = ("record", "ended")
COUNTS = ("task", "replicate")


@dataclass(frozen=True)
class TableColumn:
    """A column of the table of a campaign."""

    name: str
    """Name: a key of the test file, or a measure such as "max_drift"."""
    unit: str
    """SI unit; "1" for a pure number, "" for a text and for the unit of a key."""
    meaning: str
    """One line of explanation."""


@dataclass(frozen=True)
class Fragility:
    """A lognormal fragility curve, fitted by maximum likelihood: P(collapse) = Φ(ln(intensity / median) / dispersion).

    Attributes:
        median: Intensity with a probability of collapse of 0.5, in `unit`.
        dispersion: Standard deviation of the logarithm of the intensity.
        ln_median_error: Standard error of the logarithm of the median.
        dispersion_error: Standard error of the dispersion.
        intensity: The measure of intensity in words.
        unit: Unit of the intensity.
        levels: Levels of intensity, shape (k,), in `unit`.
        tests: Number of tests at each level that collapsed or came to their end, shape (k,). A test that a limit or a fault
            stopped before is not counted.
        collapses: Number of collapses among them, shape (k,).
    """

    median: float
    dispersion: float
    ln_median_error: float
    dispersion_error: float
    intensity: str
    unit: str
    levels: Array
    tests: Array
    collapses: Array

    def probability(self, intensity: npt.ArrayLike) -> Array:
        """Probability of collapse at an intensity, or at an array of them, in `unit`. The same shape as `intensity`."""
        with np.errstate(divide="ignore"):
            z = np.log(np.maximum(np.asarray(intensity, dtype=float), 0.0) / self.median) / self.dispersion
        return np.asarray([0.5 * math.erfc(-x / math.sqrt(2)) for x in z.ravel()]).reshape(z.shape)


class Campaign:
    """A campaign folder.

    Attributes:
        folder: The campaign folder.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        if not (self.folder / "plan.json").exists():
            kind = "is not a campaign folder: it has no plan.json" if self.folder.is_dir() else "no such campaign folder"
            raise FolderError(f"{self.folder}: {kind}")

    def __repr__(self) -> str:
        done = f"{self.summary['done']} of {self.summary['tasks']} tests" if self.summary else "without a table"
        return f"<gusset.Campaign {self.folder}: {done}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the folder, which the other process opens."""
        return Campaign, (self.folder.resolve(),)

    @functools.cached_property
    def plan(self) -> dict[str, Any]:
        """The content of `plan.json`: the study, its files with their digests, the number of tasks."""
        return read_json(self.folder / "plan.json")

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """The content of `summary.json`: counts, columns, fragility, provenance. Empty before the results are collected."""
        path = self.folder / "summary.json"
        return read_json(path) if path.exists() else {}

    @property
    def complete(self) -> bool:
        """True if the table has the result of every task."""
        return bool(self.summary.get("complete", False))

    @property
    def report(self) -> Path:
        """The report with its pictures, `report.html`. It exists once the results are collected."""
        return self.folder / "report.html"

    @functools.cached_property
    def columns(self) -> dict[str, TableColumn]:
        """The columns of the table by name, with unit and meaning."""
        return {c["name"]: TableColumn(c["name"], c["unit"], c["meaning"]) for c in self.summary.get("columns", [])}

    @functools.cached_property
    def table(self) -> npt.NDArray[Any]:
        """The table: a structured array of shape (tasks,), with one row for each test and one field for each column.

        Numbers are float64 in the unit of `columns`, and NaN where the table has none; `task` and `replicate` are int64. A column
        is a text if one of its values is no number. An incomplete campaign has the rows of the tests that are done.
        """
        if not self.summary:
            raise FolderError(
                f"{self.folder} has no table yet: `gusset campaign collect {self.folder}` writes that of the tests that are done, "
                f"and gusset.campaign({str(self.folder)!r}) also computes the missing ones"
            )
        path = self.folder / ("table.csv" if self.complete else "table.partial.csv")
        need_file(path)
        try:
            with path.open(encoding="utf-8", newline="") as file:
                names, *rows = csv.reader(file)
        except FileNotFoundError:
            raise FolderError(f"{path} is missing: `gusset campaign collect {self.folder}` writes it again") from None
        except ValueError:
            raise FolderError(f"{path} is empty: `gusset campaign collect {self.folder}` writes it again") from None
        if any(len(row) != len(names) for row in rows):
            raise FolderError(f"{path} has rows with missing cells: `gusset campaign collect {self.folder}` writes it again")
        texts = {column["name"] for column in self.summary.get("columns", []) if column.get("type") == "text"}
        series = []
        for place, name in enumerate(names):
            cells = [row[place] for row in rows]
            # A text that a spreadsheet could run begins with an apostrophe that does not belong to it.
            series.append(values(name, [cell.removeprefix("'") for cell in cells] if name in texts else cells))
        table = np.empty(len(rows), [(name, one.dtype) for name, one in zip(names, series)])
        for name, one in zip(names, series):
            table[name] = one
        return table

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """One column of the table, shape (tasks,): a view into `table`."""
        if name not in (self.table.dtype.names or ()):
            near = difflib.get_close_matches(str(name), self.columns, 3)
            help = f"; did you mean {', '.join(near)}?" if near else f"; it has {', '.join(self.columns)}"
            raise KeyError(f"{self.folder} has no column {name!r}{help}")
        column: npt.NDArray[Any] = self.table[name]
        return column

    @functools.cached_property
    def fragility(self) -> Fragility | None:
        """The fragility curve. None without levels of intensity, without `collapse` in [measure], if the counts do not determine a
        curve, and if the study varies other keys: a curve belongs to one structure, and `fragilities` has one for each."""
        points = (self.summary.get("fragility") or {}).get("points", [])
        return next(iter(self.fragilities.values()), None) if len(points) == 1 else None

    @functools.cached_property
    def fragilities(self) -> dict[str, Fragility]:
        """Fragility curves by the values of the other keys, as in `specimen.0.storey = 2`; the key is "" if no other key varies.
        Points whose counts do not determine a curve are left out; `summary["fragility"]["points"]` has the counts of all."""
        found = self.summary.get("fragility") or {}
        curves = {}
        for one in found.get("points", []):
            fit = one["fit"]
            if fit is None:
                continue
            levels = np.array([[level["level"], level["tests"], level["collapses"]] for level in one["levels"]], dtype=np.float64)
            curves[one["point"]] = Fragility(
                median=fit["median"],
                dispersion=fit["dispersion"],
                ln_median_error=fit["ln_median_error"],
                dispersion_error=fit["dispersion_error"],
                intensity=found["intensity"],
                unit=found["unit"],
                levels=levels[:, 0],
                tests=levels[:, 1],
                collapses=levels[:, 2],
            )
        return curves

    def to_pandas(self) -> pandas.DataFrame:
        """Copies the table into a DataFrame with one row for each test. Needs pandas.

        `attrs["units"]` has the unit of each column by name, see `TableColumn.unit`.

        Raises:
            FolderError: There is no table yet.
            ImportError: pandas is not installed.
        """
        package = need("pandas")
        frame: pandas.DataFrame = package.DataFrame({name: self.table[name] for name in self.table.dtype.names or ()}, copy=True)
        frame.attrs["units"] = {name: self.columns[name].unit for name in frame}
        return frame


def values(name: str, cells: list[str]) -> npt.NDArray[Any]:
    """The cells of one column: numbers, or texts if a cell is no number."""
    if name in TEXTS:
        return np.array(cells, dtype=np.str_)
    if name in COUNTS:
        return np.array(cells, dtype=np.int64)
    try:
        return np.array([float(cell) if cell else math.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return np.array(cells, dtype=np.str_)


def need_file(path: Path) -> None:
    """Refuses what is no plain file: a pipe could block for ever."""
    if path.exists() and not path.is_file():
        raise FolderError(f"{path} is no plain file")


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file."""
    need_file(path)
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as reason:
        raise FolderError(f"{path}: {reason}") from None
    return document


def open_campaign(folder: str | os.PathLike[str]) -> Campaign:
    """Opens a campaign folder. Nothing is computed; `gusset.campaign(folder)` continues an incomplete campaign.

    Raises:
        FolderError: The folder is no campaign folder.
    """
    return Campaign(folder)


def campaign(
    study: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
    prove: int | str | None = None,
    quiet: bool = False,
) -> Campaign:
    """Computes all simulated tests of a study on the cores of this machine, and returns the campaign with its table.

    The program `gusset` computes in its own process. Ctrl-C stops it after the current tests; the same call continues there. A
    complete campaign is not computed again.

    Args:
        study: A study file, see `gusset guide campaigns`; or a campaign folder, to continue it.
        out: For a study file: the campaign folder. Default: campaigns/<name of the study file>.
        jobs: Number of tests at the same time; the number of processors by default.
        prove: Tasks that are computed again to prove the results: a number, or a share such as "1%"; 20 by default.
        quiet: Does not repeat progress and messages of the program on stderr. An error is in the exception alone.

    Raises:
        CampaignError: The exit code was not 0. It has `code`, `reason` and `campaign`.
        Interrupted: Ctrl-C, a KeyboardInterrupt with the `campaign`.
        UsageError, FolderError: The call cannot work. Nothing was started.
        MissingBinary: The program `gusset` is not installed.
    """
    program, path = binary(), Path(study)
    folder = campaign_folder(path, out)
    had_plan = (folder / "plan.json").exists()
    arguments = [program, "campaign", "run"]
    arguments += [str(folder)] if had_plan else [str(path), "--out", str(folder)]
    if jobs is not None:
        arguments += ["--jobs", str(jobs)]
    if prove is not None:
        arguments += ["--prove", str(prove)]
    done = execute(arguments, quiet=quiet, progress=True)
    result = Campaign(folder) if (folder / "plan.json").exists() else None
    if done.is_interrupted:
        raise Interrupted(done.code, None, result)
    if done.code != 0 or result is None:
        raise CampaignError(done.code, done.error, result, done.messages)
    return result


def campaign_folder(study: Path, out: str | os.PathLike[str] | None) -> Path:
    """The campaign folder of a study file, or the campaign folder itself. Its campaign, if any, belongs to this study."""
    if study.is_dir():
        if out is not None:
            raise UsageError(f"out is for a study file, and {study} is a folder")
        return Campaign(study).folder
    if not study.exists():
        raise UsageError(f"{study}: no such study file or campaign folder")
    folder = Path(out) if out is not None else Path("campaigns") / study.stem
    if (folder / "plan.json").exists():
        planned = Campaign(folder).plan.get("study")
        if planned != str(study.resolve()):
            raise UsageError(f"{folder} has the campaign of another study, {planned}: choose another folder with out=")
    return folder
