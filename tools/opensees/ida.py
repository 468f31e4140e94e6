#!/usr/bin/env python3
"""Incremental dynamic analysis of a three-storey frame in OpenSees, with one process for each core.

    ida.py --records FOLDER --levels 1,2,3 --processes 2

The frame: masses 20000, 20000 and 18000 kg; storeys of 15e6 N/m (yields at 120 kN, 8 % after yielding), 14e6 and 11e6 N/m; damping
0.4 1/s times the mass. Each file of FOLDER has a head, and lines of time in s and acceleration in m/s2, 1024 a second; it is scaled
to each peak in m/s2.
Prints JSON: wall time in s without the start of Python, and the largest drift of each test in m, by record and level.
"""
import argparse
import json
import multiprocessing
import pathlib
import time

import peer

DT = 1.0 / 1024.0
MASSES = (20e3, 20e3, 18e3)


def drift(task):
    """The largest drift of one test, m."""
    accels, level = task
    ops = peer.opensees()
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.fix(1, 1)
    for node, mass in enumerate(MASSES, start=2):
        ops.node(node, 0.0)
        ops.mass(node, mass)
    ops.uniaxialMaterial("Steel01", 1, 120e3, 15e6, 0.08)
    ops.uniaxialMaterial("Elastic", 2, 14e6)
    ops.uniaxialMaterial("Elastic", 3, 11e6)
    for storey in (1, 2, 3):
        ops.element("zeroLength", storey, storey, storey + 1, "-mat", storey, "-dir", 1)
    ops.rayleigh(0.4, 0.0, 0.0, 0.0)
    peak = max(abs(accel) for accel in accels)
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *accels, "-factor", level / peak)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("ProfileSPD")
    ops.test("NormDispIncr", 1e-10, 20)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    most = 0.0
    disp = [0.0] * 4
    for _ in range(len(accels) - 1):
        if ops.analyze(1, DT) != 0:
            return float("inf")
        for node in (2, 3, 4):
            disp[node - 1] = ops.nodeDisp(node, 1)
        for storey in (1, 2, 3):
            most = max(most, abs(disp[storey] - disp[storey - 1]))
    return most


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--records", required=True, type=pathlib.Path)
    p.add_argument("--levels", required=True)
    p.add_argument("--processes", type=int, default=2)
    a = p.parse_args()
    levels = [float(word) for word in a.levels.split(",")]
    files = sorted(a.records.iterdir())
    records = [[float(line.split(",")[1]) for line in file.read_text().split()[1:]] for file in files]
    tasks = [(accels, level) for accels in records for level in levels]
    with multiprocessing.Pool(a.processes) as pool:
        pool.map(drift, tasks[: a.processes], chunksize=1)  # loads OpenSees in each process
        began = time.perf_counter()
        drifts = pool.map(drift, tasks, chunksize=1)
        wall = time.perf_counter() - began
    print(json.dumps({"wall_s": wall, "drifts": drifts}))


if __name__ == "__main__":
    main()
