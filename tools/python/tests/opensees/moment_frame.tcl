# Two-storey moment frame with hinges of Bilin at beam ends and column bases; kN, mm, s.
wipe
model BasicBuilder -ndm 2 -ndf 3
set LB 6000.0; set H1 4000.0; set H2 3500.0
proc rotSpring {tag i j K My} {
    uniaxialMaterial Steel01 $tag $My $K 0.02
    element zeroLength $tag $i $j -mat $tag -dir 6
    equalDOF $i $j 1 2
}
node 11 0 0; node 12 $LB 0
node 21 0 $H1; node 22 $LB $H1
node 31 0 [expr $H1+$H2]; node 32 $LB [expr $H1+$H2]
fix 11 1 1 1
fix 12 1 1 1
# joints of hinges
node 111 0 0; node 121 $LB 0
node 213 0 $H1; node 224 $LB $H1
node 313 0 [expr $H1+$H2]; node 324 $LB [expr $H1+$H2]
set m 0.03
foreach n {21 22} { mass $n $m 1e-9 1e-9 }
mass 31 $m 0 0
mass 32 $m 0 0
set E 200.0
geomTransf PDelta 1
geomTransf Linear 2
set n 10.0
set Ic 2.5e8; set Ib 3.0e8
set Icm [expr $Ic*($n+1)/$n]
set Ibm [expr $Ib*($n+1)/$n]
element elasticBeamColumn 1 111 21 15000. $E $Icm 1
element elasticBeamColumn 2 121 22 15000. $E $Icm 1
element elasticBeamColumn 3 21 31 15000. $E $Ic 1
element elasticBeamColumn 4 22 32 15000. $E $Ic 1
element elasticBeamColumn 5 213 224 10000. $E $Ibm 2
element elasticBeamColumn 6 313 324 10000. $E $Ibm 2
set Kc [expr $n*6*$E*$Icm/$H1]
set Kb [expr $n*6*$E*$Ibm/$LB]
rotSpring 101 11 111 $Kc 3.0e5
rotSpring 102 12 121 $Kc 3.0e5
rotSpring 103 21 213 $Kb 2.0e5
rotSpring 104 22 224 $Kb 2.0e5
rotSpring 105 31 313 $Kb 2.0e5
rotSpring 106 32 324 $Kb 2.0e5
pattern Plain 1 Linear {
    load 21 0 -200 0
    load 22 0 -200 0
    load 31 0 -150 0
    load 32 0 -150 0
}
constraints Transformation
numberer RCM
system BandGeneral
test NormDispIncr 1e-8 20
algorithm Newton
integrator LoadControl 0.1
analysis Static
analyze 10
loadConst -time 0.0
puts "gravity done"
set lambda [eigen -fullGenLapack 2]
set w1 [expr sqrt([lindex $lambda 0])]
set a0 [expr 2*0.02*$w1]
rayleigh $a0 0.0 0.0 0.0
pattern UniformExcitation 2 1 -accel "Series -dt 0.02 -filePath motion.txt -factor 9810."
recorder Node -file out.txt -time -node 21 31 -dof 1 disp
wipeAnalysis
constraints Transformation
numberer RCM
system BandGeneral
test NormDispIncr 1e-10 50
algorithm Newton
integrator Newmark 0.5 0.25
analysis Transient
set ok [analyze 1000 0.01]
