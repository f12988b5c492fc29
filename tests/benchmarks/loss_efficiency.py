#!/usr/bin/env python3
"""Which threshold of the robust kernel suits the noise of features: where reconstruct.loss_chi2 comes from.

  loss_efficiency.py

Residuals of features have a core and long tails: Student's t in two dimensions with few degrees of freedom (dof). For
such noise, gated and scaled to unit variance as `reconstruct` does, it prints the asymptotic variance of estimates with
Dynamic Covariance Scaling for several thresholds, relative to the inverse Fisher information of that noise without a
gate. Values below 1 are possible, because the gate drops the worst residuals. The last column is the worst case of a
threshold; it is least at 3.
"""
import numpy as np

GATE_CHI2 = 13.8
THRESHOLDS = (0.5, 1, 1.5, 2, 3, 4, 5.99, 9)
DOFS = (1, 1.25, 1.5, 2, 4, 30)


def gated(dof):
    """Squared residuals at evenly spaced quantiles, less those beyond the gate, of unit variance; and its scale."""
    quantiles = (np.arange(1000000) + 0.5) / 1000000
    squares = dof * (quantiles ** (-2 / dof) - 1)
    variance = 1.0
    for _ in range(200):
        kept = squares[squares < GATE_CHI2 * variance]
        variance = kept.mean() / 2
    return kept / variance, variance


def relative_variance(squares, variance, dof, threshold):
    inside = squares < threshold
    weight = np.where(inside, 1, (2 * threshold / (threshold + squares)) ** 2)
    slope = np.where(inside, 0, -8 * threshold ** 2 / (threshold + squares) ** 3)
    spread = (weight ** 2 * squares / 2).mean() / (weight + slope * squares).mean() ** 2
    return spread * variance * (dof + 2) / (dof + 4)


def main():
    table = {t: [relative_variance(*gated(dof), dof, t) for dof in DOFS] for t in THRESHOLDS}
    print("threshold " + " ".join(f"{f'dof {d}':>8}" for d in DOFS) + "    worst")
    for threshold, row in table.items():
        print(f"{threshold:9} " + " ".join(f"{v:8.2f}" for v in row) + f" {max(row):8.2f}")


if __name__ == "__main__":
    main()
