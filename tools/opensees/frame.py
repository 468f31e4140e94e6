#!/usr/bin/env python3
"""The plane frame of a test file in OpenSees: its displacements under the static loads and its frequencies there.

Usage: frame.py TEST.toml
Prints one line of JSON: {"disp": {node: [x, y, rz]}, "frequencies_rad_per_s": [...]}
"""

import math
import sys
import tomllib

import peer

DIRECTIONS = {"x": 1, "y": 2, "rz": 3}
# OpenSees needs twice as many directions with mass.
MODES = 3

ops = peer.opensees()


def rigidity(section):
    """Young's modulus, area and second moment of area."""
    (kind, s), = section.items()
    if kind == "elastic":
        return s["young_pa"], s["area_m2"], s["inertia_m4"]
    if kind == "rectangle":
        b, h = s["width_m"], s["depth_m"]
        return s["young_pa"], b * h, b * h**3 / 12
    b, h, f, w = s["flange_width_m"], s["depth_m"], s["flange_thickness_m"], s["web_thickness_m"]
    clear = h - 2 * f
    return s["young_pa"], b * h - (b - w) * clear, (b * h**3 - (b - w) * clear**3) / 12


def build(frame):
    """Builds the model; returns the tag of each node."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    tags = {}
    for tag, node in enumerate(frame["node"], 1):
        tags[node["name"]] = tag
        ops.node(tag, *map(float, node["at_m"]))
        fixed = node.get("fixed", [])
        ops.fix(tag, *(int(name in fixed) for name in DIRECTIONS))
        mass = float(node.get("mass_kg", 0))
        ops.mass(tag, mass, mass, float(node.get("rotary_mass_kg_m2", 0)))
    for tag, member in enumerate(frame["member"], 1):
        offsets = [float(v) for key in ("offset_start_m", "offset_end_m") for v in member.get(key, [0, 0])]
        kind = "PDelta" if member.get("p_delta") else "Linear"
        ops.geomTransf(kind, tag, "-jntOffset", *offsets)
        young, area, inertia = rigidity(frame["section"][member["section"]])
        start, end = (tags[name] for name in member["nodes"])
        release = sum({"start": 1, "end": 2}[side] for side in member.get("release", []))
        ops.element("elasticBeamColumn", tag, start, end, area, young, inertia, tag, "-release", release)
    for constraint in frame.get("constraint", []):
        (kind, c), = constraint.items()
        for name in c["nodes"]:
            if kind == "rigid":
                ops.rigidLink("beam", tags[c["master"]], tags[name])
            else:
                along = c["directions"] if kind == "equal" else ["x"]
                ops.equalDOF(tags[c["master"]], tags[name], *(DIRECTIONS[d] for d in along))
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    for load in frame.get("load", []):
        ops.load(tags[load["node"]], *(float(load.get(key, 0)) for key in ("x_n", "y_n", "rz_n_m")))
    return tags


def main():
    with open(sys.argv[1], "rb") as file:
        frame = tomllib.load(file)["structure"]["frame"]
    tags = build(frame)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", 1e-14, 50)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    if ops.analyze(10) != 0:
        sys.exit("no equilibrium under the static loads")
    disp = {name: ops.nodeDisp(tag) for name, tag in tags.items()}
    frequencies = [math.sqrt(value) for value in ops.eigen("-genBandArpack", MODES)]
    peer.tell(disp=disp, frequencies_rad_per_s=frequencies)


main()
