#!/usr/bin/env python3
"""A portal frame whose left column is a specimen in a laboratory. `gusset guide opensees-rig` explains it step by step.

    gusset serve gateway.toml --out runs/portal
    portal.py --port 8090

OpenSees computes the frame in inches, kips and seconds. Through `genericClient` it commands the translation and the
rotation of the top of the column. Then it computes the whole frame by itself. Prints JSON: the largest difference of the
sway and of the rotation between both analyses, each over its largest value, and these largest values.
"""
import argparse
import math

import peer

HEIGHT, SPAN = 120.0, 240.0      # in
E = 29000.0                      # ksi
COLUMN, BEAM = 300.0, 1000.0     # moments of inertia, in4
AREA = 20.0                      # in2
MASS, INERTIA = 0.25, 200.0      # at each end of the beam, kip s2/in and kip in s2
TOPS = (3, 4)

# Explicit: one new displacement in each step. Newton's method moves the specimen at each trial: a gateway refuses that.
SCHEMES = {
    "explicit": (("NewmarkExplicit", 0.5), ("Linear",)),
    "newton": (("Newmark", 0.5, 0.25), ("Newton",)),
}


def ground(t):
    """Ground acceleration in in/s2. It begins at zero."""
    return math.sin(0.8 * t) * (60.0 * math.sin(13.0 * t) + 30.0 * math.sin(31.0 * t))


def build(ops, a, remote):
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for node, x, y in ((1, 0.0, 0.0), (2, SPAN, 0.0), (3, 0.0, HEIGHT), (4, SPAN, HEIGHT)):
        ops.node(node, x, y)
    for foot in (1, 2):
        ops.fix(foot, 1, 1, 1)
    # Columns and beam keep their lengths.
    for top in TOPS:
        ops.fix(top, 0, 1, 0)
        ops.mass(top, MASS, 0.0, INERTIA)
    ops.equalDOF(3, 4, 1)
    ops.geomTransf("Linear", 1)
    ops.element("elasticBeamColumn", 2, 2, 4, AREA, E, COLUMN, 1)
    ops.element("elasticBeamColumn", 3, 3, 4, AREA, E, BEAM, 1)
    if remote:
        # The gateway must listen by now: without it OpenSees crashes.
        ops.element("genericClient", 1, "-node", 3, "-dof", 1, 3, "-server", a.port, "127.0.0.1")
    else:
        ops.element("elasticBeamColumn", 1, 1, 3, AREA, E, COLUMN, 1)
    ops.rayleigh(a.damping, 0.0, 0.0, 0.0)
    ops.timeSeries("Path", 1, "-dt", a.dt, "-values", *[ground(i * a.dt) for i in range(a.steps + 2)])
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    integrator, algorithm = SCHEMES[a.scheme]
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-12, 20)
    ops.algorithm(*algorithm)
    ops.integrator(*integrator)
    ops.analysis("Transient")


def history(ops, a, remote):
    """Sway and rotation of the top of the left column, step by step."""
    build(ops, a, remote)
    course = []
    for step in range(a.steps):
        if ops.analyze(1, a.dt) != 0:
            raise SystemExit("step %d failed" % (step + 1))
        course.append((ops.nodeDisp(3, 1), ops.nodeDisp(3, 3)))
        if remote and step == a.report_step:
            peer.tell(event="step", n=step)
    return course


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--port", type=int, required=True, help="of the gateway")
    p.add_argument("--steps", type=int, default=300)
    p.add_argument("--dt", type=float, default=0.01, help="in s")
    p.add_argument("--damping", type=float, default=0.8, help="of the masses, in 1/s")
    p.add_argument("--scheme", choices=sorted(SCHEMES), default="explicit")
    p.add_argument("--report-step", type=int, default=-1, help="report this step as it ends")
    a = p.parse_args()
    ops = peer.opensees()
    peer.tell(event="loaded", opensees=ops.version())
    hybrid = history(ops, a, True)
    ops.wipe()  # says goodbye to the gateway
    pure = history(ops, a, False)
    report = {}
    for name, found, own in zip(("sway", "rotation"), zip(*hybrid), zip(*pure)):
        peak = max(abs(value) for value in own)
        report[name] = max(abs(x - y) for x, y in zip(found, own)) / peak
        report[name + "_peak"] = peak
    peer.tell(event="result", **report)


if __name__ == "__main__":
    main()
