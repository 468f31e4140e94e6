"""The course of a recorded model in OpenSees: `python reference.py RECORD STEPS SUBSTEPS ANSWER`.

RECORD is that of an import, with `constant` loads, `units` of length, and the rate. Each of STEPS at 1/rate is made in SUBSTEPS of Newmark's method.
"""

import json
import os
import sys
from pathlib import Path

from gusset.importer.opensees.child import load, real, rebuild, settle


def main():
    record = json.loads(Path(sys.argv[1]).read_text())
    steps, substeps = int(sys.argv[2]), int(sys.argv[3])
    ops = real()
    constant = dict(record["constant"])
    rebuild(record, ops, constant)
    if not load(ops, 1e-11) and constant:
        sys.exit("no equilibrium under the constant loads")
    ops.loadConst("-time", 0.0)
    for one in record["commands"]:
        name, args = one["name"], one["args"]
        if name in ("rayleigh", "region", "timeSeries") or (name == "pattern" and args[0] == "UniformExcitation"):
            getattr(ops, name)(*args)
    ops.wipeAnalysis()
    settle(ops, record["tolerance"])
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
