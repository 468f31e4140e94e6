"""SuperLU on the matrices NAME.mtx of a folder: the best of its orderings, one right-hand side, median; and the ratio to Gusset's.

Called by tools/superlu. `ours` in the folder is the table of the bench: name, n, stored, storage, µs.
"""
import pathlib
import statistics
import sys
import time

import numpy as np
import scipy
from scipy.io import mmread
from scipy.sparse.linalg import splu

GOAL = 1.5


def solves(lu, rhs, times):
    took = []
    for _ in range(times):
        began = time.perf_counter()
        lu.solve(rhs)
        took.append(time.perf_counter() - began)
    return statistics.median(took) * 1e6


def ours(folder):
    found = {}
    for line in (folder / "ours").read_text().splitlines():
        words = line.split()
        if len(words) >= 5 and words[1].isdigit() and (folder / f"{words[0]}.mtx").exists():
            found[words[0]] = float(words[4])
    return found


def main():
    folder, times = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    print(f"\nSciPy {scipy.__version__}, SuperLU; µs per solve, median of {times}; symmetric mode where the ordering allows it\n")
    print(f"{'model':>14}{'n':>8}{'ordering':>16}{'nnz(L+U)':>12}{'SuperLU':>11}{'ours':>11}{'ratio':>8}  goal {GOAL} x")
    for name, our in ours(folder).items():
        matrix = mmread(folder / f"{name}.mtx").tocsc()
        rhs = (7.0 * np.arange(matrix.shape[0]) + 3.0) % 11.0 - 5.0
        best = None
        for order in ("MMD_AT_PLUS_A", "COLAMD"):
            # The options that SuperLU's guide gives for symmetric, diagonally strong matrices.
            options = {"SymmetricMode": True} if order == "MMD_AT_PLUS_A" else {}
            threshold = 0.0 if options else 1.0
            lu = splu(matrix, permc_spec=order, diag_pivot_thresh=threshold, options=options)
            took = solves(lu, rhs, times)
            assert np.abs(matrix @ lu.solve(rhs) - rhs).max() < 1e-9
            if best is None or took < best[0]:
                best = (took, order, lu.nnz)
        took, order, filled = best
        ratio = took / our
        verdict = "reached" if ratio >= GOAL else "missed"
        print(f"{name:>14}{matrix.shape[0]:>8}{order:>16}{filled:>12}{took:>11.1f}{our:>11.1f}{ratio:>7.2f}x  {verdict}")


if __name__ == "__main__":
    main()
