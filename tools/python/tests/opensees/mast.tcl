# Slender mast with corotational geometry, in N, mm and s.
wipe
model basic -ndm 2 -ndf 3
for {set i 0} {$i <= 4} {incr i} { node [expr $i+1] 0 [expr 1500.*$i] }
fix 1 1 1 1
for {set i 2} {$i <= 5} {incr i} { mass $i 0.2 0. 0. }
geomTransf Corotational 1
for {set i 1} {$i <= 4} {incr i} { element elasticBeamColumn $i $i [expr $i+1] 3000. 2.e5 4.e6 1 }
pattern Plain 1 Linear { load 5 0 -6000. 0 }
constraints Plain
numberer Plain
system BandGeneral
test NormDispIncr 1e-8 30
algorithm Newton
integrator LoadControl 0.1
analysis Static
analyze 10
loadConst -time 0
rayleigh 0.1 0 0 0
pattern UniformExcitation 2 1 -accel "Series -dt 0.02 -filePath motion.txt -factor 3000."
wipeAnalysis
constraints Plain
numberer Plain
system BandGeneral
test NormDispIncr 1e-8 30
algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
analyze 1000 0.01
