"""Runs a script of OpenSees and records its commands: `python child.py SCRIPT RECORD`, in a process of its own.

Commands are passed to the real `openseespy`, so that a script that asks for values gets them. Those that write files are recorded
only. At the first transient `analyze` the record is written and the process ends at once, whatever the script may catch.

With `python child.py --again RECORD ANSWER` it makes the recorded model again. It answers with its frequencies without loads, and
with its displacements under the constant loads.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import json
import os
import re
import sys
import traceback
import types
from pathlib import Path
from typing import Any

# They write files or pictures.
OUTPUT = {
    "recorder",
    "record",
    "printModel",
    "printA",
    "printB",
    "printGID",
    "print",
    "logFile",
    "database",
    "save",
    "setPrecision",
    "display",
}
# They build the model, and are made again for the comparison.
BUILDS = {
    "model", "node", "fix", "fixX", "fixY", "fixZ", "mass", "equalDOF", "rigidLink", "rigidDiaphragm", "uniaxialMaterial",
    "section", "fiber", "patch", "layer", "geomTransf", "beamIntegration", "element",
}  # fmt: skip
# Commands of pictures in Tcl, which `openseespy` does not have.
DRAWING = ("prp", "vrp", "vup", "vpn", "viewWindow", "plane", "port", "projection", "fill", "window", "logCommands")
# Tags of series and integrations that stand inside of another command.
AUTOMATIC = 900_000
# The first of those of series for constant loads.
CONSTANT = 950_000
MODES = 6
# Degrees of freedom of a small model.
SMALL = 300
# Exit code without `openseespy`.
NOT_INSTALLED = 3


def real() -> Any:
    """OpenSeesPy. Its wheel carries the libraries that it needs: they are loaded first."""
    spec = importlib.util.find_spec("openseespylinux")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        for name in ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3", "libgomp.so.1"):
            library = Path(folder, "lib", name)
            if library.exists():
                try:
                    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
                except OSError:
                    pass  # the system has its own
    try:
        ops = importlib.import_module("openseespy.opensees")
    except ModuleNotFoundError as missing:
        if (missing.name or "").startswith("openseespy"):
            sys.exit(NOT_INSTALLED)
        raise
    return ops


class Recorder:
    """The commands since the last `wipe`."""

    def __init__(self, ops: Any, script: Path, record: Path) -> None:
        self.ops, self.script, self.target = ops, script, record
        self.commands: list[dict[str, Any]] = []
        self.analysis = ""
        self.patterns: list[Any] = []
        # The first error of a command in Tcl.
        self.failure = ""
        # Where Tcl found an error.
        self.tcl_error = ""
        self.own = {Path(__file__).resolve()}

    def place(self) -> tuple[str, int]:
        """File and line of the script that gives a command."""
        frame = sys._getframe(1)
        while frame is not None:
            path = Path(frame.f_code.co_filename)
            if path.exists() and path.resolve() not in self.own:
                return os.path.relpath(path, self.script.parent), frame.f_lineno
            frame = frame.f_back  # type: ignore[assignment]
        return self.script.name, 0

    def call(self, name: str, arguments: tuple[Any, ...], place: tuple[str, int] | None = None) -> Any:
        """Records a command and passes it on."""
        args = plain(arguments)
        note = {"name": name, "args": args, "place": place or self.place()}
        if name == "wipe":
            self.commands, self.analysis, self.patterns = [], "", []
        elif name == "analysis":
            self.analysis = str(args[0])
        elif name == "wipeAnalysis":
            self.analysis = ""
        elif name == "pattern":
            self.patterns.append(args[1])
        elif name == "loadConst":
            note["factors"] = self.factors()
        elif name == "timeSeries" and "-filePath" in args:
            note["file"] = content(args[args.index("-filePath") + 1])
        elif name == "analyze" and self.analysis != "Static":
            self.commands.append(note)
            self.end(None)
        if name in OUTPUT:
            self.commands.append(note)
            return 0
        try:
            value = getattr(self.ops, name)(*arguments)
        except Exception as reason:
            words = " ".join(map(str, [name, *args[:3]]))
            raise RuntimeError(f"OpenSees does not accept `{words}`; its message stands above") from reason
        # A command that fails leaves nothing, and the script may go on.
        self.commands.append(note)
        if name == "analyze":
            note.update(result=value, factors=self.factors())
        return value

    def factors(self) -> list[tuple[Any, float]]:
        """Load factor of each pattern now."""
        return [(tag, self.ops.getLoadFactor(tag)) for tag in self.patterns]

    def end(self, error: str | None) -> None:
        """Writes the record and ends the process."""
        told: dict[str, Any] = {"commands": self.commands, "error": error, "factors": [], "time": 0.0}
        if not error:
            told.update(factors=self.factors(), time=self.ops.getTime())
        self.target.write_text(json.dumps(told))
        sys.stdout.flush()
        os._exit(0)


def content(path: Any) -> dict[str, Any]:
    """The numbers that a file has now, or what is wrong with it."""
    try:
        words = Path(str(path)).read_text().split()
        return {"values": [float(word) for word in words]}
    except (OSError, ValueError) as reason:
        return {"wrong": f"{path}: {reason}"}


def plain(value: Any) -> Any:
    """Numbers of NumPy and tuples as those of JSON."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return value if isinstance(value, (bool, int, float, str)) or value is None else repr(value)


class Drawing(types.ModuleType):
    """A module for pictures that is not installed: each of its functions does nothing."""

    __path__ = []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Nothing()


class Nothing:
    """Can be called, read and iterated over."""

    def __call__(self, *_: Any, **__: Any) -> Nothing:
        return self

    def __getattr__(self, name: str) -> Nothing:
        if name.startswith("__"):
            raise AttributeError(name)
        return self

    def __getitem__(self, _: Any) -> Nothing:
        return self

    def __iter__(self) -> Any:
        return iter([self, self])

    def __setitem__(self, _: Any, __: Any) -> None:
        pass


class Drawings:
    """Finds modules for pictures that are not installed."""

    NAMES = ("matplotlib", "opsvis", "vfo", "openseespy.postprocessing", "openseespy.preprocessing")

    def find_spec(self, name: str, *_: Any) -> Any:
        if any(name == known or name.startswith(known + ".") for known in self.NAMES):
            return importlib.util.spec_from_loader(name, self)  # type: ignore[arg-type]
        return None

    def create_module(self, spec: Any) -> Any:
        return Drawing(spec.name)

    def exec_module(self, _: Any) -> None:
        pass


def run_python(recorder: Recorder, script: Path) -> None:
    """Runs a script in Python with a module in place of `openseespy.opensees`."""
    recording = types.ModuleType("openseespy.opensees")
    for name in dir(recorder.ops):
        if not name.startswith("_"):
            known = getattr(recorder.ops, name)
            setattr(recording, name, command(recorder, name) if callable(known) else known)
    package = sys.modules["openseespy"]
    package.__dict__["opensees"] = recording
    sys.modules["openseespy.opensees"] = sys.modules["opensees"] = recording
    sys.meta_path.append(Drawings())
    sys.argv, sys.path = [str(script)], [str(script.parent), *sys.path]
    names = {"__name__": "__main__", "__file__": str(script), "__builtins__": __builtins__}
    exec(compile(script.read_bytes(), str(script), "exec"), names)


def command(recorder: Recorder, name: str) -> Any:
    def recorded(*arguments: Any) -> Any:
        return recorder.call(name, arguments)

    return recorded


class Tcl:
    """Runs a script in Tcl whose commands are those of OpenSees."""

    def __init__(self, recorder: Recorder, script: Path) -> None:
        try:
            import tkinter
        except ImportError:
            recorder.end("a script in Tcl needs Python's module tkinter. Install it, in Debian: apt install python3-tk")
            raise
        self.recorder, self.script = recorder, script
        self.tcl = tkinter.Tcl()
        self.tags = AUTOMATIC
        names = [name for name in dir(recorder.ops) if not name.startswith("_") and callable(getattr(recorder.ops, name))]
        for name in [*names, "print", "display"]:
            self.tcl.createcommand(name, self.command(name))
        self.tcl.eval("interp alias {} pset {} set")
        for name in DRAWING:
            self.tcl.createcommand(name, lambda *_: "")
        for name in ("exit", "quit"):
            self.tcl.createcommand(name, lambda *_: recorder.end(f"{script.name}: the script ended before a transient `analyze`"))

    def run(self) -> None:
        try:
            self.tcl.eval(f"source {{{self.script}}}")
        except Exception:
            self.recorder.tcl_error = str(self.tcl.eval("set errorInfo"))
            raise

    def command(self, name: str) -> Any:
        def called(*words: str) -> Any:
            try:
                own = getattr(self, f"do_{name}", None)
                value = own(*words) if own else self.give(name, *map(number, words))
            except Exception as reason:
                self.recorder.failure = self.recorder.failure or f"{':'.join(map(str, self.place()))}: {reason}"
                raise
            if isinstance(value, (list, tuple)):
                return " ".join(repr(entry) for entry in value)
            return "" if value is None else value

        return called

    def give(self, name: str, *arguments: Any) -> Any:
        return self.recorder.call(name, arguments, self.place())

    def place(self) -> tuple[str, int]:
        for level in range(int(self.tcl.eval("info frame")) - 1, -1, -1):
            told = self.tcl.eval(f"info frame {level}") if level else ""
            found = re.search(r"line (\d+) file (\{[^}]*\}|\S+)", told)
            if found:
                path = found[2].strip("{}")
                return os.path.relpath(path, self.script.parent), int(found[1])
        return self.script.name, 0

    def words(self, text: str) -> list[Any]:
        return [number(word) for word in self.tcl.splitlist(text)]

    def new_tag(self) -> int:
        self.tags += 1
        return self.tags

    def do_model(self, kind: str, *rest: str) -> Any:
        return self.give("model", "basic" if kind.lower().startswith("basic") else kind, *map(number, rest))

    def do_timeSeries(self, *words: str) -> Any:
        return self.give("timeSeries", *self.series(list(words)))

    def series(self, words: list[str]) -> list[Any]:
        """A time series whose lists are flat."""
        flat: list[Any] = []
        for word in words:
            flat += self.words(word) if flat and flat[-1] in ("-values", "-time") else [number(word)]
        return flat

    def series_of(self, text: str) -> int:
        """Tag of a series: given as a number, or by the words of a series."""
        words = list(self.tcl.splitlist(text))
        if len(words) == 1 and isinstance(number(words[0]), int):
            return int(words[0])
        tag = self.new_tag()
        kind = {"Series": "Path"}.get(words[0], words[0])
        self.give("timeSeries", kind, tag, *self.series(words[1:]))
        return tag

    def do_pattern(self, kind: str, tag: str, *words: str) -> Any:
        if kind == "Plain":
            self.give("pattern", kind, number(tag), self.series_of(words[0]), *map(number, words[1:-1]))
            return self.tcl.eval(words[-1])
        given = list(words)
        if "-accel" in given:
            place = given.index("-accel") + 1
            given[place] = str(self.series_of(given[place]))
        return self.give("pattern", kind, number(tag), *map(number, given))

    def do_section(self, kind: str, *words: str) -> Any:
        if kind in ("Fiber", "fiberSec"):
            self.give("section", "Fiber", *map(number, words[:-1]))
            return self.tcl.eval(words[-1])
        return self.give("section", kind, *map(number, words))

    def do_element(self, kind: str, tag: str, *words: str) -> Any:
        """Beam elements with sections of the old form: nodes, points, section, transformation."""
        given = [number(word) for word in words]
        at = next((i for i, word in enumerate(given) if isinstance(word, str)), len(given))
        old = {"nonlinearBeamColumn": "Lobatto", "forceBeamColumn": "Lobatto", "dispBeamColumn": "Legendre"}
        if kind in old and at == 5:
            first, last, points, section, turned = given[:5]
            rest = given[5:]
            rule = old[kind]
            if "-integration" in rest:
                place = rest.index("-integration")
                rule = rest[place + 1]
                del rest[place : place + 2]
            integration = self.new_tag()
            self.give("beamIntegration", rule, integration, section, points)
            name = "forceBeamColumn" if kind == "nonlinearBeamColumn" else kind
            return self.give("element", name, number(tag), first, last, turned, integration, *rest)
        if kind in old and at == 3 and len(given) > 3:
            rule, *more = self.words(str(given[3]))
            rest = given[4:]
            if not more:
                more, rest = rest[:2], rest[2:]
            integration = self.new_tag()
            self.give("beamIntegration", rule, integration, *more)
            return self.give("element", kind, number(tag), *given[:3], integration, *rest)
        return self.give("element", kind, number(tag), *given)


def number(word: Any) -> Any:
    """A word of Tcl as a number, if it is one."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word


def frequencies(ops: Any, masses: int, dofs: int) -> list[float]:
    """The lowest ones, at most six. The solver for large models finds fewer than there are masses."""
    ops.constraints("Transformation")
    small = dofs <= SMALL
    count = min(MODES, masses if small else masses - 1)
    found = ops.eigen("-fullGenLapack" if small else "-genBandArpack", count)
    return [value**0.5 for value in found or [] if value > 0]


def rebuild(record: dict[str, Any], ops: Any, constant: dict[Any, float]) -> None:
    """Makes the recorded model, with these patterns of loads and their factors at the time 1, and without damping."""
    ops.wipe()
    wanted = False
    for one in record["commands"]:
        name, args = one["name"], one["args"]
        if name == "pattern":
            wanted = args[1] in constant
            if wanted:
                tag = CONSTANT + args[1]
                ops.timeSeries("Linear", tag, "-factor", constant[args[1]])
                ops.pattern("Plain", args[1], tag)
        elif name in BUILDS or (wanted and name in ("load", "eleLoad")):
            getattr(ops, name)(*args)


def load(ops: Any, tolerance: float) -> bool:
    """Applies the loads of a rebuilt model in ten steps. False without equilibrium."""
    settle(ops, tolerance)
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    return bool(ops.analyze(10) == 0)


def settle(ops: Any, tolerance: float) -> None:
    """The solver of a step."""
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", tolerance, 200)
    ops.algorithm("Newton")


def again(record: dict[str, Any], ops: Any) -> dict[str, Any]:
    """Makes the model of a record twice: without loads for its frequencies, with the constant loads for its displacements."""
    rebuild(record, ops, {})
    told: dict[str, Any] = {"moved": {}, "forces": {}}
    told["stiffness"] = {str(tag): ops.basicStiffness(tag) for tag in record["replaced"]}
    told["frequencies"] = frequencies(ops, record["masses"], record["dofs"])
    if record["constant"]:
        rebuild(record, ops, dict(record["constant"]))
        if not load(ops, 1e-10):
            return {"error": "OpenSees finds no equilibrium under the constant loads, solved to 1e-10"}
        told["moved"] = {str(tag): ops.nodeDisp(tag) for tag in ops.getNodeTags()}
        told["forces"] = {str(tag): ops.basicForce(tag) for tag in record["replaced"]}
    return told


def main() -> None:
    if sys.argv[1] == "--again":
        answer = again(json.loads(Path(sys.argv[2]).read_text()), real())
        Path(sys.argv[3]).write_text(json.dumps(answer))
        sys.stdout.flush()
        os._exit(0)
    script, record = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    recorder = Recorder(real(), script, record)
    try:
        if script.suffix.lower() == ".tcl":
            Tcl(recorder, script).run()
        else:
            run_python(recorder, script)
    except BaseException as reason:
        name, line = raised(reason, recorder)
        if isinstance(reason, SystemExit):
            recorder.end(f"{script.name}: the script ended before a transient `analyze`")
        text = str(reason) or type(reason).__name__
        recorder.end(recorder.failure or (f"{name}:{line}: {text}" if line else f"{name}: {text}"))
    recorder.end(f"{script.name}: the script ended before a transient `analyze`: nothing says where the test begins")


def raised(reason: BaseException, recorder: Recorder) -> tuple[str, int]:
    """The last line of the script in the traceback."""
    told = re.findall(r'\(file "([^"]*)" line (\d+)\)', recorder.tcl_error)
    if told:
        return os.path.relpath(told[0][0], recorder.script.parent), int(told[0][1])
    for entry in reversed(traceback.extract_tb(reason.__traceback__)):
        if Path(entry.filename).exists() and Path(entry.filename).resolve() not in recorder.own and "tkinter" not in entry.filename:
            return os.path.relpath(entry.filename, recorder.script.parent), entry.lineno or 0
    return recorder.script.name, 0


if __name__ == "__main__":
    main()
