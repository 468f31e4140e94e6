#!/usr/bin/env python3
"""Measures the exchanges per second of a linear law in Python, and of the same law in Rust behind the same link.

    python3 exchanges.py [REPETITIONS]

Both run on the simulated clock over TCP on the loopback, in turn. It prints the medians and their ratio.
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile

import gusset

STEPS = 20_000
STIFFNESS = 10e6  # N/m
TEST = f"""
title = "Exchanges"
[time]
rate_hz = 1000
duration_s = {STEPS // 1000}
clock = "simulated"
[structure.shear_building]
mass_kg = [20e3, 18e3]
stiffness_n_per_m = [0, 12e6]
[excitation.ground_acceleration.signal.sine]
amplitude = 2
frequency_hz = 1.5
cycles = 20
[[specimen]]
name = "column"
storey = 1
stiffness_n_per_m = {STIFFNESS}
law.linear = {{ stiffness_n_per_m = {STIFFNESS} }}
"""


class Spring(gusset.Specimen):
    def respond(self, time, disp, vel):
        return STIFFNESS * disp


def rate(run):
    """Exchanges per second of wall time."""
    return run.summary["link"]["column"]["received"] / run.summary["wall_seconds"]


def main():
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    python, rust = [], []
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        test = place / "test.toml"
        test.write_text(TEST)
        arguments = [gusset.binary(), "serve", str(test), "--listen", "127.0.0.1:0", "--quiet", "--control", str(place / "c.sock")]
        server = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
        try:
            address = server.stdout.readline().split()[-1]
            link = {"specimen.0.link.address": address, "specimen.0.link.computed": True, "safety.unlimited": "benchmark"}
            for number in range(repetitions):
                run = gusset.run(test, out=place / f"python-{number}", specimens={"column": Spring()}, quiet=True)
                python.append(rate(run))
                rust.append(rate(gusset.run(test, out=place / f"rust-{number}", set=link, quiet=True)))
                print(f"{python[-1]:.0f} exchanges/s in Python, {rust[-1]:.0f} in Rust", flush=True)
        finally:
            server.terminate()
            server.wait()
    python, rust = statistics.median(python), statistics.median(rust)
    print(f"medians of {repetitions}: Python {python:.0f} exchanges/s, Rust {rust:.0f} exchanges/s, ratio {python / rust:.2f}")


if __name__ == "__main__":
    main()
