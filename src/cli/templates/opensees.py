#!/usr/bin/env python3
"""An OpenSees model of three storeys. Its first storey is a specimen that Gusset serves.

First terminal:   gusset serve opensees.toml
Second terminal:  python3 opensees.py [PORT]

The script prints the largest displacement of each floor. Units are N, m, kg and s.
"""
import math
import sys

import openseespy.opensees as ops

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 8090
STEP = 0.01  # time step, s
STEPS = 1000  # length of the analysis: 10 s
FLOORS = [2, 3, 4]  # nodes of the floors; node 1 is the ground

# Three floors above the ground, each with one degree of freedom.
ops.wipe()
ops.model("basic", "-ndm", 1, "-ndf", 1)
ops.node(1, 0.0)
ops.fix(1, 1)
for node in FLOORS:
    ops.node(node, float(node - 1))
    ops.mass(node, 10e3)  # kg

# The numerical substructure: storeys 2 and 3, 8 MN/m each.
ops.uniaxialMaterial("Elastic", 1, 8e6)
for below, above in ((2, 3), (3, 4)):
    ops.element("twoNodeLink", above, below, above, "-mat", 1, "-dir", 1)

# The physical substructure: storey 1, which Gusset serves. It sees the displacement of node 2.
ops.element("genericClient", 90, "-node", 2, "-dof", 1, "-server", PORT, "127.0.0.1")

# Damping proportional to mass, and an acceleration of the ground in m/s².
ops.rayleigh(0.4, 0.0, 0.0, 0.0)
ground = [1.5 * math.sin(9.0 * i * STEP) * math.sin(0.3 * i * STEP) for i in range(STEPS + 2)]
ops.timeSeries("Path", 1, "-dt", STEP, "-values", *ground)
ops.pattern("UniformExcitation", 1, 1, "-accel", 1)

# NewmarkExplicit never takes a step back. A real specimen requires such a method.
ops.constraints("Plain")
ops.numberer("Plain")
ops.system("FullGeneral")
ops.algorithm("Linear")
ops.integrator("NewmarkExplicit", 0.5)
ops.analysis("Transient")

peak = {node: 0.0 for node in FLOORS}
for step in range(STEPS):
    if ops.analyze(1, STEP) != 0:
        sys.exit(f"step {step + 1} failed")
    for node in FLOORS:
        peak[node] = max(peak[node], abs(ops.nodeDisp(node, 1)))
for node in FLOORS:
    print(f"floor {node - 1}: largest displacement {1e3 * peak[node]:.2f} mm")

ops.wipe()  # ends the session with the server
