# Steel frame of I-shaped fibre sections, two storeys, in N, mm and s; the old form of the elements.
wipe
model BasicBuilder -ndm 2 -ndf 3
source shapes.tcl
node 1 0 0
node 2 5000 0
node 3 0 3500
node 4 5000 3500
node 5 0 6500
node 6 5000 6500
fix 1 1 1 1
fix 2 1 1 1
foreach n {3 4} { mass $n 12. 12. 0. }
foreach n {5 6} { mass $n 9. 9. 0. }
uniaxialMaterial Steel02 1 275. 2.05e5 0.01 20 0.925 0.15
IShape 1 1 240. 240. 17. 10.
IShape 2 1 300. 150. 10.7 7.1
geomTransf PDelta 1
geomTransf Linear 2
element nonlinearBeamColumn 1 1 3 5 1 1
element nonlinearBeamColumn 2 2 4 5 1 1
element nonlinearBeamColumn 3 3 5 5 1 1
element nonlinearBeamColumn 4 4 6 5 1 1
element forceBeamColumn 5 3 4 2 "Lobatto 2 5"
element forceBeamColumn 6 5 6 2 Lobatto 2 5
pattern Plain 1 Linear {
    load 3 0 -120000 0
    load 4 0 -120000 0
    load 5 0 -90000 0
    load 6 0 -90000 0
}
constraints Plain
numberer RCM
system BandGeneral
test NormDispIncr 1e-8 30
algorithm Newton
integrator LoadControl 0.1
analysis Static
analyze 10
loadConst -time 0
rayleigh 0.3 0 0 0
pattern UniformExcitation 2 1 -accel "Series -dt 0.02 -filePath motion.txt -factor 8000."
wipeAnalysis
constraints Plain
numberer RCM
system BandGeneral
test NormDispIncr 1e-8 30
algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
analyze 1000 0.01
