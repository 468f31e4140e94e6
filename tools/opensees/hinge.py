#!/usr/bin/env python3
"""Plastic hinges of test files in OpenSees: the force of `IMKBilin` or `IMKPeakOriented` along paths of fine steps.

Usage: hinge.py CASES.json
CASES.json: [{"law": {…}, "turns": [disp, …], "steps": steps between turns, "each": report every so many of them}, …], each law with
the keys of `law.imk`
Prints one line of JSON per case: {"force": [force, …]}
"""

import json
import sys

import peer

ops = peer.opensees()

SHAPE = ["plastic_disp_m", "post_capping_disp_m", "ultimate_disp_m", "yield_force_n", "capping_ratio", "residual_ratio"]
# A capacity that no test uses up: OpenSees has no number for no deterioration.
ENDLESS = 1e9


def build(law):
    """Makes the material of a hinge, with tag 1."""
    peaks = law["response"] == "peak_oriented"
    modes = ["strength", "post_capping", *(["reloading"] if peaks else []), "unloading"]
    negative = {**law, **law.get("negative", {})}
    numbers = [law["stiffness_n_per_m"]]
    numbers += [side[key] for side in (law, negative) for key in SHAPE]
    numbers += [law[f"{mode}_lambda_m"] or ENDLESS for mode in modes]
    numbers += [law[f"{mode}_exponent"] for mode in modes]
    numbers += [side["deterioration_factor"] for side in (law, negative)]
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.uniaxialMaterial("IMKPeakOriented" if peaks else "IMKBilin", 1, *map(float, numbers))
    ops.testUniaxialMaterial(1)


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        cases = json.load(file)
    for case in cases:
        build(case["law"])
        start, force, steps = 0.0, [], case["steps"]
        for turn in case["turns"]:
            for step in range(1, steps + 1):
                ops.setStrain(start + (turn - start) * step / steps)
                if step % case["each"] == 0:
                    force.append(ops.getStress())
            start = turn
        peer.tell(force=force)


main()
