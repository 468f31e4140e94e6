# Bent of a bridge: two round columns of displacement-based fibre elements, in kip, in and s.
wipe
model basic -ndm 2 -ndf 3
set g 386.4
set H 240.0
set W 300.0
for {set c 0} {$c < 2} {incr c} {
    for {set k 0} {$k <= 4} {incr k} {
        node [expr 10*$c+$k+1] [expr $c*$W] [expr $k*$H/4]
    }
}
fix 1 1 1 1
fix 11 1 1 1
node 100 [expr $W/2] $H
mass 5 1.0 1.0 0
mass 15 1.0 1.0 0
mass 100 1.5 1.5 0
uniaxialMaterial Concrete02 1 -5.5 -0.0035 -4.4 -0.015 0.1 0.5 250.
uniaxialMaterial Concrete02 2 -4.0 -0.002 -0.8 -0.006 0.1 0.4 200.
uniaxialMaterial Steel02 3 68.0 29000. 0.01 18.5 0.925 0.15
section Fiber 1 {
    patch circ 1 8 4 0 0 0 21 0 360
    patch circ 2 8 1 0 0 21 24 0 360
    layer circ 3 12 1.56 0 0 20.5
}
geomTransf PDelta 1
geomTransf Linear 2
for {set c 0} {$c < 2} {incr c} {
    for {set k 1} {$k <= 4} {incr k} {
        element dispBeamColumn [expr 10*$c+$k] [expr 10*$c+$k] [expr 10*$c+$k+1] 4 1 1
    }
}
element elasticBeamColumn 101 5 100 2000. 4000. 800000. 2
element elasticBeamColumn 102 100 15 2000. 4000. 800000. 2
pattern Plain 1 "Linear" {
    load 5 0 -300 0
    load 15 0 -300 0
    load 100 0 -400 0
}
constraints Plain; numberer RCM; system BandGeneral
test NormDispIncr 1e-8 50; algorithm Newton
integrator LoadControl 0.1
analysis Static
analyze 10
loadConst -time 0.0
rayleigh 0.25 0 0 0
set accel "Series -dt 0.02 -filePath motion.txt -factor [expr 0.8*$g]"
pattern UniformExcitation 2 1 -accel $accel
wipeAnalysis
constraints Plain; numberer RCM; system BandGeneral
test NormDispIncr 1e-9 50; algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
analyze 1000 0.01
