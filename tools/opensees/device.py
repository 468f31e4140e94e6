#!/usr/bin/env python3
"""A portal frame with a device at its top, which is a specimen behind a gateway of Gusset: a spring, a yielding brace, a damper or relaxing rubber.

    device.py --port 8090 --device damper [--delay-ms 10] [--random]

OpenSees computes the frame in N, m and s with explicit steps, and commands the sway of the top. Before each step it waits, as a larger
model would. Then it computes frame and device alone, with steps a tenth as long. Prints JSON: the largest difference of the sway over its
largest value, and that value.
"""
import argparse
import math
import random
import time

import peer

MASS = 20e3                   # at each end of the beam, kg
E, COLUMN, BEAM = 2e11, 2.0e-5, 4.0e-4
HEIGHT, SPAN = 3.0, 6.0
AREA, INERTIA = 0.01, 2e4

# For the critical damping: 2 m ω of the sway.
FREQUENCY = 9.3               # rad/s, of the frame alone
CRITICAL = 2 * 2 * MASS * FREQUENCY


def ground(t):
    """Ground acceleration in m/s2. It begins at zero."""
    return math.sin(0.8 * t) * (1.2 * math.sin(9.0 * t) + 0.6 * math.sin(23.0 * t))


def material(ops, device):
    """The device as a uniaxial material."""
    if device == "elastic":
        ops.uniaxialMaterial("Elastic", 1, 1e6)
    elif device == "bilinear":
        ops.uniaxialMaterial("Steel01", 1, 20e3, 2e6, 0.05)
    elif device == "rubber":
        ops.uniaxialMaterial("Elastic", 2, 5e5)
        ops.uniaxialMaterial("ViscousDamper", 3, 5e5, 1.5e5, 1.0)
        ops.uniaxialMaterial("Parallel", 1, 2, 3)
    elif device == "damper":
        ops.uniaxialMaterial("Viscous", 1, 0.2 * CRITICAL, 1.0)
    else:
        ops.uniaxialMaterial("Viscous", 1, 25e3, 0.4)


def build(ops, a, remote):
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for node, x, y in ((1, 0.0, 0.0), (2, SPAN, 0.0), (3, 0.0, HEIGHT), (4, SPAN, HEIGHT), (5, 0.0, HEIGHT)):
        ops.node(node, x, y)
    for foot in (1, 2, 5):
        ops.fix(foot, 1, 1, 1)
    for top in (3, 4):
        ops.fix(top, 0, 1, 0)
        ops.mass(top, MASS, 0.0, INERTIA)
    ops.equalDOF(3, 4, 1)
    ops.geomTransf("Linear", 1)
    ops.element("elasticBeamColumn", 2, 2, 4, AREA, E, COLUMN, 1)
    ops.element("elasticBeamColumn", 3, 3, 4, AREA, E, BEAM, 1)
    ops.element("elasticBeamColumn", 4, 1, 3, AREA, E, COLUMN, 1)
    if remote:
        # The gateway must listen by now: without it OpenSees crashes.
        ops.element("genericClient", 1, "-node", 3, "-dof", 1, "-server", a.port, "127.0.0.1")
    else:
        material(ops, a.device)
        ops.element("zeroLength", 1, 5, 3, "-mat", 1, "-dir", 1)
    ops.rayleigh(0.2, 0.0, 0.0, 0.0)
    values = [ground(i * a.dt) for i in range(a.steps + 2)]
    ops.timeSeries("Path", 1, "-dt", a.dt, "-values", *values)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-12, 20)
    ops.algorithm("Linear")
    ops.integrator("NewmarkExplicit", 0.5)
    ops.analysis("Transient")


def advance(ops, a, step):
    """The sway after a step."""
    if ops.analyze(1, a.dt) != 0:
        raise SystemExit("step %d failed" % (step + 1))
    return ops.nodeDisp(3, 1)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--port", type=int, required=True, help="of the gateway")
    p.add_argument("--device", choices=("elastic", "bilinear", "damper", "power", "rubber"), default="damper")
    p.add_argument("--steps", type=int, default=300)
    p.add_argument("--dt", type=float, default=0.01, help="in s")
    p.add_argument("--delay-ms", type=float, default=0.0, help="before each step")
    p.add_argument("--random", action="store_true", help="the delay is between 0 and twice this")
    a = p.parse_args()
    ops = peer.opensees()
    peer.tell(event="loaded", opensees=ops.version())
    chance = random.Random(1)
    build(ops, a, True)
    hybrid = []
    for step in range(a.steps):
        time.sleep(a.delay_ms * 1e-3 * (2 * chance.random() if a.random else 1))
        hybrid.append(advance(ops, a, step))
    ops.wipe()  # says goodbye to the gateway
    build(ops, a, False)
    pure = [advance(ops, a, step) for step in range(a.steps)]
    peak = max(abs(x) for x in pure)
    peer.tell(event="result", sway=max(abs(x - y) for x, y in zip(hybrid, pure)) / peak, sway_peak=peak)


if __name__ == "__main__":
    main()
