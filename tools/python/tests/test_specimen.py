"""Specimens in Python."""

import os
import pathlib
import pickle
import resource
import signal
import subprocess
import sys
import textwrap
import threading

import numpy as np
import pytest

import gusset
from conftest import BRACE, FRAME, LIMITS, Bilinear, Spring, differing, wait_for


def test_bilinear_law_gives_the_bits_of_the_program(frame):
    inside = gusset.run(frame, out="inside")
    served = gusset.run(frame, out="served", specimens={"column": Bilinear()})
    assert differing(inside, served) == []
    assert np.abs(inside["disp", 1]).max() > 4 * 60e3 / 10e6, "the column must yield"
    link = served.summary["link"]["column"]
    assert link["received"] == link["sent"] > 512


def test_next_test_starts_from_the_initial_state(frame):
    column = Bilinear()
    first = gusset.run(frame, out="first", specimens={"column": column})
    second = gusset.run(frame, out="second", specimens={"column": column})
    assert column.slider == 0.0
    assert differing(first, second) == []


def test_specimen_with_reset_is_used_itself(frame):
    class Counting(Spring):
        resets = calls = 0

        def reset(self):
            self.resets += 1
            self.calls = 0

        def respond(self, time, disp, vel):
            self.calls += 1
            return super().respond(time, disp, vel)

    column = Counting(10e6)
    run = gusset.run(frame, specimens={"column": column})
    assert column.calls >= len(run) and column.resets >= 1


def test_arguments_are_those_of_the_record(frame):
    class Recording(Spring):
        def reset(self):
            self.seen = []

        def respond(self, time, disp, vel):
            self.seen.append((time, disp, vel, self.dt))
            return super().respond(time, disp, vel)

    column = Recording(10e6)
    run = gusset.run(frame, specimens={"column": column})
    seen = np.array(column.seen[-len(run) :])
    assert np.array_equal(seen[:, 0], run.time)
    assert np.array_equal(seen[:, 1], run.specimen("column").command)
    assert np.allclose(seen[1:, 3], 1 / 256)
    between = np.diff(run["disp", 1]) * 256
    assert np.abs(seen[1:, 2] - between).max() < 0.05 * np.abs(between).max()


def test_two_specimens_at_the_same_time(place):
    test = place / "two.toml"
    test.write_text(FRAME.replace("[0, 12e6]", "[0, 11e6]") + BRACE)
    inside = gusset.run(test, out="inside")
    served = gusset.run(test, out="served", specimens={"brace": Spring(1e6), "column": Bilinear()})
    assert differing(inside, served) == []
    for place_in_file, name in enumerate(["column", "brace"]):
        assert served.specimens[place_in_file] == name
        assert served.config["specimen"][place_in_file]["link"]["computed"]
        assert served.summary["link"][name]["received"] > 512


def test_axes_are_independent_columns_of_a_specimen(place):
    test = place / "axes.toml"
    head, _, _ = FRAME.partition("[[specimen]]")
    stiffness = [[10e6, -1e6], [-1e6, 3e6]]
    specimen = f"""
[[specimen]]
name = "both"
rows = [[1, 0], [-1, 1]]
stiffness_n_per_m = {stiffness}
coupled = {{ stiffness_n_per_m = {stiffness} }}
"""
    test.write_text(head + specimen)

    class Both(gusset.Specimen):
        axes = 2

        def respond(self, time, disp, vel):
            assert disp.shape == vel.shape == (2,)
            return [10e6 * disp[0] - 1e6 * disp[1], -1e6 * disp[0] + 3e6 * disp[1]]

    inside = gusset.run(test, out="inside")
    served = gusset.run(test, out="served", specimens={"both": Both()})
    ours, theirs = served.specimen("both").force, inside.specimen("both").force
    assert ours.shape == (len(served), 2)
    assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max()
    with pytest.raises(gusset.RunError, match="the test has 2 axes .* axes = 1"):
        gusset.run(test, specimens={"both": Spring(1e6)})


def test_limits_of_the_test_file_are_kept(place):
    test = place / "limited.toml"
    test.write_text(FRAME + LIMITS)
    run = gusset.run(test, out="limited", specimens={"column": Bilinear()})
    assert "unlimited" not in run.config["safety"]
    with pytest.raises(gusset.RunError) as error:
        gusset.run(test, specimens={"column": Spring(10e6)})
    assert error.value.code == 1
    assert error.value.run.status == "stopped"


def test_specimen_without_limits_is_reported(frame):
    run = gusset.run(frame, specimens={"column": Bilinear()})
    assert run.config["safety"]["unlimited"] == "Python specimen"
    assert run.config["specimen"][0]["link"]["computed"] is True
    with pytest.raises(gusset.RunError) as error:
        gusset.run(frame, clock="real", specimens={"column": Bilinear()})
    assert error.value.code == 2 and error.value.run is None
    assert "command_disp_m" in error.value.reason


def test_another_specimen_without_limits_stays_refused(place):
    test = place / "two.toml"
    test.write_text(FRAME + BRACE + '[specimen.link]\naddress = "127.0.0.1:9"\n')
    with pytest.raises(gusset.RunError) as error:
        gusset.run(test, specimens={"column": Bilinear()})
    assert error.value.code == 2


def test_stiffness_of_the_specimen_is_entered(place):
    test = place / "soft.toml"
    test.write_text(FRAME.replace("storey = 1\nstiffness_n_per_m = 10e6\n", "storey = 1\n"))
    run = gusset.run(test, specimens={"column": Bilinear()})
    assert run.config["specimen"][0]["stiffness_n_per_m"] == 10e6
    column = Bilinear()
    column.respond = lambda time, disp, vel: 0.0
    column.stiffness = None
    with pytest.raises(gusset.UsageError, match="stiffness_n_per_m"):
        gusset.run(test, specimens={"column": column})


class Failing(Bilinear):
    def respond(self, time, disp, vel):
        if time >= 1:
            return self.fail(disp)
        return super().respond(time, disp, vel)

    def fail(self, disp):
        raise OverflowError("the column fell over")


FILES = ["test.toml", "resolved.toml", "samples.json", "samples.bin", "events.jsonl", "summary.json", "timing.json", "report.html"]


def test_exception_of_a_specimen_ends_the_run(frame):
    with pytest.raises(gusset.RunError, match="the specimen 'column' raised OverflowError: the column fell over") as caught:
        gusset.run(frame, out="failed", specimens={"column": Failing()})
    error = caught.value
    assert error.code == 3
    cause = error.__cause__
    assert isinstance(cause, OverflowError)
    names = []
    trace = cause.__traceback__
    while trace:
        names.append(trace.tb_frame.f_code.co_name)
        trace = trace.tb_next
    assert names[-2:] == ["respond", "fail"]
    assert error.run.status == "failed"
    assert "the column fell over" in error.run.reason
    assert [name for name in FILES if not (error.run.folder / name).exists()] == []
    assert 'in fail\n    raise OverflowError("the column fell over")' in (error.run.folder / "traceback-column.txt").read_text()
    assert error.run.time[-1] == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("answer", "text"),
    [(float("nan"), "returned nan N"), (None, "returned None; one force in N"), ([1.0, 2.0], r"returned \[1.0, 2.0\]; one force")],
)
def test_answer_that_is_no_force_ends_the_run(frame, answer, text):
    class Wrong(Failing):
        def fail(self, disp):
            return answer

    with pytest.raises(gusset.RunError, match=text) as caught:
        gusset.run(frame, specimens={"column": Wrong()})
    assert caught.value.code == 3
    assert isinstance(caught.value.__cause__, gusset.SpecimenError)


def test_numpy_scalars_are_forces(frame):
    class Numpy(Spring):
        def respond(self, time, disp, vel):
            return np.array([np.float64(10e6) * disp])

    one = gusset.run(frame, out="one", specimens={"column": Numpy(10e6)})
    other = gusset.run(frame, out="other", specimens={"column": Spring(10e6)})
    assert differing(one, other) == []


def test_calls_that_cannot_work_start_nothing(frame, monkeypatch):
    def refused(text, **keys):
        with pytest.raises(gusset.UsageError, match=text):
            gusset.run(frame, **keys)

    refused("has no specimen 'colum'; did you mean 'column'", specimens={"colum": Bilinear()})
    refused("it has 'column'", specimens={"x": Bilinear()})
    refused("is the class Bilinear; give an object", specimens={"column": Bilinear})
    refused("is not a Specimen", specimens={"column": 3})
    refused('write "real" or "simulated"', clock="fast")
    refused("a number, text, bool, list or dict", set={"title": object()})
    refused("which gusset.run writes", specimens={"column": Bilinear()}, set={"specimen.0.link.address": "a:1"})
    column = Bilinear()
    column.axes = 0
    refused("a whole number from 1 to 64", specimens={"column": column})
    column = Bilinear()
    column.lock = threading.Lock()
    refused(r"cannot be copied for a test .* reset\(self\)", specimens={"column": column})
    column = Bilinear()
    column.stiffness = "stiff"
    refused("a number in N/m is needed", specimens={"column": column})
    with pytest.raises(gusset.UsageError, match="no such test file"):
        gusset.run("missing.toml")
    monkeypatch.setenv("GUSSET_BINARY", "/nowhere/gusset")
    with pytest.raises(gusset.MissingBinary, match="GUSSET_BINARY names /nowhere/gusset"):
        gusset.run(frame)
    assert sorted(os.listdir(".")) == ["frame.toml"]


def test_missing_program_is_named(frame, monkeypatch, tmp_path):
    monkeypatch.delenv("GUSSET_BINARY", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("gusset._binary._script_folders", lambda: [])
    with pytest.raises(gusset.MissingBinary, match="pip install"):
        gusset.run(frame)


def test_unknown_key_carries_the_message_of_the_program(frame):
    with pytest.raises(gusset.RunError) as caught:
        gusset.run(frame, set={"integrator.lamda": 4})
    assert caught.value.code == 2 and caught.value.run is None
    assert "lambda" in caught.value.reason
    assert not list(pathlib.Path("runs").iterdir())


def test_values_of_set_reach_the_test(frame):
    run = gusset.run(
        frame,
        set={
            "title": 'Quotes " and \\ and ö',
            "integrator.lambda": np.float64(4),
            "structure.shear_building.mass_kg": np.array([21e3, 18e3]),
            "record.checkpoint_s": 2,
        },
    )
    assert run.config["title"] == 'Quotes " and \\ and ö'
    assert run.summary["lambda"] == 4
    assert run.config["structure"]["shear_building"]["mass_kg"] == [21e3, 18e3]


def test_folder_of_another_run_is_kept(frame):
    first = gusset.run(frame, out="run")
    before = (first.folder / "summary.json").read_bytes()
    with pytest.raises(gusset.RunError) as caught:
        gusset.run(frame, out="run", specimens={"column": Failing()})
    assert caught.value.code == 2 and caught.value.run is None
    assert "run" in caught.value.reason and "end of the test" not in caught.value.reason
    assert (first.folder / "summary.json").read_bytes() == before


def test_results_and_errors_pass_between_processes(frame):
    run = gusset.run(frame)
    copied = pickle.loads(pickle.dumps(run))
    assert np.array_equal(copied["x1"], run["x1"]) and len(pickle.dumps(run)) < 1000
    with pytest.raises(gusset.RunError) as caught:
        gusset.run(frame, specimens={"column": Failing()})
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.code, error.reason, str(error)[:11]) == (3, caught.value.reason, "exit code 3")
    assert error.run.status == "failed"


def test_link_of_the_test_file_is_replaced(place):
    subprocess.run([gusset.binary(), "new", "mine", "--template", "python"], check=True, capture_output=True)
    run = gusset.run("mine.toml", specimens={"first-storey": Bilinear(10e6, 60e3, 0.05)})
    link = run.config["specimen"][0]["link"]
    assert link["coupling"] == "lockstep" and link["address"] != "127.0.0.1:4823"
    assert "unlimited" not in run.config["safety"]


def test_runs_of_the_same_second_have_their_own_folders(frame):
    folders = {gusset.run(frame).folder for _ in range(3)}
    assert len(folders) == 3


SCRIPT = """
import sys
import gusset

class Spring(gusset.Specimen):
    def respond(self, time, disp, vel):
        if time > 0.2:
            print("moving", flush=True)
        return 10e6 * disp

specimens = {"column": Spring()} if sys.argv[1] == "served" else None
print("begin", flush=True)
try:
    keys = {"time.duration_s": 60, "safety.at_end": "zero_displacement", "safety.exit_speed_m_per_s": 0.002}
    gusset.run("frame.toml", clock="real", set=keys, out="run", specimens=specimens)
except KeyboardInterrupt as stopped:
    print("caught", type(stopped).__name__, stopped.code, stopped.run.status, flush=True)
"""


@pytest.mark.parametrize("kind", ["inside", "served"])
def test_ctrl_c_stops_the_test_and_completes_the_folder(place, kind):
    (place / "frame.toml").write_text(FRAME.replace("amplitude = 2.5", "amplitude = 0.5") + LIMITS)
    (place / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, "script.py", kind], stdout=subprocess.PIPE, text=True, start_new_session=True, cwd=place
    )
    try:
        assert process.stdout.readline() == "begin\n"
        if kind == "served":
            assert process.stdout.readline() == "moving\n"
        else:
            wait_for(lambda: is_moving(place / "run"))
        # As the terminal does: SIGINT to all processes of the session in the foreground.
        os.killpg(process.pid, signal.SIGINT)
        output, _ = process.communicate(timeout=60)
    finally:
        process.kill()
    assert "caught Interrupted 130 interrupted\n" in output
    run = gusset.open(place / "run")
    assert [name for name in FILES if not (run.folder / name).exists()] == []
    assert run.time[-1] < 50
    # A second SIGINT would have frozen the specimen on its way to the end position.
    assert abs(run.specimen("column").command[-1]) > 1e-5
    assert run.all_rows.specimen("column").command[-1] == 0


def is_moving(folder):
    """True once the test has run for a moment, so that the specimen is away from zero."""
    return (folder / "samples.json").exists() and len(gusset.open(folder)) > 100


def test_served_specimen_takes_part_in_several_tests(frame, place):
    (place / "spring.py").write_text(
        textwrap.dedent("""
            import gusset

            class Spring(gusset.Specimen):
                stiffness = 10e6
                def respond(self, time, disp, vel):
                    if time > 1.5 and self.stiffness < 0:
                        raise ValueError
                    return 10e6 * disp

            gusset.serve(Spring(), "127.0.0.1:0")
        """)
    )
    server = subprocess.Popen([sys.executable, "spring.py"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=place)
    try:
        line = server.stdout.readline()
        assert line.startswith("listening on 127.0.0.1:")
        keys = {"specimen.0.link": {"address": line.split()[-1], "computed": True}, "safety.unlimited": "test"}
        runs = [gusset.run(frame, out=f"run-{number}", set=keys) for number in range(2)]
        assert differing(*runs) == []
    finally:
        server.terminate()
        server.communicate()


def test_python_specimens_listen_on_this_machine_alone():
    for address in ["0.0.0.0:4823", "192.0.2.7:4823", "rig.lab:4823"]:
        with pytest.raises(ValueError, match="listens on this machine alone"):
            gusset.Server(Spring(1e6), address)
    with pytest.raises(ValueError, match="HOST:PORT"):
        gusset.Server(Spring(1e6), "127.0.0.1")


def test_trivial_law_takes_less_processor_time_than_15000_exchanges_a_second_allow(frame):
    before = resource.getrusage(resource.RUSAGE_SELF)
    run = gusset.run(frame, set={"time.duration_s": 40}, specimens={"column": Spring(10e6)})
    after = resource.getrusage(resource.RUSAGE_SELF)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert seconds / run.summary["link"]["column"]["received"] < 1 / 15_000
