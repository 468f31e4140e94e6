"""Types of `summary.json` and `timing.json`, with the names of the program's own types. Tests compare them with a run."""

from __future__ import annotations

from typing import Any, Literal, Optional, TypedDict

Status = Literal["completed", "stopped", "interrupted", "failed"]
Numbers = list[Optional[float]]


class Percentiles(TypedDict):
    """A timing histogram in seven numbers, in microseconds."""

    count: int
    min: float
    p50: float
    p90: float
    p99: float
    p99_9: float
    max: float


class TimingEntry(Percentiles, total=False):
    """One timing quantity; `bins` only in `timing.json`: both edges in microseconds and the count of each."""

    bins: list[list[float]]
    early: int
    swallowed: int
    specimens: dict[str, TimingEntry]


class Peak(TypedDict, total=False):
    """Largest magnitudes: a list with one number for each degree of freedom, or for each axis of a specimen."""

    rotations: list[int]
    displacement: Numbers
    velocity: Numbers
    acceleration: Numbers
    force: dict[str, Numbers]


class LinkCounts(TypedDict):
    """Traffic with one specimen."""

    sent: int
    received: int
    late: int
    lost: int
    corrupt: int
    duplicates: int
    recovered: int
    missed: int
    unreachable: int


# `lambda` is no name in Python.
Summary = TypedDict(
    "Summary",
    {
        "status": Status,
        "reason": str,
        "steps": int,
        "dt": float,
        "lambda": Any,
        "clock": str,
        "wall_seconds": float,
        "rate_hz": float,
        "deadline_misses": int,
        "stretched_ticks": int,
        "peak": Peak,
        "timing": Optional[dict[str, TimingEntry]],
        "realtime": dict[str, Any],
        "link": dict[str, LinkCounts],
        "version": str,
        "about": dict[str, Any],
        "origin": dict[str, Any],
        "rows_lost": int,
        "inputs": list[dict[str, Any]],
        "miss_classes": dict[str, int],
        "warnings": list[str],
        "limits": Optional[dict[str, Any]],
        "machine": Optional[dict[str, str]],
        "metrics": Optional[dict[str, list[Any]]],
        "metrics_missing": list[str],
        "falsified": Optional[dict[str, Any]],
        "left": dict[str, str],
        "force_on_the_way_in": dict[str, Numbers],
        "accepted": dict[str, str],
        "verdict": Optional[dict[str, Any]],
        "cause": str,
    },
    total=False,
)
