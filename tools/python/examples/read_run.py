#!/usr/bin/env python3
"""Reads a run folder: peaks, energy into each specimen, events, and a picture. Needs matplotlib.

python3 read_run.py RUN_FOLDER [PICTURE.png]
"""

import collections
import sys

import numpy as np

import gusset


def main():
    run = gusset.open(sys.argv[1])
    print(run)
    print(f"{run.status}: {run.reason}; {run.time[-1]:.2f} s of test time")
    for dof in run.dofs:
        peak = int(np.abs(run["disp", dof]).argmax())
        print(f"DOF {dof}: largest displacement {1e3 * run['disp', dof][peak]:.2f} mm at {run.time[peak]:.2f} s")
    for name in run.specimens:
        specimen = run.specimen(name)
        disp, force = specimen.disp.reshape(len(run), -1), specimen.force.reshape(len(run), -1)
        work = ((force[1:] + force[:-1]) / 2 * np.diff(disp, axis=0)).sum()
        print(f"{name}: largest force {np.abs(force).max() / 1e3:.1f} kN, energy {work / 1e3:.2f} kJ")
    for kind, count in collections.Counter(event["event"] for event in run.events).most_common():
        print(f"{count} x {kind}")
    run.plot(sys.argv[2] if len(sys.argv) > 2 else "run.png")


if __name__ == "__main__":
    main()
