"""Tests of the package. `tools/test` runs them against the wheel, installed in a clean environment.

While you work on the package: GUSSET_BINARY=target/debug/gusset PYTHONPATH=tools/python pytest
"""

import os
import pathlib
import threading

import pytest

import gusset

ROOT = pathlib.Path(__file__).resolve().parents[3]

FRAME = """
title = "Two storeys"
[time]
rate_hz = 256
duration_s = 2
clock = "simulated"
[structure.shear_building]
mass_kg = [20e3, 18e3]
stiffness_n_per_m = [0, 12e6]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration.signal.sine]
amplitude = 2.5
frequency_hz = 1.8
cycles = 3
[[specimen]]
name = "column"
storey = 1
stiffness_n_per_m = 10e6
[specimen.law.bilinear]
stiffness_n_per_m = 10e6
yield_force_n = 60e3
post_yield_ratio = 0.05
"""
BRACE = """
[[specimen]]
name = "brace"
storey = 2
stiffness_n_per_m = 1e6
law.linear = { stiffness_n_per_m = 1e6 }
"""
LIMITS = """
[specimen.limits]
command_disp_m = { trip = [-0.1, 0.1] }
measured_force_n = { trip = [-200e3, 200e3] }
"""


class Bilinear(gusset.Specimen):
    """The bilinear law of the program, in Python: the same operations in the same order."""

    def __init__(self, stiffness=10e6, yield_force=60e3, ratio=0.05):
        self.stiffness, self.yield_force, self.ratio = stiffness, yield_force, ratio
        self.yield_disp = yield_force / stiffness
        self.slider = 0.0

    def respond(self, time, disp, vel):
        stretch = disp - self.slider
        if stretch > self.yield_disp:
            self.slider, force = disp - self.yield_disp, self.yield_force
        elif stretch < -self.yield_disp:
            self.slider, force = disp + self.yield_disp, -self.yield_force
        else:
            force = self.stiffness * stretch
        return self.ratio * self.stiffness * disp + (1.0 - self.ratio) * force


class Spring(gusset.Specimen):
    """A linear spring."""

    def __init__(self, stiffness):
        self.stiffness = stiffness

    def respond(self, time, disp, vel):
        return self.stiffness * disp


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def frame(place):
    """A test file: two storeys, the first one a bilinear specimen."""
    (place / "frame.toml").write_text(FRAME)
    return place / "frame.toml"


@pytest.fixture(scope="session")
def first(tmp_path_factory):
    """A completed run of the frame. Tests must not change it."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "frame.toml").write_text(FRAME)
    return gusset.run(folder / "frame.toml", out=folder / "run")


def skip(text):
    """Skips a test, or fails it where CI=true."""
    if os.environ.get("CI") == "true":
        pytest.fail(text)
    pytest.skip(text)


def wait_for(condition):
    """Waits until a condition holds."""
    for _ in range(600):
        if condition():
            return
        threading.Event().wait(0.05)
    raise AssertionError("waited too long")


def differing(one, other):
    """Names of the columns that must be equal from t = 0, bit for bit, and are not."""
    assert one.time[0] == other.time[0] == 0
    assert list(one.columns) == list(other.columns)
    kept = [name for name, column in one.columns.items() if not column.is_timing]
    assert len(kept) > 20
    return [name for name in kept if one[name].tobytes() != other[name].tobytes()]
