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


def bmp(text):
    """Without characters beyond U+FFFF, which a MATLAB file of level 5 cannot hold."""
    return "".join(letter if letter <= "\uffff" else "\ufffd" for letter in text)


def assert_metadata(found, written=lambda text: text):
    """Checks the pairs of key and value that every format with metadata has."""
    def of(name):
        return written(open(os.path.join(run_dir, name), encoding="utf-8").read())

    files = {"test": "test.toml", "resolved": "resolved.toml"}
    expected = {key: of(name) for key, name in files.items() if os.path.exists(os.path.join(run_dir, name))}
    found = {key: value for key, value in found.items() if key in ("format", "test", "resolved", "summary")}
    assert found == expected | {"format": "gusset-run", "summary": summary}, found.keys()


def matlab_name(own):
    return lambda n: n + "_" if n in own else n if n[0].isalpha() else "x" + n


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
    import scipy.io

    assert open(path, "rb").read(10) == b"MATLAB 5.0"
    d = scipy.io.loadmat(path)

    def text(data):
        return str(data[0]) if data.size else ""

    def fields(data):
        return {name: text(data[name][0, 0]) for name in data.dtype.names}

    assert text(d["summary"]) == bmp(summary)
    assert_metadata(fields(d["metadata"]) | {"summary": summary}, bmp)
    own = ("units", "meanings", "summary", "metadata")
    found = {n: values for n, values in d.items() if n not in own and not n.startswith("__")}
    assert all(values.shape == (len(rows), 1) for values in found.values())
    found = {n: values[:, 0] for n, values in found.items()}
    same("mat", found, fields(d["units"]), fields(d["meanings"]), matlab_name(own))


def mat73(path):
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

        own = ("units", "meanings", "summary", "metadata")
        def of(key):
            return {n: value(data) for n, data in h[key].items()}
        assert value(h["summary"]) == summary
        assert_metadata({key: value(data) for key, data in h["metadata"].items()} | {"summary": summary})
        found = {n: value(data) for n, data in h.items() if n not in own}
        same("mat73", found, of("units"), of("meanings"), matlab_name(own))


def hdf5(path):
    import h5py

    with h5py.File(path) as h:
        timing = {c["name"] for c in layout["columns"] if c["timing"]}
        assert set(h) == {"samples", "timing"} and set(h["timing"]) == timing
        assert_metadata({"summary": ""} | dict(h.attrs))
        found = {name: data for group in h.values() for name, data in group.items()}
        def of(key):
            return {name: data.attrs[key] for name, data in found.items()}
        assert all(data.chunks is None for data in found.values())
        same("hdf5", {name: data[()] for name, data in found.items()}, of("unit"), of("meaning"))


def parquet(path):
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path)
    pairs = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert_metadata({"summary": ""} | {key.removeprefix("gusset."): value for key, value in pairs.items()})
    columns = {c["name"]: c for c in json.loads(pairs["gusset.columns"])}
    assert list(columns) == table.column_names
    found = {name: table[name].to_numpy() for name in table.column_names}
    for name in absent:
        assert table[name].null_count == len(rows), name
        found[name] = numpy.full(len(rows), numpy.nan)

    def of(key):
        return {name: column[key] for name, column in columns.items()}

    same("parquet", found, of("unit"), of("meaning"))


def mcap(path):
    from mcap.reader import make_reader

    reader = make_reader(open(path, "rb"))
    about, = reader.iter_metadata()
    assert about.name == "gusset"
    assert_metadata({"summary": ""} | about.metadata)
    sent, told, units = {}, [], {}
    for schema, channel, message in reader.iter_messages():
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        data = json.loads(message.data)
        if channel.topic == "/events":
            told.append(data)
            continue
        fields = json.loads(schema.data)["properties"]
        assert set(data) <= set(fields)
        assert channel.metadata == {name: field["unit"] for name, field in fields.items()}
        units |= {name: (field["unit"], field["description"]) for name, field in fields.items()}
        sent.setdefault(channel.topic, []).append((message.log_time, message.sequence, data))
    lines = os.path.join(run_dir, "events.jsonl")
    lines = [json.loads(line) for line in open(lines, encoding="utf-8")] if os.path.exists(lines) else []
    assert len(told) <= len(lines) and (told or not lines)
    def instant(wall):
        return int(numpy.datetime64(wall.removesuffix("Z"), "ns").astype("i8"))

    start = instant(lines[0]["wall"] if lines else "1970-01-01T00:00:00.000000000Z")
    times = start + numpy.round(wanted["time"] * 1e9).astype("i8")
    grids = [line for line in lines if line["event"] == "grid"]
    if grids:  # all rows are of the test, so they count from the edge of the last grid
        start = instant(grids[0]["wall"]) - grids[0]["clock_ns"] + grids[-1]["first_edge_ns"]
        times = start + numpy.round(wanted["release_s"] * 1e9).astype("i8")
    found = {name: numpy.full(len(rows), numpy.nan) for name in wanted}
    found["sequence"] = numpy.zeros(len(rows), "i8")
    for topic, messages in sent.items():
        assert len(messages) == len(rows), topic
        for row, (at, number, data) in enumerate(messages):
            assert number == row and abs(at - times[row]) < 1000, topic
            for name, value in data.items():
                found[name][row] = value
    for name, values in found.items():
        if name in described and len(rows):
            assert units[name] == described[name], name
        # JSON has neither infinities nor NaN.
        expected = wanted[name] if name == "sequence" else numpy.where(numpy.isfinite(wanted[name]), wanted[name], numpy.nan)
        assert numpy.array_equal(values, expected, equal_nan=name != "sequence"), name


for form in formats:
    globals()[form](os.path.join(exports, "run." + form))
print("judged", len(formats), "formats,", len(wanted), "columns,", len(rows), "rows")
