#!/usr/bin/env python3
"""OpenSees integrates a small building by a scheme of its own; prints the course as JSON, for comparison with ours.

    integrate.py --scheme KRAlphaExplicit:0.8 --storey Steel01:60,8000,0.05 --storey Elastic:6000 --dashpot 12 --dashpot 9

One mass of 10 per storey, from the ground up; the material of every storey as NAME:PARAMETERS, a dashpot beside it. Forces
on all floors share one history, given as JSON on standard input, one value per step from t = 0; it starts at zero, so that
OpenSees, which does not look for the acceleration at the start, starts in equilibrium.
"""
import argparse
import json
import sys

import peer

MASS = 10.0


def build(ops, a, force):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.fix(1, 1)
    dashpots = a.dashpot + [0.0] * (len(a.storey) - len(a.dashpot))
    for floor, (material, dashpot) in enumerate(zip(a.storey, dashpots), start=1):
        ops.node(floor + 1, 0.0)
        ops.mass(floor + 1, MASS)
        peer.material(ops, floor, material)
        ops.element("zeroLength", floor, floor, floor + 1, "-mat", floor, "-dir", 1, "-doRayleigh", 0)
        if dashpot > 0.0:
            ops.uniaxialMaterial("Elastic", 100 + floor, 0.0, dashpot)
            ops.element("zeroLength", 100 + floor, floor, floor + 1, "-mat", 100 + floor, "-dir", 1, "-doRayleigh", 0)
    ops.timeSeries("Path", 1, "-dt", a.dt, "-values", *force)
    ops.pattern("Plain", 1, 1)
    for floor in range(1, len(a.storey) + 1):
        ops.load(floor + 1, float(floor))
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-14, 100)
    name, _, parameters = a.scheme.partition(":")
    implicit = name == "Newmark"
    ops.algorithm("Newton" if implicit else "Linear")
    ops.integrator(name, *[float(word) for word in parameters.split(",") if word])
    ops.analysis("Transient")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--scheme", required=True, help="NAME:PARAMETERS of an OpenSees integrator")
    p.add_argument("--storey", action="append", required=True, help="NAME:PARAMETERS of a uniaxial material")
    p.add_argument("--dashpot", action="append", type=float, default=[], help="N s/m beside the storey")
    p.add_argument("--dt", type=float, required=True)
    a = p.parse_args()
    force = json.load(sys.stdin)
    ops = peer.opensees()
    # One value beyond the end: a path that ends is zero from there on.
    build(ops, a, force + force[-1:])
    floors = range(2, len(a.storey) + 2)
    zero = [0.0] * len(a.storey)
    disp, vel, accel = [zero], [zero], [zero]
    for step in range(1, len(force)):
        if ops.analyze(1, a.dt) != 0:
            raise SystemExit("step %d failed" % step)
        disp.append([ops.nodeDisp(node, 1) for node in floors])
        vel.append([ops.nodeVel(node, 1) for node in floors])
        accel.append([ops.nodeAccel(node, 1) for node in floors])
    peer.tell(event="course", scheme=a.scheme, disp=disp, vel=vel, accel=accel)


if __name__ == "__main__":
    main()
