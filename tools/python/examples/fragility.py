#!/usr/bin/env python3
"""Incremental dynamic analysis of a frame, and its fragility: the probability of collapse over the intensity of earthquakes.

    python3 fragility.py [STUDY.toml [FOLDER]]

The study decides on records, intensities and the criterion of collapse. It needs `storey_height_m` and `collapse` in [measure].
The default has 20 synthetic earthquakes at 12 intensities. The campaign folder also has these pictures in report.html. Needs
matplotlib.
"""

import pathlib
import sys

import matplotlib.pyplot as plt
import numpy as np

import gusset

STUDY = pathlib.Path(__file__).resolve().parents[3] / "config" / "campaigns" / "ida-frame.toml"


def main():
    study = sys.argv[1] if len(sys.argv) > 1 else STUDY
    campaign = gusset.campaign(study, out=sys.argv[2] if len(sys.argv) > 2 else "campaigns/fragility")
    curve = campaign.fragility
    if curve is None:
        raise SystemExit("the fragility is not determined: use more records, or more intensities between no collapse and all")
    print(f"median {curve.median:.3f} {curve.unit}, dispersion {curve.dispersion:.2f}, {len(campaign.table)} tests")

    figure, (analysis, fragility) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for record in np.unique(campaign["record"]):
        rows = campaign.table[campaign["record"] == record]
        analysis.plot(100 * rows["max_drift_ratio"], rows["intensity"], color="0.6", linewidth=0.8)
    analysis.set(xlabel="largest drift of a storey (%)", ylabel=f"{curve.intensity} ({curve.unit})")
    fine = np.linspace(0, 1.3 * curve.levels[-1], 200)
    fragility.plot(fine, curve.probability(fine), label="lognormal fit")
    fragility.plot(curve.levels, curve.collapses / curve.tests, "o", label="share of tests")
    fragility.set(xlabel=f"{curve.intensity} ({curve.unit})", ylabel="probability of collapse")
    fragility.legend()
    figure.savefig(campaign.folder / "fragility.png", dpi=150)


if __name__ == "__main__":
    main()
