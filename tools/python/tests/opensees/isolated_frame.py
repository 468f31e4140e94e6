"""Frame of one storey on two isolators of Steel01, and a moat spring, in kN, m and s."""
import openseespy.opensees as ops


def build():
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for side, x in enumerate((0.0, 7.0)):
        ops.node(10 + side, x, 0.0)
        ops.fix(10 + side, 1, 1, 1)
        ops.node(20 + side, x, 0.0, "-mass", 40.0, 40.0, 0.0)
        ops.node(30 + side, x, 3.2)
        ops.mass(30 + side, 30.0, 30.0, 0.0)
    ops.uniaxialMaterial("Steel01", 1, 20.0, 5000.0, 0.08)
    ops.uniaxialMaterial("Elastic", 2, 2.0e6)
    ops.uniaxialMaterial("Elastic", 3, 0.0, 30.0)
    ops.uniaxialMaterial("Parallel", 4, 1, 3)
    for side in (0, 1):
        ops.element("zeroLength", 1 + side, 10 + side, 20 + side, "-mat", 4, 2, "-dir", 1, 2)
    ops.geomTransf("Linear", 1)
    for tag, (i, j) in enumerate(((20, 21), (20, 30), (21, 31), (30, 31)), 3):
        ops.element("elasticBeamColumn", tag, i, j, 0.12, 3.0e7, 2.0e-3, 1)
    ops.timeSeries("Constant", 1)
    ops.pattern("Plain", 1, 1)
    for node in (20, 21, 30, 31):
        ops.load(node, 0.0, -300.0, 0.0)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("ProfileSPD")
    ops.test("EnergyIncr", 1e-12, 10)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    assert ops.analyze(1) == 0
    ops.setTime(0.0)


def shake():
    ops.rayleigh(0.2, 0.0, 0.0005, 0.0)
    with open("motion.txt") as file:
        values = [9.81 * float(line) for line in file]
    ops.timeSeries("Path", 5, "-dt", 0.02, "-values", *values)
    ops.pattern("UniformExcitation", 5, 1, "-accel", 5)
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("ProfileSPD")
    ops.test("EnergyIncr", 1e-12, 10)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    return ops.analyze(2000, 0.005)


if __name__ == "__main__":
    build()
    print("frequencies", ops.eigen("-fullGenLapack", 2))
    shake()
