#!/usr/bin/env python3
"""A stitched ring against AutoStitch's own text output: one JSON object.

  score_ring.py RIG.csv PANO.txt

AutoStitch's image axes are swapped, so angles between photos are compared: of neighbours (the last with the first) and of
all pairs; and the focal length with the mean of AutoStitch's.
"""
import csv
import json
import re
import sys

import numpy as np

from score_rig import matrix


def angle(r):
    return np.degrees(np.arccos(np.clip((np.trace(r) - 1) / 2, -1, 1)))


def read_autostitch(path):
    """name -> (rotation, focal length): name, size, 3 x 3 offset, 3 x 3 rotation, focal length, blank lines between."""
    lines = [line.strip() for line in open(path, encoding="utf-8") if line.strip()]
    found = {}
    for i, line in enumerate(lines):
        name = re.search(r"(\w+\.jpg)$", line, re.I)
        if name:
            rotation = np.array([[float(x) for x in row.split()] for row in lines[i + 5:i + 8]])
            found[name[1]] = (rotation, float(lines[i + 8]))
    return found


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    truth = read_autostitch(sys.argv[2])
    with open(sys.argv[1], encoding="utf-8") as f:
        rows = {r["photo"]: r for r in csv.DictReader(line for line in f if not line.startswith("#"))}
    names = sorted(set(truth) & set(rows))
    turn = {n: matrix(np.array([float(rows[n][k]) for k in ("qx", "qy", "qz", "qw")])) for n in names}
    focal, right_focal = (np.mean(x) for x in ([float(rows[n]["focal_px"]) for n in names],
                                               [truth[n][1] for n in names]))

    def differences(pairs):
        return np.array([angle(turn[a].T @ turn[b]) - angle(truth[a][0] @ truth[b][0].T) for a, b in pairs])

    ring = list(zip(names, names[1:] + names[:1]))
    neighbours, all_pairs = differences(ring), differences([(a, b) for a in names for b in names if a < b])
    print(json.dumps({k: v if isinstance(v, int) else round(float(v), 3) for k, v in {
        "photos": len(names), "of": len(truth), "focal_px": focal, "focal_error_percent": 100 * (focal / right_focal - 1),
        "sum_of_turns_deg": sum(angle(turn[a].T @ turn[b]) for a, b in ring),
        "neighbours_rmse_deg": np.sqrt((neighbours**2).mean()), "neighbours_max_deg": abs(neighbours).max(),
        "all_pairs_rmse_deg": np.sqrt((all_pairs**2).mean()), "all_pairs_max_deg": abs(all_pairs).max()}.items()}))


if __name__ == "__main__":
    main()
