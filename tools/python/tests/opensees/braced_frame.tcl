# Braced frame with pinned beams in kN, m and s; braces of Steel02.
wipe
model BasicBuilder -ndm 2 -ndf 3
node 1 0 0
node 2 6 0
node 3 0 3.5 -mass 30 30 0
node 4 6 3.5 -mass 30 30 0
node 5 0 7 -mass 25 25 0
node 6 6 7 -mass 25 25 0
fixY 0.0 1 1 0
set E 2.0e8
geomTransf Linear 1
section Elastic 1 $E 0.0149 2.517e-4
section Elastic 2 $E 0.0078 1.627e-4
foreach {tag i j} {1 1 3 2 2 4 3 3 5 4 4 6} { element elasticBeamColumn $tag $i $j 1 1 }
foreach {tag i j} {5 3 4 6 5 6} { element elasticBeamColumn $tag $i $j 2 1 -release 3 }
uniaxialMaterial Steel02 7 235e3 $E 0.02 18 0.925 0.15
element Truss 7 1 4 0.0016 7
element Truss 8 3 6 0.0012 7
timeSeries Linear 1
pattern Plain 1 1 {
    foreach n {3 4 5 6} { load $n 0 -250 0 }
}
constraints Plain
numberer RCM
system BandGeneral
test NormDispIncr 1e-8 20
algorithm Newton
integrator LoadControl 0.1
analysis Static
analyze 10
loadConst -time 0
rayleigh 0.4 0 0 0
set g 9.81
pattern UniformExcitation 2 1 -accel "Path -dt 0.02 -filePath motion.txt -factor $g"
wipeAnalysis
constraints Plain
numberer RCM
system BandGeneral
test NormDispIncr 1e-10 20
algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
analyze 500 0.02
