#!/usr/bin/env python3
"""A specimen in Python, which the test in python.toml commands.

First terminal:   python3 python.py [PORT]
Second terminal:  gusset run python.toml --out runs/python

Change `measure` to your force law. gusset_specimen.py speaks the protocol; leave it as it is. Units are N, m and s.
"""
import gusset_specimen

STIFFNESS = 10e6  # initial stiffness, N/m
YIELD_FORCE = 60e3  # yield force, N
POST_YIELD = 0.05  # stiffness after yielding, as a share of the initial stiffness


class Storey(gusset_specimen.Rig):
    """A bilinear storey. It keeps its state until the program ends, also from test to test."""

    simulated = True  # no machine moves

    def __init__(self):
        super().__init__(STIFFNESS)
        self.last_disp = 0.0  # displacement of the previous command, m
        self.force = 0.0  # force at that displacement, N

    def measure(self):
        """Called once for each new command: `self.disp` in m. Returns the measured displacement in m and the force in N."""
        trial = self.force + STIFFNESS * (self.disp - self.last_disp)
        middle = POST_YIELD * STIFFNESS * self.disp
        half_width = (1 - POST_YIELD) * YIELD_FORCE
        self.force = min(max(trial, middle - half_width), middle + half_width)
        self.last_disp = self.disp
        return self.disp, self.force


if __name__ == "__main__":
    gusset_specimen.main(Storey())
