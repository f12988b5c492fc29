#!/usr/bin/python3
"""What a hand-held set's rig is worth in `localize`: the error of each set's centre, as a rig and as one picture.

    score_sets.py PROJECT TRUTH [--runs run1,run3] [--variants '',fixed,central]

PROJECT: after `trigpoint localize` of each run and variant; a set is a row of panoramas.csv named after its folder in
photos/, or after stitched/<set>.jpg (the stitched picture given as a panorama). TRUTH holds runs/<run>_cameras.tum and
photos/<set>.tum. Errors (m): position of the set's centre (the mean of its photos' centres) after a rigid fit, without
scale, of the run's own cameras within 15 m of it to the truth. Sigma: stated in the run's frame, its scale held, so that the
scale's error (0.6 % of some metres) comes on top of it. Needs python3-numpy.
"""
import argparse
import os

import numpy as np

from score_lot import matched, rigid_fit, table, tum


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project")
    parser.add_argument("truth")
    parser.add_argument("--runs", default="run1,run3")
    parser.add_argument("--variants", default="")
    args = parser.parse_args()
    centres = {name[:-4]: np.mean([row[:3] for row in tum(f"{args.truth}/photos/{name}").values()], axis=0)
               for name in sorted(os.listdir(f"{args.truth}/photos")) if name.endswith(".tum")}
    print("| run | variant | set | answer | error m | sigma m (1 axis) |\n|---|---|---|---|---|---|")
    for variant in args.variants.split(","):
        errors = []
        for run in args.runs.split(","):
            result = f"{args.project}/results/localize/{run}" + (f"@{variant}" if variant else "")
            if not os.path.exists(f"{result}/panoramas.csv"):
                continue
            own = matched(tum(f"{args.truth}/runs/{run}_cameras.tum"), tum(f"{result}/cameras_odom.tum"))
            cameras, targets = np.array([e[:3] for _, _, e in own]), np.array([t[:3] for _, t, _ in own])
            for row in table(f"{result}/panoramas.csv"):
                name = os.path.splitext(os.path.basename(row["panorama"]))[0]
                if name not in centres:
                    continue
                if row["status"] != "localized":
                    print(f"| {run} | {variant} | {row['panorama']} | {row['status']}: {row['reason']} | | |")
                    continue
                near = np.linalg.norm(targets - centres[name], axis=1) < 15
                r, t = rigid_fit(cameras[near], targets[near])
                place = r @ np.array([float(row[f"odom_{k}"]) for k in "xyz"]) + t
                sigma = np.sqrt(np.mean([float(row[f"odom_sigma_{k}_m"]) ** 2 for k in "xyz"]))
                errors.append(np.linalg.norm(place - centres[name]))
                print(f"| {run} | {variant} | {row['panorama']} | localized | {errors[-1]:.3f} | {sigma:.3f} |")
        if errors:
            print(f"| all | {variant} | {len(errors)} answers | rms | {np.sqrt(np.mean(np.square(errors))):.3f} | |")


if __name__ == "__main__":
    main()
