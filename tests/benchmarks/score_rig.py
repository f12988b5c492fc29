#!/usr/bin/env python3
"""A stitched rig against the true poses of its photos: one JSON object.

  score_rig.py RIG.csv TRUTH.tum [--focal F] [--panorama NAME]

RIG.csv: rig.csv, or localize's rigs.csv (then --panorama names the set). TRUTH.tum: photo number, tx ty tz qx qy qz qw.
Turns: each photo's against all others', after the common turn that fits best (rms, largest). Centres: against the mean of
the centres, turned by the same, as they are and scaled to fit. With rig.json beside: shape_nees, the squared error of turns and
centres over the stated covariance of the rig's shape, a degree of freedom (what a turn, a shift and a size of the whole leave).
"""
import argparse
import csv
import json
import os
import re

import numpy as np


def matrix(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def log_of(r):
    angle = np.arccos(np.clip((np.trace(r) - 1) / 2, -1, 1))
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return axis / 2 if angle < 1e-9 else axis * angle / (2 * np.sin(angle))


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def shape_nees(sidecar, turns, centres, right_turns, right_centres):
    """All in the rig frame: rig_from_cam, centres about their mean; the right ones fitted to them by turn, shift and size."""
    n = 6 * len(turns)
    lower = json.load(open(sidecar))["shape_covariance"]
    if len(lower) != n * (n + 1) // 2:
        return None
    covariance = np.zeros((n, n))
    covariance[np.tril_indices(n)] = lower
    covariance += np.tril(covariance, -1).T
    unit = 0.1  # m: centres count as far as turns do
    error, frame, scale = np.zeros(n), np.zeros((n, 7)), np.ones(n)
    for k, (turn, c, right, rc) in enumerate(zip(turns, centres, right_turns, right_centres)):
        error[6 * k:6 * k + 3] = log_of(turn.T @ right)
        error[6 * k + 3:6 * k + 6] = c - rc
        scale[6 * k + 3:6 * k + 6] = 1 / unit
        frame[6 * k:6 * k + 3, :3] = -turn.T
        frame[6 * k + 3:6 * k + 6, :3] = -skew(c) / unit
        frame[6 * k + 3:6 * k + 6, 3:6] = np.eye(3)
        frame[6 * k + 3:6 * k + 6, 6] = c / unit
    keep = np.eye(n) - frame @ np.linalg.pinv(frame)
    values, vectors = np.linalg.eigh(keep @ (scale[:, None] * covariance * scale) @ keep.T)
    along = vectors.T @ (keep @ (scale * error))
    return float(np.mean(along[7:] ** 2 / values[7:]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rig")
    parser.add_argument("truth")
    parser.add_argument("--focal", type=float)
    parser.add_argument("--panorama")
    o = parser.parse_args()
    truth = {int(row[0]): (matrix(row[4:8]), row[1:4]) for row in np.loadtxt(o.truth, ndmin=2)}
    turns, centres, right_turns, right_centres, focals = [], [], [], [], []
    with open(o.rig) as f:
        for row in csv.DictReader(line for line in f if not line.startswith("#")):
            if o.panorama and row["panorama"] != o.panorama:
                continue
            number = int(re.findall(r"\d+", row["photo"])[-1])
            turns.append(matrix(np.array([float(row[k]) for k in ("qx", "qy", "qz", "qw")])))
            centres.append([float(row[k]) for k in ("tx", "ty", "tz")])
            right_turns.append(truth[number][0])
            right_centres.append(truth[number][1])
            if row.get("focal_px"):
                focals.append(float(row["focal_px"]))
    # world_from_rig that fits best: R_world_cam = W R_rig_cam.
    u, _, vt = np.linalg.svd(sum(t @ r.T for t, r in zip(right_turns, turns)))
    w = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    angles = [np.degrees(np.arccos(np.clip((np.trace(t.T @ w @ r) - 1) / 2, -1, 1))) for t, r in zip(right_turns, turns)]
    c = np.array(centres) - np.mean(centres, axis=0)
    t = np.array(right_centres) - np.mean(right_centres, axis=0)
    c = c @ w.T
    scale = float((c * t).sum() / (c * c).sum()) if (c * c).sum() > 0 else 0.0
    out = {"photos": len(turns), "of": len(truth), "turn_rmse_deg": float(np.sqrt(np.mean(np.square(angles)))),
           "turn_max_deg": float(max(angles)),
           "centre_rmse_m": float(np.sqrt(((c - t) ** 2).sum(1).mean())),
           "centre_rmse_scaled_m": float(np.sqrt(((scale * c - t) ** 2).sum(1).mean())), "scale_to_truth": scale}
    sidecar = os.path.join(os.path.dirname(o.rig), "rig.json")
    if os.path.exists(sidecar):
        in_rig = np.array(centres) - np.mean(centres, axis=0)
        out["shape_nees"] = shape_nees(sidecar, turns, in_rig, [w.T @ r for r in right_turns], t @ w / scale)
    if focals and o.focal:
        out["focal_px"] = focals[0]
        out["focal_error_percent"] = 100 * (focals[0] / o.focal - 1)
    print(json.dumps({k: round(v, 5) if isinstance(v, float) else v for k, v in out.items()}))


if __name__ == "__main__":
    main()
