#!/usr/bin/env python3
"""A damper law of one's own: a nonlinear viscous damper in parallel with a spring, as the first storey of a frame.

    python3 damper.py [FOLDER]

It compares the frame with and without the damper. Needs matplotlib.
"""

import math
import pathlib
import sys

import matplotlib.pyplot as plt
import numpy as np

import gusset

TEST = pathlib.Path(__file__).resolve().parents[3] / "config" / "frame-bouc-wen.toml"


class Damper(gusset.Specimen):
    """f = k d + c |v|^a sign(v), with k in N/m, c in N (s/m)^a and a without unit."""

    def __init__(self, stiffness, coefficient, exponent):
        self.stiffness = stiffness  # also the initial stiffness of the specimen
        self.coefficient, self.exponent = coefficient, exponent

    def respond(self, time, disp, vel):
        damping = math.copysign(self.coefficient * abs(vel) ** self.exponent, vel)
        return self.stiffness * disp + damping


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "runs/damper")
    figure, (history, loop) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for name, coefficient in [("without", 0.0), ("with", 150e3)]:
        storey = Damper(15e6, coefficient, 0.4)
        run = gusset.run(TEST, clock="simulated", specimens={"ground-storey": storey}, out=folder / name, quiet=True)
        roof, measured = run["disp", 3], run.specimen("ground-storey")
        print(f"{name} damper: largest displacement of the roof {1e3 * np.abs(roof).max():.1f} mm")
        history.plot(run.time, 1e3 * roof, linewidth=0.8, label=f"{name} damper")
        loop.plot(1e3 * measured.disp, 1e-3 * measured.force, linewidth=0.8)
    history.set(xlabel="time (s)", ylabel="displacement of the roof (mm)")
    history.legend()
    loop.set(xlabel="displacement of the specimen (mm)", ylabel="force of the specimen (kN)")
    figure.savefig(folder / "damper.png", dpi=150)


if __name__ == "__main__":
    main()
