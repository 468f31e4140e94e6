"""Campaigns from Python."""

import csv
import json
import math
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import gusset
from conftest import FRAME, wait_for
from gusset import _process

EARTHQUAKE = FRAME.replace(
    """[excitation.ground_acceleration.signal.sine]
amplitude = 2.5
frequency_hz = 1.8
cycles = 3
""",
    """[excitation.ground_acceleration.processing]
zero_tail = true
[excitation.ground_acceleration.signal.kanai_tajimi]
ground_frequency_hz = 2.4
ground_damping_ratio = 0.6
envelope = { jennings_housner = { rise_s = 0.3, strong_s = 1, decay_per_s = 1 } }
duration_s = 1.5
seed = 1
peak = 1
""",
)
YIELD = "specimen.0.law.bilinear.yield_force_n"
STUDY = f"""
test = "frame.toml"
[campaign]
title = "Yield forces"
replicates = 2
[[vary]]
key = "{YIELD}"
values = [40e3, 80e3]
[[sample]]
key = "structure.damping.rayleigh_ratio.ratio"
std_share = 0.1
[[records]]
synthetic = {{ count = 3, seed = 1 }}
values = [0.1, 0.3, 0.5]
unit = "g"
[measure]
residual = true
collapse = {{ measure = "max_drift", above = 0.02 }}
"""
TASKS = 36


@pytest.fixture
def study(place):
    (place / "frame.toml").write_text(EARTHQUAKE)
    (place / "study.toml").write_text(STUDY)
    return place / "study.toml"


@pytest.fixture(scope="session")
def done(tmp_path_factory):
    """A complete campaign. Tests must not change it."""
    folder = tmp_path_factory.mktemp("done")
    (folder / "frame.toml").write_text(EARTHQUAKE)
    (folder / "study.toml").write_text(STUDY)
    return gusset.campaign(folder / "study.toml", out=folder / "campaign", quiet=True)


def program(*arguments):
    """Runs the program, and returns its exit code."""
    return subprocess.run([gusset.binary(), *map(str, arguments)], capture_output=True, check=False).returncode


def test_table_has_the_numbers_of_the_file(done):
    assert done.complete and done.summary["tasks"] == TASKS
    with (done.folder / "table.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == list(done.table.dtype.names) == list(done.columns)
    assert done.table.shape == (TASKS,) == (len(rows),)
    for place, name in enumerate(names):
        cells, ours = [row[place] for row in rows], done[name]
        assert np.shares_memory(ours, done.table)
        if name in ("record", "ended"):
            assert ours.tolist() == cells
        elif name in ("task", "replicate"):
            assert ours.dtype == np.int64 and ours.tolist() == [int(cell) for cell in cells]
        else:
            assert ours.dtype == np.float64
            assert np.array([float(cell or "nan") for cell in cells]).tobytes() == ours.tobytes()
    assert done["task"].tolist() == list(range(1, TASKS + 1))
    assert set(done[YIELD]) == {40e3, 80e3} and set(done["intensity"]) == {0.1, 0.3, 0.5}
    assert done.columns["max_drift"].unit == "m" and done.columns["intensity"].unit == "g"
    assert done.report.read_text().startswith("<!")


def test_row_has_the_peak_of_a_single_test(frame, place):
    (place / "one.toml").write_text(f'test = "frame.toml"\n[[vary]]\nkey = "{YIELD}"\nvalues = [60e3, 50e3]\n')
    campaign = gusset.campaign("one.toml", quiet=True)
    assert campaign.folder == pathlib.Path("campaigns/one")
    for row, force in enumerate([60e3, 50e3]):
        run = gusset.run(frame, set={YIELD: force}, out=f"run-{row}")
        assert campaign["peak_x2"][row] == np.abs(run["disp", 2]).max()


def test_each_value_of_a_key_has_a_fragility_curve(done):
    # Two yield forces are two structures.
    assert done.fragility is None
    found = done.summary["fragility"]
    assert [one["point"] for one in found["points"]] == [f"{YIELD} = {force}" for force in ("40000.0", "80000.0")]
    assert done.fragilities
    for point, fragility in done.fragilities.items():
        fit = next(one["fit"] for one in found["points"] if one["point"] == point)
        assert (fragility.median, fragility.dispersion) == (fit["median"], fit["dispersion"])
        assert fragility.unit == "g" and fragility.levels.tolist() == [0.1, 0.3, 0.5]
        assert fragility.tests.tolist() == [6, 6, 6]
        own = done[YIELD] == float(point.split(" = ")[1])
        counts = [int(done["collapse"][own & (done["intensity"] == level)].sum()) for level in fragility.levels]
        assert fragility.collapses.tolist() == counts
        # One dispersion above the median: the normal distribution at 1.
        above = fragility.median * math.exp(fragility.dispersion)
        assert fragility.probability([0, fragility.median, above]) == pytest.approx([0, 0.5, 0.8413447460685429])
        assert fragility.probability(fragility.median).shape == ()


def test_pandas_has_the_same_table(done):
    pandas = pytest.importorskip("pandas")
    table = done.to_pandas()
    assert table.attrs["units"] == {name: column.unit for name, column in done.columns.items()}
    assert isinstance(table, pandas.DataFrame) and list(table.columns) == list(done.columns)
    assert table["max_drift"].to_numpy().tobytes() == done["max_drift"].tobytes()
    assert table.groupby("intensity")["max_drift"].count().tolist() == [12, 12, 12]


def test_campaign_without_levels_has_no_fragility(frame, place):
    (place / "one.toml").write_text('test = "frame.toml"\n[[vary]]\nkey = "integrator.lambda"\nvalues = [1, 4]\n')
    campaign = gusset.campaign("one.toml", quiet=True, prove=0, jobs=1)
    assert campaign.fragility is None
    assert campaign.summary["provenance"]["tasks_computed_again_with_equal_bits"] == 0
    assert campaign["integrator.lambda"].tolist() == [1, 4]


def test_texts_and_empty_cells(frame, place):
    (place / "one.toml").write_text(
        """test = "frame.toml"
[campaign]
design = "one_at_a_time"
[[vary]]
key = "integrator.lambda"
values = [1, 4]
[[vary]]
key = "title"
values = ["a, b", "c"]
"""
    )
    campaign = gusset.campaign("one.toml", quiet=True)
    base = [row for row in campaign.table if math.isnan(row["integrator.lambda"])]
    assert {row["title"] for row in base} >= {"a, b", "c"}
    assert {row["integrator.lambda"] for row in campaign.table if row["title"] == ""} >= {1.0, 4.0}


def test_texts_come_back_without_the_mark_of_a_formula(frame, place):
    titles = ["=1+2", "-a", "@a", "'b", "c"]
    listed = ", ".join(f'"{title}"' for title in titles)
    (place / "titles.toml").write_text(f'test = "frame.toml"\n[[vary]]\nkey = "title"\nvalues = [{listed}]\n')
    campaign = gusset.campaign("titles.toml", quiet=True)
    assert campaign["title"].tolist() == titles
    assert ",'=1+2," in (campaign.folder / "table.csv").read_text()


def test_a_pipe_is_no_table(study, place):
    campaign = gusset.campaign(study, out="piped", quiet=True)
    (campaign.folder / "table.csv").unlink()
    os.mkfifo(campaign.folder / "table.csv")
    with pytest.raises(gusset.FolderError, match="no plain file"):
        _ = gusset.open_campaign("piped").table


def test_unknown_column_is_named(done):
    with pytest.raises(KeyError, match="did you mean max_drift"):
        done["max_drif"]


def test_same_call_continues_and_keeps_the_table(study, done):
    assert program("campaign", "plan", study, "--out", "part", "--tasks-per-chunk", 5) == 0
    assert program("campaign", "work", "part", "--chunk", 3) == 0
    campaign = gusset.open_campaign("part")
    assert not campaign.complete and campaign.summary == {} and campaign.plan["tasks"] == TASKS
    assert "without a table" in repr(campaign)
    with pytest.raises(gusset.FolderError, match="no table yet"):
        _ = campaign.table
    assert program("campaign", "collect", "part") == 1
    partial = gusset.open_campaign("part")
    assert not partial.complete and partial["task"].tolist() == [11, 12, 13, 14, 15]
    assert "5 of 36 tests" in repr(partial)
    for first in [study, "part"]:
        keys = {"out": "part"} if first == study else {}
        campaign = gusset.campaign(first, quiet=True, **keys)
        assert campaign.complete
        assert (campaign.folder / "table.csv").read_bytes() == (done.folder / "table.csv").read_bytes()


def test_incomplete_campaign_raises_with_what_is_done(study, place, monkeypatch):
    assert program("campaign", "plan", study, "--out", "part", "--tasks-per-chunk", 30) == 0
    assert program("campaign", "work", "part", "--chunk", 2) == 0
    # A program that collects without computing: what is left after a failure of many machines.
    (place / "collects").write_text(f'#!/bin/sh\nexec {gusset.binary()} campaign collect "$3"\n')
    (place / "collects").chmod(0o755)
    monkeypatch.setenv("GUSSET_BINARY", str(place / "collects"))
    with pytest.raises(gusset.CampaignError) as caught:
        gusset.campaign("part", quiet=True)
    error = caught.value
    assert error.code == 1 and "30 of 36" in error.reason
    assert not error.campaign.complete and len(error.campaign.table) == 6
    copied = pickle.loads(pickle.dumps(error))
    assert (copied.code, copied.campaign.folder) == (1, pathlib.Path("part").resolve())


def test_wrong_study_carries_the_message_of_the_program(study, place):
    study.write_text(STUDY.replace("replicates", "replicate"))
    with pytest.raises(gusset.CampaignError) as caught:
        gusset.campaign(study, out="wrong", quiet=True)
    error = caught.value
    assert error.code == 2 and error.campaign is None
    assert "replicates" in error.reason and "study.toml" in error.reason and "\x1b" not in error.reason
    assert not os.path.exists("wrong")


def test_changed_study_and_other_folders_are_refused(study, place):
    assert program("campaign", "plan", study, "--out", "part") == 0
    with study.open("a") as file:
        file.write("energy = true\n")
    with pytest.raises(gusset.CampaignError, match="has changed since the plan") as caught:
        gusset.campaign(study, out="part", quiet=True)
    assert caught.value.code == 2
    (place / "other.toml").write_text(STUDY)
    with pytest.raises(gusset.UsageError, match="has the campaign of another study"):
        gusset.campaign("other.toml", out="part")
    with pytest.raises(gusset.UsageError, match="no such study file or campaign folder"):
        gusset.campaign("missing.toml")
    with pytest.raises(gusset.UsageError, match="out is for a study file"):
        gusset.campaign("part", out="elsewhere")
    (place / "taken").mkdir()
    (place / "taken" / "notes.txt").write_text("mine")
    with pytest.raises(gusset.CampaignError, match=r"notes\.txt") as caught:
        gusset.campaign(study, out="taken", quiet=True)
    assert caught.value.code == 2 and caught.value.campaign is None
    for folder, text in [("taken", "it has no plan.json"), ("missing", "no such campaign folder")]:
        with pytest.raises(gusset.FolderError, match=text):
            gusset.open_campaign(folder)
    with pytest.raises(gusset.FolderError, match="it has no plan.json"):
        gusset.campaign("taken")


def test_messages_are_kept_without_progress():
    drawn = "\x1b[?7l\r### 20 %  results\x1b[0m\x1b[K\n\r\x1b[J\x1b[?7h"
    again = "\r\x1b[1A" + drawn
    gone = "\r\x1b[1A\x1b[?7l\r\x1b[J\x1b[?7h"
    assert _process.plain(f"one\n{drawn}{again}{gone}\x1b[1;31mtwo\x1b[0m\n") == "one\ntwo\n"


def test_ctrl_c_loses_no_message(place):
    """The last message comes after the end of the program, from a process that it left behind."""
    script = "trap '(sleep 0.3; echo last >&2) & exit 130' INT; echo first >&2; touch ready; while :; do sleep 0.05; done"

    def press():
        wait_for((place / "ready").exists)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press).start()
    outcome = _process.execute(["sh", "-c", script], quiet=True)
    assert outcome == _process.Outcome(130, "first\nlast\n", True)


def test_program_has_its_own_session():
    """So the Ctrl-C of a terminal does not reach it twice."""
    script = "import os, sys; print(os.getsid(0) == os.getpid(), file=sys.stderr)"
    assert _process.execute([sys.executable, "-c", script], quiet=True) == _process.Outcome(0, "True\n", False)


def test_messages_pass_through_unless_quiet(study, capfd):
    gusset.campaign(study, out="loud", prove=0)
    assert "36 tasks" in capfd.readouterr().err
    gusset.campaign(study, out="silent", prove=0, quiet=True)
    assert capfd.readouterr() == ("", "")


SCRIPT = """
import gusset

try:
    gusset.campaign("wrong.toml")
except gusset.CampaignError as error:
    print("replicates" in error.reason, "\\x1b" in error.messages, flush=True)
try:
    gusset.campaign("long.toml")
except KeyboardInterrupt as stopped:
    print("caught", type(stopped).__name__, stopped.code, stopped.campaign.folder, flush=True)
"""


def read_until(terminal, wanted, process):
    """What appears on a terminal up to `wanted`."""
    text = b""
    while wanted not in text:
        try:
            data = os.read(terminal, 65536)
        except OSError:
            data = b""
        assert data, (process.poll(), text)
        text += data
    return text


def test_terminal_shows_progress_and_ctrl_c_stops_the_campaign(study, place):
    text = STUDY.replace("replicates = 2", "replicates = 1000")
    (place / "long.toml").write_text(text)
    (place / "wrong.toml").write_text(STUDY.replace("replicates", "replicate"))
    (place / "script.py").write_text(SCRIPT)
    ours, theirs = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "script.py"],
        stdout=subprocess.PIPE,
        stderr=theirs,
        text=True,
        start_new_session=True,
        cwd=place,
        env={name: value for name, value in os.environ.items() if name != "NO_COLOR"},
    )
    os.close(theirs)
    try:
        # The exception has the error without colours; the terminal does not repeat it.
        assert process.stdout.readline() == "True False\n"
        # Progress with the remaining time, drawn over itself.
        assert b"replicates" not in read_until(ours, b"tests of the campaign, about ", process)
        os.killpg(process.pid, signal.SIGINT)
        last = read_until(ours, b"stopped; continue with", process)
        assert b"\x1b[" in last
        output, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    assert output == "caught Interrupted 130 campaigns/long\n"
    status = subprocess.run([gusset.binary(), "campaign", "status", "campaigns/long", "--json"], stdout=subprocess.PIPE, text=True)
    assert status.returncode == 1 and 0 < json.loads(status.stdout)["done"] < 1000 * 18
