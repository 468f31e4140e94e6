# Elastic frame with a viscous damper in a brace, and damping by the initial stiffness; N, m and s.
wipe
model BasicBuilder -ndm 2 -ndf 3
node 1 0. 0.
node 2 5. 0.
node 3 0. 3.
node 4 5. 3.
mass 3 2.e4 2.e4 0.
mass 4 2.e4 2.e4 0.
fix 1 1 1 1
fix 2 1 1 1
geomTransf Linear 1
element elasticBeamColumn 1 1 3 8.e-3 2.e11 6.e-5 1
element elasticBeamColumn 2 2 4 8.e-3 2.e11 6.e-5 1
element elasticBeamColumn 3 3 4 8.e-3 2.e11 9.e-5 1
uniaxialMaterial ViscousDamper 1 4.e7 2.e5 0.5
element twoNodeLink 4 1 4 -mat 1 -dir 1
rayleigh 0.3 0. 0.0008 0.
timeSeries Path 2 -dt 0.02 -filePath motion.txt -factor 9.81
pattern UniformExcitation 2 1 -accel 2
constraints Plain
numberer RCM
system BandGeneral
test NormDispIncr 1e-10 20
algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
analyze 1000 0.01
