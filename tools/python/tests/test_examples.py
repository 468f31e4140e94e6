"""The example scripts, and the Python blocks of the guide."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gusset
from conftest import ROOT

EXAMPLES = ROOT / "tools" / "python" / "examples"
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
STUDY = re.compile(r"^```toml[^\n]*\n# (\S+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def script(path, *arguments):
    """Runs a script in the current folder, and returns what it prints."""
    done = subprocess.run(
        [sys.executable, path, *arguments], capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def is_picture(path):
    return Path(path).read_bytes().startswith(b"\x89PNG")


def test_fragility_of_a_frame(place):
    # The study of the example, with fewer tests.
    study = (ROOT / "config" / "campaigns" / "ida-frame.toml").read_text(encoding="utf-8")
    study = (
        study.replace("../frame", str(ROOT / "config" / "frame"))
        .replace("count = 20", "count = 10")
        .replace("count = 12", "count = 8")
    )
    Path("study.toml").write_text(study, encoding="utf-8")
    said = script(EXAMPLES / "fragility.py", "study.toml", "ida")
    assert re.search(r"median \d\.\d+ g, dispersion 0\.\d+, 80 tests", said)
    assert is_picture("ida/fragility.png")


def test_damper_reduces_the_response(place):
    peaks = [float(peak) for peak in re.findall(r"roof ([\d.]+) mm", script(EXAMPLES / "damper.py"))]
    assert peaks[1] < 0.8 * peaks[0]
    assert is_picture("runs/damper/damper.png")


def test_run_is_read(first, place):
    said = script(EXAMPLES / "read_run.py", str(first.folder))
    peak = 1e3 * first.summary["peak"]["displacement"][1]
    assert f"{peak:.2f} mm" in said.replace("-", "")
    assert "1 x started" in said and is_picture("run.png")


def test_python_blocks_of_the_guide(place):
    shutil.copytree(ROOT / "config", "config", ignore=shutil.ignore_patterns("target"))
    page = (ROOT / "src" / "guide" / "python.md").read_text(encoding="utf-8")
    for name, text in STUDY.findall(page):
        Path(name).write_text(text, encoding="utf-8")
    blocks = BLOCK.findall(page)
    assert len(blocks) >= 5
    said = ""
    for number, text in enumerate(blocks):
        Path(f"block-{number}.py").write_text(text, encoding="utf-8")
        said += script(f"block-{number}.py")
    assert is_picture("first.png")
    assert re.search(r"median intensity of collapse: \d\.\d+ g", said)
    assert "3 failed ZeroDivisionError('division by zero')" in said


def test_python_block_of_the_readme(place):
    subprocess.run([gusset.binary(), "new", "five-storeys"], check=True, capture_output=True)
    (text,) = BLOCK.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    Path("block.py").write_text(text, encoding="utf-8")
    script("block.py")
    assert is_picture("response.png")


@pytest.mark.skipif("GUSSET_WHEEL_TEST" not in os.environ, reason="the package is used from the source folder")
def test_package_and_program_come_from_the_wheel():
    prefix = Path(sys.prefix).resolve()
    assert prefix in Path(gusset.__file__).resolve().parents
    assert prefix in Path(gusset.binary()).resolve().parents
    said = subprocess.run([gusset.binary(), "--version"], capture_output=True, text=True, check=True).stdout
    assert said.split()[-1] == gusset.__version__
    assert not list(Path(gusset.__file__).parent.glob("*.so")), "no extension module"
    assert (Path(gusset.__file__).parent / "py.typed").exists()
