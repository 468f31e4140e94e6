# Portal whose column bases are hinges with different strengths in both directions; kN, m and s.
import openseespy.opensees as ops

ops.wipe()
ops.model("basic", "-ndm", 2, "-ndf", 3)
for tag, x, y in ((1, 0.0, 0.0), (2, 6.0, 0.0), (3, 0.0, 3.5), (4, 6.0, 3.5), (11, 0.0, 0.0), (12, 6.0, 0.0), (24, 6.0, 3.5)):
    ops.node(tag, x, y)
ops.fix(1, 1, 1, 1)
ops.fix(2, 1, 1, 1)
for tag in (3, 4):
    ops.mass(tag, 40.0, 40.0, 10.0)
ops.geomTransf("Linear", 1)
ops.element("elasticBeamColumn", 1, 11, 3, 0.015, 2.0e8, 2.5e-4, 1)
ops.element("elasticBeamColumn", 2, 12, 4, 0.015, 2.0e8, 2.5e-4, 1)
ops.element("elasticBeamColumn", 3, 3, 24, 0.01, 2.0e8, 3.0e-4, 1)
shape = (0.03, 0.2, 0.4), (1.05, 0.3)
for tag, strength in ((7, (200.0, 90.0)), (8, (150.0, 60.0))):
    numbers = []
    for each in strength:
        numbers += [*shape[0], each, *shape[1]]
    ops.uniaxialMaterial("IMKBilin", tag, 4.0e5, *numbers, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0)
for tag, nodes, material in ((101, (1, 11), 7), (102, (12, 2), 7), (103, (24, 4), 8)):
    ops.element("zeroLength", tag, *nodes, "-mat", material, "-dir", 6)
for joint, node in ((1, 11), (2, 12), (4, 24)):
    ops.equalDOF(joint, node, 1, 2)
ops.rayleigh(0.4, 0.0, 0.0, 0.0)
ops.timeSeries("Path", 2, "-dt", 0.02, "-filePath", "motion.txt", "-factor", 9.81)
ops.pattern("UniformExcitation", 2, 1, "-accel", 2)
ops.constraints("Transformation")
ops.numberer("RCM")
ops.system("BandGeneral")
ops.test("NormDispIncr", 1e-8, 50)
ops.algorithm("Newton")
ops.integrator("Newmark", 0.5, 0.25)
ops.analysis("Transient")
ops.analyze(500, 0.02)
