#!/usr/bin/env python3
"""Opens the exports of a run as a user would, and compares them with the log as tools/read_samples.py reads it.

    judge.py TOOLS RUN_DIR EXPORTS step|tick FORMAT...      EXPORTS/run.<format>; says "judged" and how many columns and rows
"""
import json
import os
import sys
import zipfile

import numpy

tools, run_dir, exports, rate, *formats = sys.argv[1:]
sys.path.insert(0, tools)
import read_samples  # noqa: E402

log = read_samples.read(run_dir)
layout = json.load(open(os.path.join(run_dir, "samples.json"), encoding="utf-8"))
summary = os.path.join(run_dir, "summary.json")
summary = open(summary, encoding="utf-8").read() if os.path.exists(summary) else ""
described = {c["name"]: (c["unit"], c["meaning"]) for c in layout["columns"]}

# The rows, picked in another way than the exporter does: of each step from t = 0 the last tick in which it runs.
# Rows in which the loop only runs warm (state 10) are in no export.
rows = numpy.flatnonzero(numpy.asarray(log["state"]) != 10)
if rate == "step" and len(rows):
    running = rows[(numpy.asarray(log["time"]) >= 0) & (numpy.asarray(log["state"]) == 3)]
    steps = numpy.asarray(log["step"])[running]
    rows = running[numpy.append(steps[1:] != steps[:-1], True)] if len(running) else running
wanted = {name: numpy.asarray(values, dtype="u8" if name == "sequence" else "f8")[rows] for name, values in log.items()}
# Columns of a CSV that the log does not have.
dofs = sorted({int(n[1:]) for n in wanted if n[0] in "xva" and n[1:].isdigit() and n[1] != "0"})
absent = [f"{letter}{dof}" for letter in "xva" for dof in dofs if f"{letter}{dof}" not in wanted]
wanted.update({name: numpy.full(len(rows), numpy.nan) for name in absent})


def same(form, found, units, meanings, rename=lambda name: name):
    names = [name for name in wanted]
    assert len(found) == len(names), (form, set(found) ^ set(map(rename, names)))
    for name in names:
        values = numpy.asarray(found[rename(name)])
        assert values.dtype == ("i8" if name == "sequence" else "f8"), (form, name, values.dtype)
        assert values.shape == (len(rows),), (form, name, values.shape)
        if name in absent:
            assert numpy.isnan(values).all(), (form, name)
            continue
        assert values.tobytes() == wanted[name].tobytes(), (form, name)
        if name in described:
            told = (units[rename(name)], meanings[rename(name)])
            assert told == described[name], (form, name, told)


def csv(path):
    header = open(path, encoding="ascii").readline().strip().split(",")
    table = numpy.genfromtxt(path, delimiter=",", skip_header=1).reshape(-1, len(header))
    assert table.shape[0] == len(rows)
    for column, name in enumerate(header):
        assert numpy.array_equal(table[:, column], wanted[name], equal_nan=True), name


def npz(path):
    assert zipfile.ZipFile(path).testzip() is None
    with numpy.load(path) as d:
        names = list(d["columns"])
        def of(key):
            return dict(zip(names, map(str, d[key])))
        assert str(d["summary"]) == summary
        own = ("columns", "units", "meanings", "summary")
        found = {name: d[name] for name in d.files if name not in own}
        assert list(found) == names
        same("npz", found, of("units"), of("meanings"), lambda n: n + "_" if n in own else n)


def mat(path):
    import h5py

    assert open(path, "rb").read(19) == b"MATLAB 7.3 MAT-file"
    with h5py.File(path) as h:
        # What MATLAB makes of it: dimensions the other way round, characters as UTF-16, nothing as its dimensions.
        def value(data):
            kind = data.attrs["MATLAB_class"].decode()
            empty = "MATLAB_empty" in data.attrs
            if kind == "char":
                return "" if empty else data[()].astype("<u2").tobytes().decode("utf-16-le")
            made = numpy.zeros(data[()], {"double": "f8", "int64": "i8"}[kind]) if empty else data[()].T
            assert empty or (kind, data.dtype.str) in (("double", "<f8"), ("int64", "<i8")), (data.name, kind)
            assert empty or data.chunks is None
            assert made.shape == (len(rows), 1), (data.name, made.shape)
            return made[:, 0]

        own = ("units", "meanings", "summary")
        def of(key):
            return {n: value(data) for n, data in h[key].items()}
        assert value(h["summary"]) == summary
        found = {n: value(data) for n, data in h.items() if n not in own}
        def fit(n):
            return n + "_" if n in own else n if n[0].isalpha() else "x" + n
        same("mat", found, of("units"), of("meanings"), fit)


def hdf5(path):
    import h5py

    with h5py.File(path) as h:
        timing = {c["name"] for c in layout["columns"] if c["timing"]}
        assert set(h) == {"samples", "timing"} and set(h["timing"]) == timing
        assert h.attrs["format"] == "gusset-run" and h.attrs.get("summary", "") == summary
        assert h.attrs.get("test", "") == (open(run_dir + "/test.toml").read() if os.path.exists(run_dir + "/test.toml") else "")
        found = {name: data for group in h.values() for name, data in group.items()}
        def of(key):
            return {name: data.attrs[key] for name, data in found.items()}
        assert all(data.chunks is None for data in found.values())
        same("hdf5", {name: data[()] for name, data in found.items()}, of("unit"), of("meaning"))


for form in formats:
    globals()[form](os.path.join(exports, "run." + form))
print("judged", len(formats), "formats,", len(wanted), "columns,", len(rows), "rows")
