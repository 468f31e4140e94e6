#!/usr/bin/env python3
"""Horizontal forces of an OpenSees bearing along a path in two directions.

    bearing.py elastomericBearingPlasticity:1.1e6,1e3,0.09,0,1 < PATH
    bearing.py elastomericBearingBoucWen:1.1e6,1e3,0.09,0,1,2,0.5,0.5 < PATH
    bearing.py singleFPBearing:0.05,2.0,1e6,2e4 < PATH        (friction, radius, stiffness, axial force)

Standard input is a JSON list of [x, y]. Prints one line of JSON: {"forces": [[x, y], ...]}
"""

import json
import sys

import peer


def build(ops, text):
    """Makes the bearing between two nodes at one place, with its axis upwards. Returns its axial force."""
    kind, _, rest = text.partition(":")
    numbers = [float(word) for word in rest.split(",")]
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.node(1, 0.0, 0.0, 0.0)
    ops.node(2, 0.0, 0.0, 0.0)
    ops.fix(1, 1, 1, 1, 1, 1, 1)
    ops.fix(2, 0, 0, 0, 1, 1, 1)
    ops.uniaxialMaterial("Elastic", 1, 1e9)
    materials = ["-P", 1, "-T", 1, "-My", 1, "-Mz", 1, "-orient", 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    if kind == "singleFPBearing":
        friction, radius, stiffness, axial = numbers
        ops.frictionModel("Coulomb", 1, friction)
        ops.element(kind, 1, 1, 2, 1, radius, stiffness, *materials)
        return axial
    ops.element(kind, 1, 1, 2, *numbers, *materials)
    return 0.0


def analysis(ops):
    """A static analysis in steps of one unit of time."""
    ops.constraints("Penalty", 1e13, 1e13)
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-14, 50)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")


def main():
    ops = peer.opensees()
    axial = build(ops, sys.argv[1])
    path = [[0.0, 0.0], [0.0, 0.0], *json.load(sys.stdin)]
    ops.timeSeries("Path", 1, "-dt", 1.0, "-values", 0.0, *[1.0] * (len(path) + 1))
    ops.pattern("Plain", 1, 1)
    ops.load(2, 0.0, 0.0, -axial, 0.0, 0.0, 0.0)
    for direction in (0, 1):
        values = [place[direction] for place in path]
        ops.timeSeries("Path", 2 + direction, "-dt", 1.0, "-values", *values, values[-1])
        ops.pattern("Plain", 2 + direction, 2 + direction)
        ops.sp(2, 1 + direction, 1.0)
    analysis(ops)
    forces = []
    for _ in path[1:]:
        if ops.analyze(1) != 0:
            raise SystemExit("OpenSees finds no equilibrium")
        forces.append(ops.eleForce(1)[6:8])
    peer.tell(forces=forces[1:])


main()
