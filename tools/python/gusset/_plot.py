"""The picture of a run."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ._folder import Run, need

if TYPE_CHECKING:
    import matplotlib.figure

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
QUANTITIES = {"m": "displacement", "rad": "rotation", "m/s2": "acceleration", "N": "force", "N m": "moment"}
MOST_DOFS = 6


def plot(run: Run, file: str | os.PathLike[str] | None) -> matplotlib.figure.Figure:
    """See `Run.plot`."""
    pyplot = need("matplotlib.pyplot")
    figure = draw(run, pyplot.figure)
    if file is not None:
        figure.savefig(file, dpi=150)
    if "inline" in pyplot.get_backend():
        pyplot.close(figure)  # the notebook shows the figure that the cell returns; pyplot would show it once more
    return figure


def picture(run: Run) -> bytes:
    """The picture of `plot` as PNG. pyplot does not know its figure, so a notebook does not show it twice."""
    file = io.BytesIO()
    draw(run, need("matplotlib.figure").Figure).savefig(file, format="png", dpi=100)
    return file.getvalue()


def draw(run: Run, new: Callable[..., matplotlib.figure.Figure]) -> matplotlib.figure.Figure:
    """Draws a run on a figure from `new`. Curves of one unit share their axes."""
    grounds = [name for name in run.columns if name == "ground" or name.startswith("ground_")]
    histories = by_unit(run, "ground ", {name: name for name in grounds if np.any(run[name])})
    shown = run.dofs if len(run.dofs) <= MOST_DOFS else [*run.dofs[: MOST_DOFS - 1], run.dofs[-1]]
    histories += by_unit(run, "", {f"x{dof}": f"DOF {dof}" for dof in shown})
    loops = {}
    for name in run.specimens:
        specimen = run.specimen(name)
        for axis in range(specimen.axes):
            loops[f"{specimen.number}_{axis + 1}"] = f"{name}, axis {axis + 1}" if specimen.axes > 1 else name
    if not histories:
        histories = by_unit(run, "", {f"meas_{ending}": name for ending, name in loops.items()})
    rows = len(histories)
    count = max(1, len(loops))
    figure = new(figsize=(9, 2.4 * rows + 3.4), layout="constrained")
    grid = figure.add_gridspec(rows + 1, count, height_ratios=[1.0] * rows + [1.5])
    first = None
    for row, (label, curves) in enumerate(histories):
        axes = first = figure.add_subplot(grid[row, :], sharex=first)
        scale, unit = scale_of(run, list(curves))
        for column, name in curves.items():
            axes.plot(run.time, run[column] / scale, linewidth=0.9, label=name)
        axes.set(ylabel=f"{label}\n({unit})", xlabel="time (s)" if row == rows - 1 else None)
        axes.grid(alpha=0.3)
        if len(curves) > 1:
            axes.legend(loc="upper right", fontsize="small", ncols=len(curves))
    for place, (ending, name) in enumerate(loops.items()):
        axes = figure.add_subplot(grid[rows, place])
        x, y = f"meas_{ending}", f"force_{ending}"
        (x_scale, x_unit), (y_scale, y_unit) = scale_of(run, [x]), scale_of(run, [y])
        axes.plot(run[x] / x_scale, run[y] / y_scale, linewidth=0.9)
        axes.set(title=name, xlabel=f"measured {quantity(run, x)} ({x_unit})", ylabel=f"{quantity(run, y)} ({y_unit})")
        axes.grid(alpha=0.3)
    figure.suptitle(str(run.config.get("title", run.folder.name)))
    return figure


def quantity(run: Run, column: str) -> str:
    """The quantity in a column, by its unit."""
    unit = run.columns[column].unit
    return QUANTITIES.get(unit, unit)


def by_unit(run: Run, prefix: str, curves: dict[str, str]) -> list[tuple[str, dict[str, str]]]:
    """Curves by column, one group for each unit, with the label of its axes."""
    groups: dict[str, dict[str, str]] = {}
    for column, name in curves.items():
        groups.setdefault(prefix + quantity(run, column), {})[column] = name
    return list(groups.items())


def scale_of(run: Run, columns: list[str]) -> tuple[float, str]:
    """The scale that suits these columns of one unit, and the unit with its SI prefix."""
    unit = run.columns[columns[0]].unit
    shown = unit.replace("m/s2", "m/s²").replace("N m", "N·m")
    if "/" in unit:
        return 1.0, shown
    largest = max(float(np.fmax.reduce(np.abs(run[name]), initial=0.0)) for name in columns)
    scale, prefix = next(((scale, prefix) for scale, prefix in PREFIXES if largest >= scale), (1.0, ""))
    return scale, prefix + shown
