#!/usr/bin/env python3
"""OpenSees commands a force server through `genericClient`, then computes the same model all by itself.

    gusset serve specimen.toml --protocol openfresco --listen 127.0.0.1:8090
    client.py --port 8090 --material Steel01:60,8000,0.05

The model: floors of mass 10 on columns of 8000, shaken at the base. One DOF: the server is the spring between the
ground and the first of three floors. Two DOFs: it is two springs, from the ground to the first and to the second floor.
Prints JSON: the largest difference of a floor's displacement to OpenSees' own material, the largest displacement,
the median time of a step, and the iterations of Newton's method.
"""
import argparse
import math
import statistics
import time

import peer

SCHEMES = {
    "newton": (("Newmark", 0.5, 0.25), ("Newton",)),
    "initial": (("Newmark", 0.5, 0.25), ("ModifiedNewton", "-initial")),
    "alphaos": (("AlphaOS", 0.9), ("Linear",)),
    "explicit": (("NewmarkExplicit", 0.5), ("Linear",)),
}


def shake(i, dt):
    t = i * dt
    return 2.0 * math.sin(9.0 * t) * math.sin(1.7 * t) + 1.2 * math.sin(23.0 * t + 0.4)


def build(ops, a, remote):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.fix(1, 1)
    floors = [2, 3, 4]
    for node in floors:
        ops.node(node, float(node - 1))
        ops.mass(node, 10.0)
    ops.uniaxialMaterial("Elastic", 1, 8000.0)
    lab = [2] if a.dofs == 1 else [2, 3]
    for low, high in ((2, 3), (3, 4)):
        ops.element("twoNodeLink", high, low, high, "-mat", 1, "-dir", 1)
    if remote:
        dofs = [word for _ in lab for word in ("-dof", 1)]
        udp = ["-udp"] if a.udp else []
        ops.element("genericClient", 90, "-node", *lab, *dofs, "-server", a.port, "127.0.0.1", "-dataSize", a.size, *udp)
    else:
        for index, node in enumerate(lab):
            peer.material(ops, 10 + index, a.material)
            ops.element("twoNodeLink", 90 + index, 1, node, "-mat", 10 + index, "-dir", 1)
    ops.rayleigh(0.4, 0.0, 0.0, 0.0)
    ops.timeSeries("Path", 1, "-dt", a.dt, "-values", *[shake(i, a.dt) for i in range(a.steps + 2)])
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    integrator, algorithm = SCHEMES[a.scheme]
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", a.tolerance, 60)
    ops.algorithm(*algorithm)
    ops.integrator(*integrator)
    ops.analysis("Transient")
    return floors


def course(ops, a, remote):
    floors = build(ops, a, remote)
    disp, times, iterations = [], [], 0
    if remote:
        peer.tell(event="connected")
    for step in range(a.steps):
        begun = time.perf_counter()
        if ops.analyze(1, a.dt) != 0:
            raise SystemExit("step %d did not converge" % (step + 1))
        times.append(time.perf_counter() - begun)
        iterations += ops.testIter() if a.scheme == "newton" else 1
        disp.append([ops.nodeDisp(node, 1) for node in floors])
        if remote and step == a.pause_after:
            peer.tell(event="step", n=step)
    return disp, statistics.median(times), iterations


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--port", type=int, required=True)
    p.add_argument("--udp", action="store_true")
    p.add_argument("--dofs", type=int, choices=(1, 2), default=1)
    p.add_argument("--material", default="Steel01:60,8000,0.05", help="what the server is, as an OpenSees material")
    p.add_argument("--scheme", choices=sorted(SCHEMES), default="newton")
    p.add_argument("--steps", type=int, default=400)
    p.add_argument("--dt", type=float, default=0.01)
    p.add_argument("--tolerance", type=float, default=1e-13, help="of Newton's method, in m")
    p.add_argument("--size", type=int, default=256, help="doubles in a vector")
    p.add_argument("--pause-after", type=int, default=-1, help="report this step")
    a = p.parse_args()
    ops = peer.opensees()
    peer.tell(event="loaded", opensees=ops.version())
    remote, seconds, iterations = course(ops, a, True)
    ops.wipe()  # says goodbye to the server
    own, own_seconds, own_iterations = course(ops, a, False)
    pairs = [(x, y) for row, other in zip(remote, own) for x, y in zip(row, other)]
    peer.tell(event="result", difference=max(abs(x - y) for x, y in pairs), peak=max(abs(y) for _, y in pairs),
              step_ms=1e3 * seconds, own_step_ms=1e3 * own_seconds, iterations=iterations, own_iterations=own_iterations)


if __name__ == "__main__":
    main()
