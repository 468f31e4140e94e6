"""Run folders as NumPy arrays."""

import csv
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest

import gusset
from conftest import ROOT, skip
from gusset._files import LinkCounts, Peak, Percentiles, Summary, TimingEntry
from gusset._process import execute

MULTI_RATE = ROOT / "config" / "multi-rate.toml"


def test_arrays_are_read_once_and_cannot_be_written(first):
    for array in [first.time, first["disp", 2], first["disp"], first.specimen("column").force, first["force_1_1"], first.rows]:
        assert not array.flags.writeable
    assert np.shares_memory(first.time, first.all_rows.time)
    assert np.array_equal(first.rows["x2"], first["x2"])


def test_record_cut_under_an_open_run_is_an_error(first, place):
    """A file that becomes shorter raises an error; a mapped one would end the process."""
    shutil.copytree(first.folder, "cut")
    run = gusset.open("cut")
    time_before = run.time
    stride = json.loads((place / "cut" / "samples.json").read_text())["stride"]
    os.truncate("cut/samples.bin", 10 * stride)
    for read in [lambda: run["x1"], lambda: run["disp"], lambda: run.rows, lambda: run.all_rows.rows, run.to_pandas]:
        with pytest.raises(gusset.FolderError, match="shorter"):
            read()
    assert time_before[-1] == 2 and run.time[-1] == 2
    assert len(gusset.open("cut").all_rows) == 10


def test_sparse_record_ends_at_its_first_hole(first, place, monkeypatch):
    """30 GB of zeros behind the rows: one block of them is read, whatever is checked."""
    shutil.copytree(first.folder, "sparse")
    size = os.path.getsize("sparse/samples.bin")
    os.truncate("sparse/samples.bin", 30_000_000_000)
    read = []
    blocks = gusset.Run._blocks

    def counted(self, start, stop):
        for block in blocks(self, start, stop):
            read.append(block.nbytes)
            yield block

    monkeypatch.setattr(gusset.Run, "_blocks", counted)
    for verify in [False, True]:
        read.clear()
        run = gusset.open("sparse", verify=verify)
        assert len(run.all_rows) == len(first.all_rows) and sum(read) < size + 16_000_000
        assert np.array_equal(run["x1"], first["x1"])


def test_many_events_of_one_kind_are_counted(first, place):
    shutil.copytree(first.folder, "many")
    event = {"tick": 1, "time": 0.1, "event": "limit_warning", "specimen": 1, "axis": 1, "limit": "command_disp_m"}
    with open("many/events.jsonl", "a", encoding="utf-8") as file:
        file.writelines(json.dumps(event | {"value": number}) + "\n" for number in range(10_250))
        file.write('{"tick": 1, "event": "torn')
    run = gusset.open("many")
    assert len(run.events) == len(first.events) + 10_000
    assert run.events_left_out == {"limit_warning": 250} and first.events_left_out == {}
    assert sum(1 for _ in run.event_lines()) == len(first.events) + 10_250


MEMORY = """
import sys
import numpy as np
import gusset

def memory(kind):
    with open("/proc/self/status") as status:
        return next(1024 * int(line.split()[1]) for line in status if line.startswith(kind))

gusset.open(sys.argv[1])
before, own = memory("VmRSS"), memory("RssAnon")
run = gusset.open(sys.argv[2])
opened = memory("VmRSS") - before
total = sum(float(run[name].sum()) for name in ["time", "x1", "v1", "force_1_1"])
response = run["disp"], run.specimen("column").force, run.all_rows.time
print(len(run.all_rows), opened, memory("RssAnon") - own)
"""


def test_large_file_takes_no_memory(first, place):
    """Opening a file of 200 MB takes no memory, and a column takes its own numbers."""
    shutil.copytree(first.folder, "large")
    rows = np.array(first.all_rows.rows)
    many = np.tile(rows[300:301], 200_000_000 // rows.dtype.itemsize)  # all of the same step, so the last checksum is not right
    many["sequence"] = np.arange(len(many))
    many.tofile("large/samples.bin")
    (place / "memory.py").write_text(MEMORY)
    output = subprocess.check_output([sys.executable, "memory.py", str(first.folder), "large"], text=True)
    count, opened, own = map(int, output.split())
    assert count >= len(many) - 1
    # One column takes 2.3 % of the file. The script reads four, and the two displacements together. One block is 4 MiB.
    column = 8 * len(many)
    assert opened < 0.08 * many.nbytes and own < 6.5 * column + 0.08 * many.nbytes, output


def test_optional_packages_are_named(first, monkeypatch):
    for package, use in [("pandas", first.to_pandas), ("xarray", first.to_xarray), ("matplotlib", first.plot)]:
        for module in [package, f"{package}.pyplot", f"{package}.figure"]:
            monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=f"needs {package}: pip install {package}"):
            use()
    assert first._repr_png_() is None  # a notebook shows the text


def test_tables_have_units(first):
    frame = first.to_pandas()
    assert set(frame.attrs["units"]) == {"time", *frame.columns}
    assert all(unit == first.columns[name].unit for name, unit in frame.attrs["units"].items())
    assert frame.attrs["units"]["x1"] == "m" and frame.attrs["units"]["force_1_1"] == "N"
    assert first.to_pandas(["v2"]).attrs["units"] == {"time": "s", "v2": "m/s"}


def test_dataset_has_time_and_units(first):
    try:
        import xarray
    except ImportError:
        skip("xarray is not installed")
    dataset = first.to_xarray()
    assert isinstance(dataset, xarray.Dataset) and dict(dataset.sizes) == {"time": len(first.step_rows())}
    assert set(dataset.data_vars) == set(first.columns) - {"time"}
    frame = first.to_pandas()
    for name, variable in dataset.variables.items():
        column = first.columns[name]
        assert variable.attrs == {"units": column.unit, "long_name": column.meaning}
        values = frame.index if name == "time" else frame[name]
        assert variable.values.tobytes() == values.to_numpy().tobytes(), name
    ticks = first.to_xarray(["time", "x2"], rate="tick")
    assert list(ticks.data_vars) == ["x2"] and ticks.sizes["time"] == len(first)
    ticks["x2"][0] = 1.0  # a copy
    assert first["x2"][0] == 0
    assert np.array_equal(ticks["x2"].sel(time=2.0), first["x2"][-1])


def test_words_other_than_the_allowed_are_refused(first):
    for table in [first.to_pandas, first.to_xarray]:
        with pytest.raises(gusset.UsageError, match='rate \'steps\': write "step" or "tick"'):
            table(rate="steps")
        with pytest.raises(KeyError, match="no column 'y1'"):
            table(["y1"])


def test_columns_have_the_numbers_of_the_csv_export(first, place):
    with pytest.raises(gusset.RunError) as caught:
        gusset.run(MULTI_RATE, clock="simulated", out="tripped", set={"specimen.0.limits.measured_force_n.trip": [-50e3, 50e3]})
    assert caught.value.run.status == "stopped"
    runs = [first, gusset.run(MULTI_RATE, clock="simulated", out="multi"), caught.value.run]
    for run in runs:
        program = [gusset.binary(), "export", str(run.folder), "--format", "csv", "--out", "run.csv", "--no-units-line"]
        subprocess.run(program, check=True, capture_output=True)
        with open("run.csv", encoding="utf-8") as file:
            header, *lines = csv.reader(file)
        os.remove("run.csv")
        frame = run.to_pandas()
        assert len(frame) == len(lines)
        assert "x1" in header and "force_1_1" in header
        for place_in_line, name in enumerate(header):
            if name in run:
                exported = np.array([float(line[place_in_line] or "nan") for line in lines])
                ours = frame.index.to_numpy() if name == "time" else frame[name].to_numpy()
                assert exported.tobytes() == ours.tobytes(), name
    assert len(runs[1].to_pandas(["x1"], rate="tick")) == len(runs[1]) > 7 * len(runs[1].to_pandas(["x1"]))


def test_degrees_of_freedom_are_counted_from_one(first):
    assert first.dofs == [1, 2]
    assert np.array_equal(first["disp", 2], first["x2"])
    assert np.array_equal(first["vel", 1], first["v1"])
    assert np.array_equal(first["acc", 2], first["a2"])
    assert first["disp"].shape == (len(first), 2)
    assert np.array_equal(first["acceleration"][:, 1], first["a2"])
    assert first.columns["x1"].unit == "m" and first.columns["force_1_1"].unit == "N"
    for key, text in [
        (("disp", 3), "recorded are 1 to 2"),
        (("force", 1), "quantities are"),
        ("force_1_2", "did you mean force_1_1"),
    ]:
        with pytest.raises(KeyError, match=text):
            first[key]


def test_time_runs_from_zero_to_the_end(first, place):
    assert first.time[0] == 0 and first.time[-1] == 2 and len(first) == 513
    assert first.status == "completed" and first.is_complete and first.rows_lost == 0
    run = gusset.run(ROOT / "config" / "static-load.toml", clock="simulated", out="static")
    assert run.time[0] == 0 and np.all(np.diff(run.time) > 0)
    assert len(run.all_rows) > len(run)


def test_specimen_with_several_axes_has_one_column_each(place):
    run = gusset.run(ROOT / "config" / "three-actuators.toml", clock="simulated", out="three")
    column = run.specimen("column")
    assert column.axes == 3 and column.force.shape == (len(run), 3)
    for axis in range(3):
        assert np.array_equal(column.force[:, axis], run[f"force_1_{axis + 1}"])
        assert np.array_equal(column.command[:, axis], run[f"cmd_1_{axis + 1}"])
    assert column.status.shape == (len(run),)
    with pytest.raises(KeyError, match="it has 'column'"):
        run.specimen("brace")


def test_summary_and_events_are_those_of_the_folder(first):
    assert first.summary == json.loads((first.folder / "summary.json").read_text())
    lines = (first.folder / "events.jsonl").read_text().splitlines()
    assert first.events == [json.loads(line) for line in lines]
    assert {"started", "ended"} <= {event["event"] for event in first.events}
    assert np.abs(first["disp", 1]).max() == first.summary["peak"]["displacement"][0]
    assert first.reason == "end of the test"


def test_types_of_the_files_have_their_names(first):
    names = {kind: set(kind.__annotations__) for kind in (Summary, Peak, LinkCounts, Percentiles, TimingEntry)}
    assert set(first.summary) == names[Summary] - {"about"}
    assert set(first.summary["peak"]) == names[Peak] - {"rotations"}
    assert set(first.summary["link"]["column"]) == names[LinkCounts]
    timing = json.loads((first.folder / "timing.json").read_text())
    for key, entry in timing.items():
        assert names[Percentiles] <= set(entry) <= names[TimingEntry], key
        assert set(first.summary["timing"][key]) == set(entry) - {"bins"}
    assert set().union(*timing.values()) == names[TimingEntry]


def damaged(first, change):
    """A copy of the run with other bytes in its samples."""
    shutil.copytree(first.folder, "damaged")
    path = pathlib.Path("damaged/samples.bin")
    data = bytearray(path.read_bytes())
    stride = json.loads(pathlib.Path("damaged/samples.json").read_text())["stride"]
    path.write_bytes(change(data, stride))
    return gusset.open("damaged"), gusset.open("damaged", verify=True)


def test_row_cut_short_is_left_out(first, place):
    for run in damaged(first, lambda data, stride: data[: 10 * stride + 100]):
        assert len(run.all_rows) == 10


def test_empty_record_has_no_rows(first, place):
    for run in damaged(first, lambda data, stride: b""):
        assert len(run) == 0 and run.time.shape == (0,) and run["disp"].shape == (0, 2)
        assert run._repr_png_().startswith(b"\x89PNG")


def test_row_without_its_mark_ends_the_run(first, place):
    def change(data, stride):
        data[21 * stride - 1] ^= 1
        return data

    for run in damaged(first, change):
        assert len(run.all_rows) == 20


def test_wrong_checksum_ends_a_verified_run(first, place):
    def change(data, stride):
        data[20 * stride + 40] ^= 1
        return data

    quick, verified = damaged(first, change)
    assert len(quick.all_rows) == len(first.all_rows) and len(verified.all_rows) == 20


def test_wrong_checksum_of_the_last_row_is_always_seen(first, place):
    def change(data, stride):
        data[-40] ^= 1
        return data

    for run in damaged(first, change):
        assert len(run.all_rows) == len(first.all_rows) - 1


def test_lost_rows_are_counted(first, place):
    for run in damaged(first, lambda data, stride: data[: 5 * stride] + data[8 * stride :]):
        assert run.rows_lost == 3


def test_killed_test_is_readable(frame):
    program = [gusset.binary(), "run", str(frame), "--clock", "real", "--set", "time.duration_s=60", "--out", "killed", "--quiet"]
    process = subprocess.Popen(program, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 30
        run = None
        while run is None or len(run) < 50:
            assert time.monotonic() < deadline
            time.sleep(0.05)
            try:
                run = gusset.open("killed")
            except gusset.FolderError:
                continue
        assert not run.is_complete and run.status is None and run.summary == {}
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    run = gusset.open("killed", verify=True)
    assert len(run) >= 50 and run.time[0] == 0 and run.events
    assert "without summary" in repr(run)


def test_folder_that_is_no_run_is_refused(place, first):
    with pytest.raises(gusset.FolderError, match="no such run folder"):
        gusset.open("missing")
    os.mkdir("empty")
    with pytest.raises(gusset.FolderError, match="it has no samples.json"):
        gusset.open("empty")
    shutil.copytree(first.folder, "other")
    pathlib.Path("other/samples.json").write_text('{"format": "gusset-samples", "version": 2}')
    with pytest.raises(gusset.FolderError, match="version 1"):
        gusset.open("other")
    shutil.copy(first.folder / "samples.json", "other/samples.json")
    os.remove("other/samples.bin")
    with pytest.raises(gusset.FolderError, match=r"no samples\.bin"):
        gusset.open("other")


def test_check_reports_findings(frame):
    result = gusset.check(frame)
    assert result.is_allowed and result.outcome == "clear" and result.data["steps"] == 512
    result = gusset.check(frame, set={"integrator.lambda": 50, "structure.shear_building.stiffness_n_per_m": [0, 12e9]})
    assert not result.is_allowed
    found = result.findings[0]
    assert (found.kind, found.severity, found.key) == ("unstable", "error", "integrator.lambda")
    assert found.numbers["lambda"] == 50 and found.numbers["lambda_limit"] < 10
    with pytest.raises(gusset.RunError) as caught:
        gusset.check(frame, set={"time.rate": 4})
    assert caught.value.code == 2 and "rate_hz" in caught.value.reason


def test_printed_check_has_ten_lines(frame):
    result = gusset.check(frame)
    assert str(result) == repr(result) == "Two storeys: clear, allowed, findings and warnings: 0"
    result = gusset.check(frame, set={"integrator.lambda": 50, "structure.shear_building.stiffness_n_per_m": [0, 12e9]})
    text = str(result)
    lines = text.splitlines()
    assert lines[0].startswith("Two storeys: simulated, not allowed") and "error: integrator.lambda: lambda = 50 is above" in text
    result.findings.insert(0, gusset.Finding("units", "warning", "time", 99 * "long ", {}, []))
    result.findings.extend(5 * result.findings)
    result.data["title"] = 99 * "long "
    for shown in [lines, str(result).splitlines()]:
        assert 5 <= len(shown) <= 10 and max(map(len, shown)) <= 100
        assert "more in `findings`" in shown[-1]
    assert "error: integrator.lambda" in str(result), "errors come first"


ENDS_WITH_ERROR = """
import sys, time
for piece in ["warning: a\\n", "xer", "ror: b\\n", "\\x1b[1", "m\\x1b[91merr", "or\\x1b[0m: b\\n = help: c\\n", "error: d\\n"]:
    sys.stderr.write(piece), sys.stderr.flush(), time.sleep(0.05)
sys.exit(int(sys.argv[1]))
"""


def test_error_is_not_repeated_on_stderr(frame, capfd):
    with pytest.raises(gusset.RunError) as caught:
        gusset.run(frame, set={"time.rate": 4}, out="wrong")
    assert caught.value.reason.startswith("unknown key `rate`") and str(caught.value).count("unknown key") == 1
    assert "unknown key" in caught.value.messages and capfd.readouterr().err == ""
    before, error = "warning: a\nxerror: b\n", "\x1b[1m\x1b[91merror\x1b[0m: b\n = help: c\nerror: d\n"
    for code, shown in [(2, before), (0, before + error)]:
        done = execute([sys.executable, "-c", ENDS_WITH_ERROR, str(code)], quiet=False)
        assert capfd.readouterr().err == shown
        assert done.messages == before + "error: b\n = help: c\nerror: d\n"
        assert done.error == "b\n = help: c\nerror: d"


def test_plot_draws_response_and_loops(first, place):
    figure = first.plot("run.png")
    assert [axes.get_ylabel() for axes in figure.axes] == ["ground acceleration\n(m/s²)", "displacement\n(mm)", "force (kN)"]
    assert (place / "run.png").read_bytes().startswith(b"\x89PNG")
    lines = figure.axes[1].get_lines()
    assert np.allclose(lines[1].get_ydata(), 1e3 * first["disp", 2])


def test_plot_names_every_quantity(first, place):
    """A frame in space: two directions of the ground, a rotation, and an axis that turns."""
    shutil.copytree(first.folder, "space")
    layout = json.loads((place / "space" / "samples.json").read_text())
    names = {"ground": ("ground_x", "m/s2"), "v1": ("ground_z", "m/s2"), "x2": ("x2", "rad")}
    names |= {"meas_1_1": ("meas_1_1", "rad"), "force_1_1": ("force_1_1", "N m")}
    for column in layout["columns"]:
        column["name"], column["unit"] = names.get(column["name"], (column["name"], column["unit"]))
    (place / "space" / "samples.json").write_text(json.dumps(layout))
    axes = gusset.open("space").plot().axes
    labels = [each.get_ylabel() for each in axes]
    assert labels == ["ground acceleration\n(m/s²)", "displacement\n(mm)", "rotation\n(mrad)", "moment (kN·m)"]
    assert [len(each.get_lines()) for each in axes] == [2, 1, 1, 1]
    assert "rotation (mrad)" in axes[-1].get_xlabel()


def test_steps_of_a_served_test_are_its_commits(first, place):
    """A server has no ground motion, and exchanges that belong to no step: here two of three are trials."""
    shutil.copytree(first.folder, "served")
    layout = json.loads((place / "served" / "samples.json").read_text())
    commits = first.columns["ground"].place
    layout["columns"][commits]["name"] = "commits"
    (place / "served" / "samples.json").write_text(json.dumps(layout))
    stride, data = layout["stride"], bytearray((place / "served" / "samples.bin").read_bytes())
    for row, begin in enumerate(range(0, len(data), stride)):
        end = begin + stride - 8
        struct.pack_into("<d", data, begin + 8 + 8 * commits, row // 3)
        struct.pack_into("<I", data, end, zlib.crc32(data[begin:end]))
    (place / "served" / "samples.bin").write_bytes(data)
    run = gusset.open("served", verify=True)
    subprocess.run([gusset.binary(), "export", "served", "--out", "served.csv"], check=True, capture_output=True)
    with open("served.csv", encoding="utf-8") as file:
        times = [float(row["time"]) for row in csv.DictReader(line for line in file if not line.startswith("#"))]
    assert run.to_pandas(["x1"]).index.tolist() == times
    assert len(times) == -(-len(run) // 3) and run._repr_png_()


def test_notebook_shows_one_picture(first, monkeypatch):
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    picture = first._repr_png_()
    assert picture.startswith(b"\x89PNG") and picture.count(b"IHDR") == 1
    assert not any(hasattr(first, f"_repr_{kind}_") for kind in ("html", "svg", "jpeg", "mimebundle"))
    assert pyplot.get_fignums() == before, "pyplot would show the figure, too"
    monkeypatch.setattr(pyplot, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    first.plot()
    assert pyplot.get_fignums() == before
    monkeypatch.undo()
    first.plot()
    assert len(pyplot.get_fignums()) == len(before) + 1, "a script can show it"
    pyplot.close()


def test_octave_opens_the_folder(first):
    octave = shutil.which("octave-cli")
    if octave is None:
        skip("Octave is not installed (Debian: apt-get install octave)")
    script = f"""
        addpath('{ROOT / "tools"}');
        r = gusset_open('{first.folder}');
        printf('%d %s %s %s %d\\n', numel(r.time), r.specimen(1).name, r.summary.status, r.units.x1, numel(r.events));
        printf('%.17g\\n', r.x2, r.specimen(1).force);
    """
    done = subprocess.run([octave, "--quiet", "--norc", "--eval", script], capture_output=True, text=True)
    head, *numbers = done.stdout.splitlines()
    assert head == f"{len(first)} column completed m {len(first.events)}", done.stderr
    expected = np.concatenate([first["disp", 2], first.specimen("column").force])
    assert np.array([float(number) for number in numbers]).tobytes() == expected.tobytes()


def test_octave_names_a_folder_that_is_no_run(place):
    octave = shutil.which("octave-cli")
    if octave is None:
        skip("Octave is not installed (Debian: apt-get install octave)")
    script = f"addpath('{ROOT / 'tools'}'); gusset_open('nowhere')"
    done = subprocess.run([octave, "--quiet", "--norc", "--eval", script], capture_output=True, text=True)
    assert done.returncode != 0 and "nowhere is not a run folder" in done.stderr
