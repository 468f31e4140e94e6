# An I shape of fibres: tag, material, depth, width, flange and web.
proc IShape {tag mat d b tf tw} {
    set h [expr $d/2.]
    section Fiber $tag {
        patch rect $mat 2 1 -$h -[expr $b/2.] [expr -$h+$tf] [expr $b/2.]
        patch rect $mat 8 1 [expr -$h+$tf] -[expr $tw/2.] [expr $h-$tf] [expr $tw/2.]
        patch rect $mat 2 1 [expr $h-$tf] -[expr $b/2.] $h [expr $b/2.]
    }
}
