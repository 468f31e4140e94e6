# Steel frame whose hinges lose strength, with a leaning column, in kip, in and s.
import math

import openseespy.opensees as ops

ops.wipe()
ops.model("basic", "-ndm", 2, "-ndf", 3)
H, W, E, n = 156.0, 240.0, 29000.0, 10.0
g = 386.1
ops.node(11, 0.0, 0.0)
ops.node(12, W, 0.0)
ops.node(13, 2 * W, 0.0)
ops.node(21, 0.0, H)
ops.node(22, W, H)
ops.node(23, 2 * W, H)
ops.fix(11, 1, 1, 1)
ops.fix(12, 1, 1, 1)
ops.fix(13, 1, 1, 0)
for node, joint in ((115, 11), (125, 12), (213, 21), (224, 22), (236, 23)):
    ops.node(node, *ops.nodeCoord(joint))
for node in (21, 22):
    ops.mass(node, 900.0 / g, 1e-8, 1e-8)
ops.geomTransf("PDelta", 1)
ops.geomTransf("Linear", 2)
Ic, Ib = 3000.0, 2400.0
for tag, i, j in ((1, 115, 21), (2, 125, 22)):
    ops.element("elasticBeamColumn", tag, i, j, 40.0, E, (n + 1) / n * Ic, 1)
ops.element("elasticBeamColumn", 3, 213, 224, 30.0, E, (n + 1) / n * Ib, 2)
ops.uniaxialMaterial("Elastic", 900, E)
ops.element("Truss", 4, 22, 23, 1000.0, 900)
ops.element("elasticBeamColumn", 5, 13, 236, 1000.0, E, 1.0e5, 1)


def hinge(tag, i, j, stiffness, strength):
    rise = 0.03 * strength / 0.025 / stiffness
    ops.uniaxialMaterial(
        "IMKBilin", tag, stiffness, *(2 * [0.025, 0.3, 0.4, strength, 1 + rise * stiffness * 0.025 / strength, 0.4]),
        1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
    )
    ops.element("zeroLength", tag, i, j, "-mat", tag, "-dir", 6)
    ops.equalDOF(i, j, 1, 2)


hinge(101, 11, 115, n * 6 * E * Ic / H, 9000.0)
hinge(102, 12, 125, n * 6 * E * Ic / H, 9000.0)
hinge(103, 21, 213, n * 6 * E * Ib / W, 7000.0)
hinge(104, 22, 224, n * 6 * E * Ib / W, 7000.0)
ops.uniaxialMaterial("Elastic", 905, 1e-3)
ops.element("zeroLength", 105, 23, 236, "-mat", 905, "-dir", 6)
ops.equalDOF(23, 236, 1, 2)
ops.timeSeries("Linear", 1)
ops.pattern("Plain", 1, 1)
for node, force in ((21, 100.0), (22, 100.0), (23, 300.0)):
    ops.load(node, 0.0, -force, 0.0)
ops.constraints("Transformation")
ops.numberer("RCM")
ops.system("BandGeneral")
ops.test("NormDispIncr", 1e-10, 20)
ops.algorithm("Newton")
ops.integrator("LoadControl", 0.1)
ops.analysis("Static")
ops.analyze(10)
ops.loadConst("-time", 0.0)
omega = math.sqrt(ops.eigen(1)[0])
b = 2 * 0.02 / omega
ops.region(1, "-eleRange", 1, 3, "-rayleigh", 0.0, 0.0, b * (n + 1) / n, 0.0)
ops.region(2, "-node", 21, 22, "-rayleigh", 0.1, 0.0, 0.0, 0.0)
ops.timeSeries("Path", 2, "-dt", 0.02, "-filePath", "motion.txt", "-factor", g)
ops.pattern("UniformExcitation", 2, 1, "-accel", 2)
ops.wipeAnalysis()
ops.constraints("Transformation")
ops.numberer("RCM")
ops.system("BandGeneral")
ops.test("NormDispIncr", 1e-8, 50)
ops.algorithm("Newton")
ops.integrator("Newmark", 0.5, 0.25)
ops.analysis("Transient")
ops.analyze(2000, 0.005)
