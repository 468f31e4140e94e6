#!/usr/bin/env python3
"""Fragility of a three-storey frame: the probability that the storey drift exceeds a limit, over the peak ground acceleration.

    python3 fragility.py [--records N] [--intensities N] [--out FOLDER]

Each record is a synthetic earthquake with its own seed, scaled to several intensities. The fit is a lognormal distribution by
maximum likelihood. Needs matplotlib.
"""

import argparse
import concurrent.futures
import math
import os
import pathlib

import matplotlib.pyplot as plt
import numpy as np

import gusset

TEST = pathlib.Path(__file__).resolve().parents[3] / "config" / "frame-bouc-wen.toml"
SIGNAL = "excitation.ground_acceleration.signal.kanai_tajimi"
DRIFT_LIMIT = 0.03  # m, of the first storey


def largest_drift(seed, intensity, folder):
    """Largest drift of the first storey, m, for one record at one intensity (peak ground acceleration, g)."""
    out = folder / f"seed-{seed}-{intensity:.2f}g"
    run = gusset.run(TEST, clock="simulated", set={f"{SIGNAL}.seed": seed, f"{SIGNAL}.peak": intensity}, out=out, quiet=True)
    return float(np.abs(run["disp", 1]).max())


def fit(intensities, exceeded, records):
    """Median, g, and dispersion of the lognormal fragility with the largest likelihood, by a search on a grid."""
    best = (-math.inf, 0.0, 0.0)
    for median in np.geomspace(intensities[0] / 3, intensities[-1] * 3, 200):
        for dispersion in np.linspace(0.05, 1.0, 60):
            p = np.array([probability(x, median, dispersion) for x in intensities]).clip(1e-12, 1 - 1e-12)
            likelihood = float((exceeded * np.log(p) + (records - exceeded) * np.log(1 - p)).sum())
            best = max(best, (likelihood, median, dispersion))
    return best[1:]


def probability(intensity, median, dispersion):
    """Probability that the limit is exceeded at an intensity, g."""
    return 0.5 * (1 + math.erf(math.log(intensity / median) / (dispersion * math.sqrt(2))))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=8)
    parser.add_argument("--intensities", type=int, default=6)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("runs/fragility"))
    given = parser.parse_args()
    intensities = np.linspace(0.1, 0.6, given.intensities)
    tasks = [(seed, float(x)) for seed in range(1, given.records + 1) for x in intensities]
    # Each test runs in a separate process, so threads are enough to use all cores.
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        drifts = list(pool.map(lambda task: largest_drift(*task, given.out), tasks))
    drifts = np.array(drifts).reshape(given.records, given.intensities)
    exceeded = (drifts > DRIFT_LIMIT).sum(axis=0)
    median, dispersion = fit(intensities, exceeded, given.records)
    print(f"median {median:.3f} g, dispersion {dispersion:.2f}, {drifts.size} tests")

    figure, (curves, fragility) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    curves.plot(1e3 * drifts.T, intensities, color="0.6", linewidth=0.8)
    curves.plot(1e3 * np.median(drifts, axis=0), intensities, color="C0", label="median")
    curves.axvline(1e3 * DRIFT_LIMIT, color="C3", linestyle="--", label="limit")
    curves.set(xlabel="largest drift of storey 1 (mm)", ylabel="peak ground acceleration (g)", title="Incremental dynamic analysis")
    curves.legend()
    fine = np.linspace(0.02, 0.8, 200)
    fragility.plot(fine, [probability(x, median, dispersion) for x in fine], label="lognormal fit")
    fragility.plot(intensities, exceeded / given.records, "o", label="share of records")
    fragility.set(xlabel="peak ground acceleration (g)", ylabel="probability of exceeding the limit", title="Fragility")
    fragility.legend()
    figure.savefig(given.out / "fragility.png", dpi=150)


if __name__ == "__main__":
    main()
