#!/usr/bin/env python3
"""OpenSees plays the specimen: an `adapter`, `actuator` or `corotActuator` listens for a controller's displacements.

    specimen.py --port 44000 --material Steel01:60,8000,0.05
    gusset run test.toml        # [specimen.link] protocol = "openfresco-adapter", address = "127.0.0.1:44000"

One DOF: a spring of the material; two (adapter only): one spring from the ground to each DOF. Prints JSON lines: each
step with the displacement reached and the spring's force. OpenSees ends the process itself when the controller says
goodbye. The element is a stiff spring of --stiffness between the command and the specimen: it follows up to k / kb and
its force is good to about kb · 1e-16 · d.
"""
import argparse

import peer


def build(ops, a):
    plane = a.kind != "adapter"
    ops.model("basic", "-ndm", 2 if plane else 1, "-ndf", 2 if plane else 1)
    udp = ["-udp"] if a.udp else []
    if plane:
        # The actuator lies along x and is 100 long.
        ops.node(1, 0.0, 0.0)
        ops.node(2, 1.0, 0.0)
        ops.node(3, -99.0, 0.0)
        ops.fix(1, 1, 1)
        ops.fix(2, 0, 1)
        ops.fix(3, 1, 1)
        nodes = [2]
    else:
        ops.node(1, 0.0)
        ops.fix(1, 1)
        nodes = list(range(2, 2 + a.dofs))
        for node in nodes:
            ops.node(node, float(node))
    for node in nodes:
        peer.material(ops, node, a.material)
        ops.element("twoNodeLink", node, 1, node, "-mat", node, "-dir", 1)
    peer.tell(event="listening")
    if plane:
        ops.element(a.kind, 90, 3, 2, 100.0 * a.stiffness, a.port, *udp)
    else:
        n = a.dofs
        dofs = [word for _ in nodes for word in ("-dof", 1)]
        rows = [a.stiffness if i == j else 0.0 for i in range(n) for j in range(n)]
        ops.element("adapter", 90, "-node", *nodes, *dofs, "-stif", *rows, a.port, *udp)
    return nodes


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--port", type=int, required=True)
    p.add_argument("--udp", action="store_true")
    p.add_argument("--kind", choices=("adapter", "actuator", "corotActuator"), default="adapter")
    p.add_argument("--dofs", type=int, choices=(1, 2), default=1)
    p.add_argument("--material", default="Steel01:60,8000,0.05")
    p.add_argument("--stiffness", type=float, default=8e11, help="kb: 1e8 times the material's; 1e6 for corotActuator")
    a = p.parse_args()
    ops = peer.opensees()
    nodes = build(ops, a)  # returns when the controller has connected
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-14, 50, 0, 2)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    while ops.analyze(1) == 0:
        forces = [ops.eleForce(node) for node in nodes]
        peer.tell(event="step", disp=[ops.nodeDisp(node, 1) for node in nodes],
                  force=[force[len(force) // 2] for force in forces])
    peer.tell(event="failed")


if __name__ == "__main__":
    main()
