"""The picture of a run."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ._folder import Run, need

if TYPE_CHECKING:
    import matplotlib.figure

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
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
    """Draws a run on a figure from `new`."""
    time = run.time
    histories: list[tuple[str, str, list[tuple[str, Any]]]] = []
    if len(time) and np.any(run.ground):
        histories.append(("ground acceleration", "m/s²", [("", run.ground)]))
    shown = run.dofs if len(run.dofs) <= MOST_DOFS else [*run.dofs[: MOST_DOFS - 1], run.dofs[-1]]
    if shown:
        histories.append(("displacement", "m", [(f"DOF {dof}", run["disp", dof]) for dof in shown]))
    loops = []
    for name in run.specimens:
        specimen = run.specimen(name)
        for axis in range(specimen.axes):
            ending = f"{specimen.number}_{axis + 1}"
            loops.append((f"{name}, axis {axis + 1}" if specimen.axes > 1 else name, run[f"meas_{ending}"], run[f"force_{ending}"]))
    if not histories and loops:
        histories.append(("displacement", "m", [(name, disp) for name, disp, _ in loops]))
    rows = len(histories)
    count = max(1, len(loops))
    figure = new(figsize=(9, 2.4 * rows + 3.4), layout="constrained")
    grid = figure.add_gridspec(rows + 1, count, height_ratios=[1.0] * rows + [1.5])
    first = None
    for row, (label, unit, curves) in enumerate(histories):
        axes = first = figure.add_subplot(grid[row, :], sharex=first)
        scale, prefix = scale_of([values for _, values in curves]) if unit == "m" else (1.0, "")
        for name, values in curves:
            axes.plot(time, values / scale, linewidth=0.9, label=name)
        axes.set(ylabel=f"{label}\n({prefix}{unit})", xlabel="time (s)" if row == rows - 1 else None)
        axes.grid(alpha=0.3)
        if len(curves) > 1:
            axes.legend(loc="upper right", fontsize="small", ncols=len(curves))
    for place, (name, disp, force) in enumerate(loops):
        axes = figure.add_subplot(grid[rows, place])
        (x_scale, x_prefix), (y_scale, y_prefix) = scale_of([disp]), scale_of([force])
        axes.plot(disp / x_scale, force / y_scale, linewidth=0.9)
        axes.set(title=name, xlabel=f"measured displacement ({x_prefix}m)", ylabel=f"force ({y_prefix}N)")
        axes.grid(alpha=0.3)
    figure.suptitle(str(run.config.get("title", run.folder.name)))
    return figure


def scale_of(series: list[Any]) -> tuple[float, str]:
    """The scale and its SI prefix that suit these values."""
    largest = max((float(np.max(np.abs(values))) for values in series if len(values)), default=0.0)
    return next(((scale, prefix) for scale, prefix in PREFIXES if largest >= scale), (1.0, ""))
