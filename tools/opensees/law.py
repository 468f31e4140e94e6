#!/usr/bin/env python3
"""Stresses of an OpenSees material along a path of strains.

    law.py Steel02:4.2e8,2e11,0.01,20,0.925,0.15 < STRAINS

Standard input is a JSON list of strains. Prints one line of JSON: {"stresses": [...]}
"""

import json
import sys

import peer


def main():
    ops = peer.opensees()
    ops.wipe()
    peer.material(ops, 1, sys.argv[1])
    ops.testUniaxialMaterial(1)
    stresses = []
    for strain in json.load(sys.stdin):
        # Commits, too.
        ops.setStrain(strain)
        stresses.append(ops.getStress())
    peer.tell(stresses=stresses)


main()
