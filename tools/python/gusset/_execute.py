"""`gusset run` from Python, with specimens in Python."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from . import _toml
from ._binary import binary
from ._errors import Interrupted, RunError, UsageError
from ._folder import FolderError, Run
from ._process import Outcome, execute
from .specimen import Server, Specimen

UNLIMITED = "Python specimen"
Clock = Literal["real", "simulated"]


def run(
    test: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    clock: Clock | None = None,
    out: str | os.PathLike[str] | None = None,
    specimens: Mapping[str, Specimen] | None = None,
    confirm: bool = False,
    quiet: bool = False,
) -> Run:
    """Runs one hybrid test and returns its run folder.

    The program `gusset` runs the test in its own process. Ctrl-C stops the test in an orderly way; its run folder is complete.

    Args:
        test: The test file.
        set: Overrides by their dotted path, for example {"integrator.lambda": 4, "specimen.0.storey": 2}. The first specimen of the
            file is 0. Values are in SI units.
        clock: "real" or "simulated", instead of the clock in the test file.
        out: The run folder, a new or an empty one. Default: runs/<title>-<start time in UTC>.
        specimens: Specimens in Python by their name in the test file. They replace the law or the link of these specimens. On the
            simulated clock the test waits for them. With the real clock they must keep the deadline like any other specimen,
            and the test file must have limits for them.
        confirm: Confirms the sensor readings before anything moves, without showing them. A test that asks for a confirmation
            (`confirm` in [safety], or a relative zero) is refused otherwise. Look at the readings first: `gusset run` shows them.
        quiet: Does not repeat the warnings of `gusset run` on stderr. An error is in the exception alone.

    Returns:
        The run folder of a completed test. Everything else raises an exception.

    Raises:
        RunError: The exit code was not 0. It has `code`, `reason` and `run`. An exception of a specimen is its cause.
        Interrupted: Ctrl-C, a KeyboardInterrupt with the complete `run`.
        UsageError: The call cannot work. Nothing was started.
        MissingBinary: The program `gusset` is not installed.
    """
    program, path = binary(), Path(test)
    if clock not in (None, *get_args(Clock)):
        raise UsageError(f'clock {clock!r}: write "real" or "simulated"')
    config = _toml.read(path)
    chosen = dict(set or {})
    with contextlib.ExitStack() as stack:
        servers = {}
        places = places_of(config, specimens or {}, path)
        for name, specimen in (specimens or {}).items():
            servers[name] = stack.enter_context(server_of(name, specimen))
        keys = link_keys(config, chosen, {name: (places[name], server) for name, server in servers.items()}, clock, path)
        overrides = _toml.overrides(chosen) + _toml.overrides(keys)
        folder = run_folder(out, chosen.get("title", config.get("title")))
        arguments = [program, "run", str(path), "--quiet", "--out", str(folder), *overrides]
        if clock is not None:
            arguments += ["--clock", clock]
        if confirm:
            arguments.append("--yes")
        is_taken = (folder / "samples.json").exists()  # then the program refuses
        done = execute(arguments, quiet=quiet)
        result = None if is_taken else opened(folder)
        for name, server in servers.items():
            if server.error is not None and result is not None:
                write_traceback(result.folder, name, server.error)
    if done.is_interrupted:
        raise Interrupted(done.code, result)
    if done.code != 0:
        raise error_of(done, result, servers)
    if result is None:
        raise RunError(done.code, f"{folder} has no samples", None, done.messages)
    return result


def server_of(name: str, specimen: Specimen) -> Server:
    """The server of one specimen, on a free port of the loopback."""
    if isinstance(specimen, type):
        raise UsageError(f"specimens[{name!r}] is the class {specimen.__name__}; give an object: {specimen.__name__}(...)")
    try:
        return Server(specimen, "127.0.0.1:0", name)
    except (TypeError, RuntimeError) as reason:
        raise UsageError(f"specimens[{name!r}]: {reason}") from reason


def places_of(config: dict[str, Any], specimens: Mapping[str, Specimen], path: Path) -> dict[str, int]:
    """Places of these specimens in the test file, from 0."""
    names = [table.get("name") for table in config.get("specimen", [])]
    for name in specimens:
        if name not in names:
            near = difflib.get_close_matches(str(name), [n for n in names if n], 1)
            help = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(map(repr, names)) or 'none'}"
            raise UsageError(f"{path} has no specimen {name!r}; {help}")
    return {name: names.index(name) for name in specimens}


def link_keys(
    config: dict[str, Any],
    chosen: Mapping[str, Any],
    served: Mapping[str, tuple[int, Server]],
    clock: str | None,
    path: Path,
) -> dict[str, Any]:
    """The overrides that connect the test to its specimens in Python."""
    keys: dict[str, Any] = {}
    tables = config.get("specimen", [])
    for name, (place, server) in served.items():
        at, table = f"specimen.{place}", tables[place]
        if is_set(chosen, f"{at}.link"):
            raise UsageError(f"set has keys of {at}.link, which gusset.run writes for the specimen {name!r} in Python")
        link = {key: entry for key, entry in table.get("link", {}).items() if key in KEPT_LINK_KEYS}
        keys[f"{at}.link"] = {**link, "address": server.address, "computed": True}
        if "stiffness_n_per_m" in table or is_set(chosen, f"{at}.stiffness_n_per_m"):
            continue
        matrix, n = server.served.stiffness, server.served.axes
        if not matrix:
            raise UsageError(
                f"{path}: specimen {name!r} has no initial stiffness. Set `stiffness_n_per_m` in the test file, "
                f"or the attribute `stiffness` of {type(server.served.given).__name__}, in N/m"
            )
        rows = [[matrix[j * n + i] for j in range(n)] for i in range(n)]
        keys[f"{at}.stiffness_n_per_m"] = rows[0][0] if n == 1 else rows
    is_simulated = (clock or chosen.get("time.clock") or config.get("time", {}).get("clock")) == "simulated"
    python = {place for place, _ in served.values()}
    without = {i for i in python if not has_limits(tables[i]) and not is_set(chosen, f"specimen.{i}.limits")}
    # Overrides of another specimen do not count: only the file shows that it has limits.
    others = {i for i, table in enumerate(tables) if i not in python and not has_limits(table)}
    others = {i for i in others if "link" in tables[i] or is_set(chosen, f"specimen.{i}.link")}
    has_reason = "unlimited" in config.get("safety", {}) or is_set(chosen, "safety.unlimited")
    # The key concerns all specimens of the test, so it is not written when another one behind a link has no limits.
    if is_simulated and without and not others and not has_reason:
        keys["safety.unlimited"] = UNLIMITED
    return keys


KEPT_LINK_KEYS = ("coupling", "connect_timeout_s", "reply_timeout_s", "on_stale", "max_stale", "watchdog_s", "commands")


def is_set(chosen: Mapping[str, Any], path: str) -> bool:
    """True if an override sets this key or one below it."""
    keys = (re.sub(r"\[(\d+)\]", r".\1", key) for key in chosen)
    return any(key == path or key.startswith(f"{path}.") for key in keys)


def has_limits(table: Mapping[str, Any]) -> bool:
    """True if the specimen has trip levels of displacement and force, for all axes or for each."""

    def both(limits: Mapping[str, Any]) -> bool:
        return all("trip" in (limits.get(key) or {}) for key in ("command_disp_m", "measured_force_n"))

    axes = table.get("axis", [])
    return both(table.get("limits", {})) or (bool(axes) and all(both(axis.get("limits", {})) for axis in axes))


def run_folder(out: str | os.PathLike[str] | None, title: Any) -> Path:
    """The folder of `out`, or a new one runs/<title>-<start time>."""
    if out is not None:
        return Path(out)
    words = re.sub(r"[^a-z0-9]+", "-", str(title or "test").lower()).strip("-")[:60] or "test"
    base = f"{words}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
    Path("runs").mkdir(exist_ok=True)
    number = 1
    while True:
        folder = Path("runs") / (base if number == 1 else f"{base}-{number}")
        try:
            folder.mkdir()
            return folder
        except FileExistsError:
            number += 1


def opened(folder: Path) -> Run | None:
    """The run, or None if the test ended before it had a run folder. An empty folder is removed."""
    with contextlib.suppress(OSError):
        folder.rmdir()
    try:
        return Run(folder)
    except FolderError:
        return None


def error_of(done: Outcome, result: Run | None, servers: Mapping[str, Server]) -> RunError:
    """The exception of a test that did not complete, with the exception of a specimen as its cause."""
    reason = (result.reason if result is not None else None) or done.error
    for name, server in servers.items():
        if server.error is not None:
            kind = type(server.error).__name__
            raised = f"the specimen {name!r} raised {kind}: {server.error}"
            # The specimen said this to the program, too, and the program repeats it in its reason.
            error = RunError(done.code, raised if kind in reason else f"{raised}\n{reason}", result, done.messages)
            error.__cause__ = server.error
            return error
    return RunError(done.code, reason, result, done.messages)


def write_traceback(folder: Path, name: str, error: BaseException) -> None:
    """Keeps the traceback of a specimen in the run folder."""
    text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    with contextlib.suppress(OSError):
        (folder / f"traceback-{plain}.txt").write_text(text, encoding="utf-8")
