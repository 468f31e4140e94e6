"""The types of the package, and of the Python blocks of the guide. `tools/test` installs mypy and pyright."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import ROOT, skip

BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
# Packages whose functions no type check can see: they have no types.
WITHOUT_TYPES = ("openseespy", "ops.", "pylauncher", "pyarrow")
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
    # The programs find the modules here, installed or not.
    shutil.copytree(ROOT / "tools" / "python" / "gusset", "gusset", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("specimen.py", "read_samples.py"):
        shutil.copy(ROOT / "tools" / name, name)
    options = {
        "mypy": ["--strict", f"--config-file={ROOT / 'pyproject.toml'}", f"--python-executable={sys.executable}"],
        "pyright": ["--pythonpath", sys.executable],
    }
    command = [python, "-m", request.param, *options[request.param]]
    return lambda *files: subprocess.run([*command, *files], capture_output=True, text=True)


def test_package_has_sound_types(judge):
    done = judge("gusset")
    assert done.returncode == 0, done.stdout + done.stderr


def test_python_blocks_of_the_guide_have_sound_types(judge):
    files = []
    for page in sorted((ROOT / "src" / "guide").glob("*.md")):
        for number, text in enumerate(BLOCK.findall(page.read_text(encoding="utf-8"))):
            if not any(word in text for word in WITHOUT_TYPES):
                files.append(f"{page.stem}_{number}.py".replace("-", "_"))
                Path(files[-1]).write_text(text, encoding="utf-8")
    assert len(files) >= 14
    done = judge(*files)
    assert done.returncode == 0, done.stdout + done.stderr


def test_wrong_words_are_errors(judge):
    Path("wrong.py").write_text(WRONG_WORDS)
    said = judge("wrong.py").stdout
    assert [line for line in (3, 4, 5, 6) if f"wrong.py:{line}:" not in said] == [], said
