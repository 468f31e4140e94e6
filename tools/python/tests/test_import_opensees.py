"""`gusset import opensees` against the script's own run in OpenSees, on scripts in the style of the public examples."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest

import gusset
from gusset.importer import Refused
from gusset.importer.opensees import recorded, run
from gusset.importer.opensees.frame import Frame
from gusset.importer.opensees.model import Model
from gusset.importer.units import parse

pytest.importorskip("openseespy")

SCRIPTS = pathlib.Path(__file__).with_name("opensees")
ROOT = pathlib.Path(__file__).resolve().parents[3]
DISPLACEMENT = 3e-3
CONCRETE = 3e-2
# Script, units, and the largest difference of the worst displacement as a share of its root mean square.
MODELS = [
    ("portal.py", "kip,in,s", DISPLACEMENT),
    ("moment_frame.tcl", "kN,mm,s", DISPLACEMENT),
    ("leaning_column.py", "kip,in,s", DISPLACEMENT),
    ("concrete_frame.py", "kip,in,s", CONCRETE),
    ("bridge_bent.tcl", "kip,in,s", CONCRETE),
    ("steel_frame.tcl", "N,mm,s", DISPLACEMENT),
    ("braced_frame.tcl", "kN,m,s", DISPLACEMENT),
    ("isolated_frame.py", "kN,m,s", DISPLACEMENT),
    ("damped_frame.tcl", "N,m,s", DISPLACEMENT),
    ("infill.py", "kN,m,s", DISPLACEMENT),
    ("uneven_hinges.py", "kN,m,s", DISPLACEMENT),
    ("regions.py", "N,m,s", DISPLACEMENT),
    ("mast.tcl", "N,mm,s", DISPLACEMENT),
    ("space_building.py", "N,mm,s", DISPLACEMENT),
]


def options(folder, name, units, **more):
    shutil.copytree(SCRIPTS, folder, dirs_exist_ok=True)
    return {"source": "opensees", "model": str(folder / name), "units": units, "out": str(folder / "model.toml"), **more}


def course(folder, record, steps, substeps):
    asked, answer = folder / "asked.json", folder / f"course-{substeps}.json"
    asked.write_text(json.dumps(record))
    arguments = [sys.executable, str(SCRIPTS / "reference.py"), str(asked), str(steps), str(substeps), str(answer)]
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0 and answer.exists(), done.stdout + done.stderr
    told = json.loads(answer.read_text())
    return told["nodes"], np.array(told["rows"])


@pytest.mark.parametrize(("name", "units", "allowed"), MODELS)
def test_transient_is_that_of_opensees(tmp_path, name, units, allowed):
    found = compare(tmp_path, name, units, allowed)
    assert found["worst"] < allowed, found


def compare(folder, name, units, allowed, seconds=10.0):
    given = options(folder, name, units)
    assert run(given) == 0
    record = recorded(folder / name, folder, 300)
    known = parse(units)
    model = Model(record, known, {}, False)
    Frame(model)
    assert not model.mistakes
    places = gusset.check(folder / "model.toml").data["structure"]["places"]
    result = gusset.run(
        folder / "model.toml", clock="simulated", out=folder / "run", set={"record.dofs": "all", "time.duration_s": seconds}
    )
    dt = float(result.time[1] - result.time[0])
    record.update(constant=list(model.constant.items()), step=dt / known.time, tolerance=1e-9)
    # OpenSees alone, with its step divided until that changes less than a third of the tolerance.
    nodes, last = course(folder, record, len(result.time), 1)
    for substeps in (2, 4, 8, 16, 32):
        _, now = course(folder, record, len(result.time), substeps)
        moved = error(now - last, now, model, known)
        last = now
        if moved < allowed / 3:
            break
    ours = np.zeros_like(last)
    given = set()
    for column, place in enumerate(places):
        tag, direction = place.rsplit(" ", 1)
        at = nodes.index(int(tag)), model.directions.index(direction)
        given.add(at)
        ours[:, at[0], at[1]] = np.asarray(result["disp"][:, column]) / (1.0 if direction.startswith("r") else known.length)
    difference = np.zeros_like(last)
    for at in given:
        difference[:, at[0], at[1]] = ours[:, at[0], at[1]] - last[:, at[0], at[1]]
    return {
        "worst": error(difference, last, model, known),
        "steps": moved,
        "substeps": substeps,
        "peak": float(np.abs(last[:, :, 0]).max()),
    }


def error(difference, reference, model, known):
    """The largest root mean square of a direction, as a share of that of the reference or of a tenth of the largest one."""
    worst = 0.0
    for kind in (slice(0, model.ndm), slice(model.ndm, None)):
        sizes = np.sqrt(np.mean(reference[:, :, kind] ** 2, axis=0))
        errors = np.sqrt(np.mean(difference[:, :, kind] ** 2, axis=0))
        worst = max(worst, float((errors / np.maximum(sizes, 0.1 * sizes.max())).max()))
    return worst


FRAME = """
import openseespy.opensees as ops
ops.model("basic", "-ndm", 2, "-ndf", 3)
ops.node(1, 0.0, 0.0)
ops.fix(1, 1, 1, 1)
ops.node(2, 0.0, 3.0, "-mass", 10.0, 10.0, 5.0)
ops.geomTransf("Linear", 1)
ops.element("elasticBeamColumn", 1, 1, 2, 0.01, 2e8, 1e-4, 1)
{more}
ops.timeSeries("Path", 2, "-dt", 0.01, "-values", *[0.0, 1.0, -1.0] * 20)
ops.pattern("UniformExcitation", 2, 1, "-accel", 2)
ops.analysis("Transient")
try:
    ops.analyze(10, 0.01)
except BaseException:
    pass
open("after.txt", "w")
"""


def refused(folder, more="", **given):
    (folder / "frame.py").write_text(FRAME.format(more=more))
    with pytest.raises(Refused) as reason:
        run(
            {"source": "opensees", "model": str(folder / "frame.py"), "units": "kN,m,s", "out": str(folder / "frame.toml"), **given}
        )
    assert not (folder / "frame.toml").exists()
    return str(reason.value)


def test_script_ends_at_its_transient_analysis(tmp_path):
    (tmp_path / "frame.py").write_text(FRAME.format(more=""))
    given = {"source": "opensees", "model": str(tmp_path / "frame.py"), "units": "kN,m,s", "out": str(tmp_path / "frame.toml")}
    assert run(given) == 0
    assert not (tmp_path / "after.txt").exists()
    with pytest.raises(Refused, match="exists"):
        run(given)
    found = gusset.check(tmp_path / "frame.toml").data["structure"]
    # 3 E I/L³ with the rotary mass: the lower root of det(K − ω² M).
    k = 2e7 / 3.0**3 * np.array([[12.0, -18.0], [-18.0, 36.0]])
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(np.diag([10e3, 5e3]), k)).min())
    assert found["frequencies_rad_per_s"][0] == pytest.approx(omega, rel=1e-9)


MISTAKES = [
    ('ops.element("ShellMITC4", 2, 1, 2)', "frame.py:9: OpenSees does not accept"),
    ('ops.timeSeries("Linear", 1)\nops.pattern("Plain", 1, 1)\nops.load(2, 1.0, 0.0, 0.0)', "frame.py:10: the loads of pattern 1"),
    ('ops.integrator("DisplacementControl", 2, 1, 0.1)', "frame.py:9: `integrator DisplacementControl"),
    ("ops.eigen(1)\nops.modalDamping(0.02)", "frame.py:10: `modalDamping 0.02`"),
    ("ops.node(3, 1.0, 3.0)\nops.node(4, 2.0, 3.0)\nops.equalDOF(2, 3, 1)\nops.equalDOF(3, 4, 1)", "Lead both by 2"),
    ("ops.mass(2, 10.0, 20.0, 5.0)", "node 2 has different masses"),
    (
        "ops.uniaxialMaterial('Steel02', 3, 4e5, 2e8, 0.01)\nops.element('corotTruss', 2, 1, 2, 0.01, 3)",
        "frame.py:10: `element corotTruss",
    ),
    (
        "ops.geomTransf('PDelta', 9)\nops.element('elasticBeamColumn', 2, 1, 2, 0.01, 2e8, 1e-4, 9)\n"
        "ops.rayleigh(0.0, 0.001, 0.0, 0.0)",
        "frame.py:11: `rayleigh 0.0 0.001`",
    ),
    ('ops.timeSeries("Constant", 1)\nops.pattern("Plain", 1, 1)\nops.load(2, 1.0, 0.0, 0.0)', "frame.py:10: no static analysis"),
    ("ops.setTime(1.0)", "begins at the time 1"),
    ('ops.node(3, 0.0, 6.0, "-mass", 1.0, 1.0, 0.0, "-vel", 0.3, 0.0, 0.0)', "-vel"),
    (
        'ops.uniaxialMaterial("Bilin", 3, 1e5, 0.02, 0.02, 50.0, -50.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.02, 0.02, '
        "0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 1.0, 1.0)\nops.node(3, 0.0, 3.0)\nops.fix(3, 1, 1, 1)\n"
        'ops.element("zeroLength", 4, 3, 2, "-mat", 3, "-dir", 6)',
        "IMKBilin",
    ),
    (
        'ops.geomTransf("PDelta", 2)\nops.node(3, 0.0, 6.0)\nops.element("elasticBeamColumn", 2, 2, 3, 0.01, 2e8, 1e-4, 2)',
        "--replace",
    ),
    ("1 / 0", "frame.py:9: division by zero"),
    ("raise SystemExit", "transient"),
    ("import time\ntime.sleep(60)", "--timeout"),
]


@pytest.mark.parametrize(("more", "text"), MISTAKES)
def test_mistake_names_its_line(tmp_path, more, text):
    replaced = ["1=column"] if text == "--replace" else []
    assert text in refused(tmp_path, more, timeout_s=3, replace=replaced)


def test_record_is_that_of_its_command(tmp_path):
    """A script writes one file twice, in another folder, and deletes it. A second motion in one direction has its own file."""
    more = """import os
os.makedirs("sub", exist_ok=True)
os.chdir("sub")
for tag, value in ((5, 1.0), (6, 3.0)):
    with open("motion.txt", "w") as file:
        file.write(f"0 {value} {-value} 0")
    ops.timeSeries("Path", tag, "-dt", 0.02, "-filePath", "motion.txt")
    ops.pattern("UniformExcitation", tag, 1, "-accel", tag)
os.remove("motion.txt")
"""
    (tmp_path / "frame.py").write_text(FRAME.format(more=more).replace('ops.pattern("UniformExcitation", 2', "# ("))
    given = {"source": "opensees", "model": str(tmp_path / "frame.py"), "units": "kN,m,s", "out": str(tmp_path / "frame.toml")}
    assert run(given) == 0
    peaks = [max(np.loadtxt(path, delimiter=",", skiprows=1)[:, 1]) for path in sorted(tmp_path.glob("*.csv"))]
    assert peaks == [1.0, 3.0]
    (tmp_path / "frame.toml").unlink()
    with pytest.raises(Refused, match="frame-ground-1-x.csv exists"):
        run(given)


def test_large_model_is_compared(tmp_path):
    more = """for k in range(3, 150):
    ops.node(k, 0.0, 3.0 + 0.1 * (k - 2), "-mass", 0.1, 0.1, 0.0)
    ops.element("elasticBeamColumn", k, k - 1, k, 0.01, 2e8, 1e-3, 1)"""
    (tmp_path / "frame.py").write_text(FRAME.format(more=more))
    given = {"source": "opensees", "model": str(tmp_path / "frame.py"), "units": "kN,m,s", "out": str(tmp_path / "frame.toml")}
    assert run(given) == 0
    assert gusset.check(tmp_path / "frame.toml").data["structure"]["dofs"] == 444


def test_list_names_all_mistakes(tmp_path, capsys):
    (tmp_path / "frame.py").write_text(
        FRAME.format(more="ops.eigen(1); ops.modalDamping(0.02)\nops.integrator('ArcLength', 1.0, 1.0)")
    )
    given = {"source": "opensees", "model": str(tmp_path / "frame.py"), "units": "kN,m,s", "list": True}
    assert run(given) == 2
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[1] for line in lines[:2]] == ["9", "10"]


def test_tcl_mistake_names_its_line(tmp_path):
    (tmp_path / "frame.tcl").write_text("model basic -ndm 2 -ndf 3\nnode 1 0 0\nelement Frog 1 1 1\n")
    with pytest.raises(Refused, match=r"frame.tcl:3: OpenSees does not accept"):
        run({"source": "opensees", "model": str(tmp_path / "frame.tcl"), "units": "kN,m,s", "out": str(tmp_path / "frame.toml")})


def test_replaced_element_is_the_same_frame(tmp_path):
    """A column of the guide's frame as a specimen that is linear: the frame moves as that with the column inside."""
    page = (ROOT / "src/guide/import.md").read_text()
    script = page.split('```python file="frame.py"\n')[1].split("```")[0]
    # A column that stays elastic, so that its initial stiffness says all.
    script = script.replace('"Steel02", 1, 275e3', '"Steel02", 1, 1e8')
    (tmp_path / "frame.py").write_text(script)
    moved = []
    for replaced in ([], ["1=column"]):
        out = tmp_path / f"frame-{len(replaced)}.toml"
        given = {"source": "opensees", "model": str(tmp_path / "frame.py"), "units": "kN,m,s", "out": str(out), "replace": replaced}
        assert run(given) == 0
        result = gusset.run(out, clock="simulated", out=tmp_path / f"run-{len(replaced)}", set={"record.dofs": "all"})
        moved.append(np.asarray(result["disp"]))
    whole, hybrid = moved
    assert np.abs(hybrid - whole).max() < 1e-3 * np.abs(whole).max()
    loose = {**given, "out": str(tmp_path / "loose.toml")}
    (tmp_path / "frame.py").write_text(script.replace("20.0, 20.0, 15.0", "20.0, 20.0, 0.0"))
    with pytest.raises(Refused, match="4 rz of element 1 has no mass"):
        run(loose)


if __name__ == "__main__":
    import tempfile

    for name, units, allowed in MODELS:
        if len(sys.argv) > 1 and sys.argv[1] not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(name, compare(pathlib.Path(folder), name, units, allowed))
            except (Refused, AssertionError, gusset.GussetError) as reason:
                print(name, type(reason).__name__, str(reason)[:1500])
