"""The course of a recorded model in OpenSees: `python reference.py RECORD STEPS SUBSTEPS ANSWER`.

RECORD is that of an import, with `constant` loads, `units` of length, and the rate. Each of STEPS at 1/rate is made in SUBSTEPS of Newmark's method.
"""

import json
import os
import sys
from pathlib import Path

from gusset.importer.opensees.child import AUTOMATIC, BUILDS, real


def main():
    record = json.loads(Path(sys.argv[1]).read_text())
    steps, substeps = int(sys.argv[2]), int(sys.argv[3])
    ops = real()
    ops.wipe()
    constant = dict(map(tuple, record["constant"]))
    wanted, later = True, []
    for one in record["commands"]:
        name, args = one["name"], one["args"]
        if name in BUILDS and name not in ("rayleigh", "region"):
            getattr(ops, name)(*args)
        elif name in ("rayleigh", "region", "timeSeries") or (name == "pattern" and args[0] == "UniformExcitation"):
            later.append((name, args))
        if name == "pattern" and args[0] == "Plain":
            wanted = args[1] in constant
            if wanted:
                tag = AUTOMATIC + 60_000 + args[1]
                ops.timeSeries("Linear", tag, "-factor", constant[args[1]])
                ops.pattern("Plain", args[1], tag)
        elif name in ("load", "eleLoad", "sp") and wanted:
            getattr(ops, name)(*args)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", 1e-11, 200)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    if constant and ops.analyze(10) != 0:
        sys.exit("no equilibrium under the constant loads")
    ops.loadConst("-time", 0.0)
    for name, args in later:
        getattr(ops, name)(*args)
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", record["tolerance"], 200)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    nodes = sorted(ops.getNodeTags())
    rows = [[ops.nodeDisp(tag) for tag in nodes]]
    for _ in range(steps - 1):
        if ops.analyze(substeps, record["step"] / substeps) != 0:
            sys.exit("no equilibrium in a step")
        rows.append([ops.nodeDisp(tag) for tag in nodes])
    Path(sys.argv[4]).write_text(json.dumps({"nodes": nodes, "rows": rows}))
    sys.stdout.flush()
    os._exit(0)


main()
