"""The types of the package, and of the Python blocks of the guide. `tools/test` installs mypy and pyright."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import gusset
from conftest import ROOT, skip

BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
# A fragment of a script, and a package that no test installs.
LEFT_OUT = ("opensees-rig-0", "launchers-0")
WRONG_WORDS = """
import gusset
run = gusset.run("test.toml", clock="reel")
run.to_pandas(rate="steps")
run.to_xarray(rate="steps")
run["force", 1]
"""


@pytest.fixture(params=["mypy", "pyright"])
def judge(request, place):
    """A function that checks these files, and returns what the program says."""
    python = os.environ.get("GUSSET_MATURIN_PYTHON", sys.executable)
    if subprocess.run([python, "-m", request.param, "--version"], capture_output=True).returncode != 0:
        skip(f"SKIPPED: {request.param} is not installed; `tools/test` installs it")
    source = Path(gusset.__file__).parents[1]
    command = [python, "-m", request.param]
    if request.param == "mypy":
        command += ["--strict", f"--config-file={ROOT / 'pyproject.toml'}", f"--python-executable={sys.executable}"]
    else:
        (place / "pyrightconfig.json").write_text(f'{{"extraPaths": ["{source}", "{ROOT / "tools"}"]}}')
        command += ["--pythonpath", sys.executable, "--project", str(place / "pyrightconfig.json")]
    installed = "site-packages" in source.parts
    path = os.pathsep.join(map(str, [ROOT / "tools"] if installed else [source, ROOT / "tools"]))

    def run(*files):
        if request.param == "pyright":
            (place / "pyrightconfig.json").write_text(
                f'{{"extraPaths": ["{source}", "{ROOT / "tools"}"], "include": [{", ".join(f"{str(file)!r}" for file in files)}]}}'.replace("'", '"')
            )
            command_of = command
        else:
            command_of = [*command, *map(str, files)]
        return subprocess.run(command_of, capture_output=True, text=True, cwd=place, env={**os.environ, "MYPYPATH": path})

    return run


def test_package_has_sound_types(judge):
    done = judge(ROOT / "tools" / "python" / "gusset")
    assert done.returncode == 0, done.stdout + done.stderr


def test_python_blocks_of_the_guide_have_sound_types(judge, place):
    files = []
    for page in sorted((ROOT / "src" / "guide").glob("*.md")):
        for number, text in enumerate(BLOCK.findall(page.read_text(encoding="utf-8"))):
            if f"{page.stem}-{number}" not in LEFT_OUT:
                files.append(place / f"{page.stem}_{number}.py".replace("-", "_"))
                files[-1].write_text(text, encoding="utf-8")
    assert len(files) >= 16
    done = judge(*files)
    assert done.returncode == 0, done.stdout + done.stderr


def test_wrong_words_are_errors(judge, place):
    (place / "wrong.py").write_text(WRONG_WORDS)
    said = judge(place / "wrong.py").stdout
    assert [line for line in (3, 4, 5, 6) if f"wrong.py:{line}:" not in said] == [], said
