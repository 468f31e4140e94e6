#!/usr/bin/env python3
"""OpenSees on the chain of example 4.3 (Gui et al. 2014), ms per step, beside `cargo bench --bench step -- chain`.

    tools/opensees/chain                     average acceleration with Newton, n = 500 ... 5000
    tools/opensees/chain --method kr         KRAlphaExplicit, rho = 1: the same as lambda = 4 for linear models; dense inside

OpenSees has no biviscous law but one with a stiff spring in series, which takes a hundred times longer. The dampers
here are linear with the same initial damping and never yield: less work than the model asks for, in favour of
OpenSees. Loads, masses, springs and the start are those of the bench.
"""
import argparse
import math
import pathlib
import statistics
import time

import peer

MASS, STIFFNESS, DAMPING, DT = 150.0, 2.5e5, 10.0, 0.02
DAMPER = 180.0
SIZES = [500, 1000, 1500, 2000, 2500, 3000, 4000, 5000]
# Largest model of a method whose matrices are dense inside.
LARGEST_DENSE = 1000
STEPS = 60


def build(ops, n):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    # Every mass needs a partner at rest for its damper: one fixed node serves all.
    ops.node(1, 0.0)
    ops.fix(1, 1)
    ops.uniaxialMaterial("Elastic", 1, STIFFNESS, DAMPING)
    ops.uniaxialMaterial("Elastic", 2, 0.0, DAMPER)
    for i in range(n):
        node = i + 2
        # All at one place: zero-length elements join them.
        ops.node(node, 0.0)
        ops.mass(node, MASS)
        ops.element("zeroLength", 2 * i + 1, node - 1, node, "-mat", 1, "-dir", 1, "-doRayleigh", 0)
        ops.element("zeroLength", 2 * i + 2, 1, node, "-mat", 2, "-dir", 1, "-doRayleigh", 0)
    # The base as the force it puts on mass 1: k x_g + c v_g.
    omega = 2.0 * math.pi
    steps = range(3000)
    force = [STIFFNESS * 0.1 * math.sin(omega * i * DT) + DAMPING * 0.1 * omega * math.cos(omega * i * DT) for i in steps]
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *force)
    ops.pattern("Plain", 1, 1)
    ops.load(2, 1.0)


def analyse(ops, method):
    ops.constraints("Plain")
    if method == "newton":
        ops.numberer("RCM")
        ops.system("BandSPD")
        ops.test("NormDispIncr", 1e-10, 50, 0, 2)
        ops.algorithm("Newton")
        ops.integrator("Newmark", 0.5, 0.25)
    else:
        ops.numberer("RCM")
        # Its matrices are full whatever the model.
        ops.system("FullGeneral")
        ops.algorithm("Linear")
        ops.integrator("KRAlphaExplicit", 1.0)
    ops.analysis("Transient", "-noWarnings")


def timed(ops, steps):
    times = []
    for i in range(steps):
        began = time.perf_counter()
        if ops.analyze(1, DT) != 0:
            raise SystemExit(f"OpenSees stopped at step {i}")
        times.append(time.perf_counter() - began)
    return statistics.median(times) * 1e3, min(times) * 1e3, ops.nodeDisp(2, 1)


def ours(file):
    """Steps of the bench in ms by size: the column before `plain`, the widest lanes of this processor."""
    found, column = {}, None
    for line in pathlib.Path(file).read_text().splitlines() if file else []:
        words = line.split()
        if words[:1] == ["n"] and "plain" in words:
            column = words.index("plain") - 1
        elif column and len(words) > column and words[0].isdigit():
            found[int(words[0])] = float(words[column]) * 1e-3
    return found


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--method", choices=("newton", "kr"), default="newton")
    p.add_argument("--steps", type=int, default=STEPS)
    p.add_argument("--ours", metavar="FILE", help="what the bench printed")
    p.add_argument("sizes", type=int, nargs="*", help="numbers of masses; default: those of the paper's Table 2")
    a = p.parse_args()
    ops = peer.opensees()
    sizes = a.sizes or SIZES
    print(f"OpenSees {ops.version()}, {a.method}, {a.steps} steps; ms of a step, median")
    ours_ms = ours(a.ours)
    print(f"{'n':>6}{'OpenSees':>12}{'least':>12}{'ours':>12}{'ratio':>9}")
    for n in sizes:
        if a.method == "kr" and n > LARGEST_DENSE and not a.sizes:
            print(f"{n:>6}{'-':>12}   (dense: ask for it by number)")
            continue
        build(ops, n)
        analyse(ops, a.method)
        p50, least, disp = timed(ops, a.steps)
        if not math.isfinite(disp) or disp == 0.0:
            raise SystemExit(f"OpenSees did not move the chain of {n}")
        beside = f"{ours_ms[n]:>12.5f}{p50 / ours_ms[n]:>8.0f}x" if n in ours_ms else f"{'-':>12}{'-':>9}"
        print(f"{n:>6}{p50:>12.3f}{least:>12.3f}{beside}", flush=True)


if __name__ == "__main__":
    main()
