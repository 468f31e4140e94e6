# Portal frame, kip, in, s. Elastic, P-Delta, gravity, then ground motion.
import math
import openseespy.opensees as ops
ops.wipe()
ops.model('basic', '-ndm', 2, '-ndf', 3)
W, H = 288.0, 144.0
ops.node(1, 0., 0.); ops.node(2, W, 0.); ops.node(3, 0., H); ops.node(4, W, H)
ops.fix(1, 1, 1, 1); ops.fix(2, 1, 1, 0)
m = 100.0/386.4
ops.mass(3, m, m, 0.0); ops.mass(4, m, 1e-9, 1e-9)
ops.geomTransf('PDelta', 1); ops.geomTransf('Linear', 2)
E = 29000.
ops.element('elasticBeamColumn', 1, 1, 3, 20., E, 700., 1)
ops.element('elasticBeamColumn', 2, 2, 4, 20., E, 700., 1)
ops.element('elasticBeamColumn', 3, 3, 4, 15., E, 1400., 2)
ops.timeSeries('Linear', 1); ops.pattern('Plain', 1, 1)
ops.load(3, 0., -100., 0.); ops.load(4, 0., -100., 0.)
ops.eleLoad('-ele', 3, '-type', '-beamUniform', -0.1)
ops.constraints('Plain'); ops.numberer('RCM'); ops.system('BandGeneral'); ops.test('NormDispIncr', 1e-8, 10)
ops.algorithm('Newton'); ops.integrator('LoadControl', 0.1); ops.analysis('Static'); ops.analyze(10)
ops.loadConst('-time', 0.0)
w = math.sqrt(ops.eigen('-fullGenLapack', 1)[0])
xi = 0.03
ops.rayleigh(0.0, 0.0, 2*xi/w, 0.0)
dt = 0.01
acc = [0.3*386.4*math.sin(2*math.pi*1.5*i*dt)*math.exp(-0.2*i*dt) for i in range(800)]
ops.timeSeries('Path', 2, '-dt', dt, '-values', *acc)
ops.pattern('UniformExcitation', 2, 1, '-accel', 2)
ops.recorder('Node', '-file', 'disp.out', '-time', '-node', 3, '-dof', 1, 'disp')
ops.wipeAnalysis()
ops.constraints('Plain'); ops.numberer('RCM'); ops.system('BandGeneral'); ops.test('NormDispIncr', 1e-10, 10)
ops.algorithm('Newton'); ops.integrator('Newmark', 0.5, 0.25); ops.analysis('Transient')
ops.analyze(800, dt)
