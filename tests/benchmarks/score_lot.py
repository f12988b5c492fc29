#!/usr/bin/python3
"""Scores the localize results of a project against its truth, all runs and both modes in one table.

    score_lot.py PROJECT TRUTH [--runs run1,run2] [--variants '',paper] [--json]

PROJECT is a folder after `trigpoint localize PROJECT` and `trigpoint localize PROJECT --mode paper`; TRUTH holds
runs/<run>_cameras.tum (world_from_cam), panoramas.tum or panoramas_<run>.tum (world_from_pano, first column the
station's number). For the example site: PROJECT/truth. Needs python3-numpy.

answered/expected  panoramas localized, and stations the run comes within 12 m of (those answered of them)
pano med/p90/max   m, over answers: position after a rigid fit (no scale) of the run's own cameras within 15 m of the
                   station to the truth, so that neither the global fit nor drift elsewhere counts
pano scaled        m, median and P90 after the run is multiplied by its true scale besides: what is not the odometry's scale,
                   which images cannot see
pano rot           deg, median of the rotation's error after the same fit
nees               mean of the panoramas' squared error in site ENU over its stated variance, per degree of freedom
cam h, v           m, RMSE of the cameras in site ENU as they are, horizontal and vertical
ate, ate sim       m, RMSE of the cameras after a rigid and after a similarity fit
scale              what the trajectory's scale is off by, %
rpe m, deg         RMSE of relative poses over 20 m of path (a third of the path if it is shorter than 60 m)
The row `odometry` is what was fed in. Photo sets are left out: score_sets.py. Blank: nothing to score. pooled: over the answers of every run of a mode.
"""
import argparse
import csv
import json
import os
import re
import sys

import numpy as np


def table(path):
    with open(path, encoding="utf-8") as text:
        return list(csv.DictReader(line for line in text if not line.startswith("#")))


def tum(path):
    """time -> x y z qx qy qz qw"""
    with open(path, encoding="utf-8") as text:
        rows = [line.split() for line in text if line.strip() and not line.startswith("#")]
    return {float(row[0]): np.array(row[1:8], float) for row in rows}


def rotation(q):
    x, y, z, w = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def angle_deg(r):
    return np.degrees(np.arccos(np.clip((np.trace(r) - 1) / 2, -1, 1)))


def rigid_fit(source, target):
    """Rotation and translation that take source to target, least squares (Umeyama)."""
    ms, mt = source.mean(0), target.mean(0)
    u, _, vt = np.linalg.svd((target - mt).T @ (source - ms))
    r = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return r, mt - r @ ms


def rms(vectors):
    return float(np.sqrt((np.atleast_2d(vectors) ** 2).sum(1).mean()))


def nearest(time, poses):
    return min(poses, key=lambda t: abs(t - time))


def matched(truth, estimate):
    """(time, truth, estimate) for the truth's times that the estimate has within 10 ms."""
    return [(t, truth[t], estimate[s]) for t in sorted(truth) for s in [nearest(t, estimate)] if abs(s - t) < 0.01]


def score_trajectory(truth, estimate):
    """estimate, truth: lists of (rotation, position) at the same times."""
    p, g = np.array([x for _, x in estimate]), np.array([x for _, x in truth])
    r, _ = rigid_fit(p, g)
    a, b = (p - p.mean(0)) @ r.T, g - g.mean(0)
    scale = float((a * b).sum() / (a * a).sum())
    path = np.r_[0, np.cumsum(np.linalg.norm(np.diff(g, axis=0), axis=1))]
    length = 20.0 if path[-1] >= 60 else path[-1] / 3
    translations, angles = [], []
    for i in range(len(truth)):
        j = int(np.searchsorted(path, path[i] + length))
        if j == len(truth):
            break
        translations.append(estimate[i][0].T @ (p[j] - p[i]) * scale - truth[i][0].T @ (g[j] - g[i]))
        relative = estimate[i][0].T @ estimate[j][0]
        angles.append(angle_deg(relative.T @ (truth[i][0].T @ truth[j][0])))
    return {"ate": rms(a - b), "ate_sim": rms(scale * a - b), "scale_percent": 100 * (1 / scale - 1),
            "rpe_m": rms(translations) if translations else None,
            "rpe_deg": float(np.sqrt(np.mean(np.square(angles)))) if angles else None}


def cam_from_body(camchain):
    with open(camchain, encoding="utf-8") as text:
        rows = re.findall(r"-\s*\[([^\]]+)\]", text.read())
    return np.array([[float(v) for v in row.split(",")] for row in rows[:4]])


def poses_of(rows):
    return [(rotation(row[3:]), row[:3]) for row in rows]


def station_number(name):
    return int("".join(c for c in name if c.isdigit()))


def panoramas_of(result):
    """Rows of a localize result; hand-held photo sets, which are named after their folder, have a truth of their own (score_sets.py)."""
    return [row for row in table(f"{result}/panoramas.csv") if os.path.splitext(row["panorama"])[1]]


def score_odometry(project, truth_dir, run):
    truth = tum(f"{truth_dir}/runs/{run}_cameras.tum")
    odometry = tum(f"{project}/runs/{run}/odometry.tum")
    t = cam_from_body(f"{project}/runs/{run}/camchain.yaml")
    camera = []
    for time in sorted(truth):
        body = odometry[nearest(time, odometry)]
        r = rotation(body[3:]) @ t[:3, :3].T
        camera.append((r, body[:3] - r @ t[:3, 3]))
    return score_trajectory(poses_of(truth[time] for time in sorted(truth)), camera)


def score_run(result, truth_dir, run):
    truth = tum(f"{truth_dir}/runs/{run}_cameras.tum")
    own = matched(truth, tum(f"{result}/cameras_odom.tum"))
    score = score_trajectory(poses_of(row[1] for row in own), poses_of(row[2] for row in own))
    score["frames"] = f"{len(own)}/{len(truth)}"
    if os.path.exists(f"{result}/cameras.tum"):
        world = matched(truth, tum(f"{result}/cameras.tum"))
        errors = np.array([e[:3] - t[:3] for _, t, e in world])
        score.update(cam_h=rms(errors[:, :2]), cam_v=rms(errors[:, 2:]))

    stations = next((p for p in (f"{truth_dir}/panoramas_{run}.tum", f"{truth_dir}/panoramas.tum") if os.path.exists(p)), None)
    if stations is None:
        return score
    stations = {int(k): v for k, v in tum(stations).items()}
    expected = {k for k, v in stations.items() if min(np.linalg.norm(c[:3] - v[:3]) for c in truth.values()) < 12}
    cameras, targets = np.array([e[:3] for _, _, e in own]), np.array([t[:3] for _, t, _ in own])
    errors, scaled, turns, normalised = {}, {}, [], []
    true_scale = 1 / (1 + score["scale_percent"] / 100)
    for row in panoramas_of(result):
        if row["status"] != "localized":
            continue
        number = station_number(row["station"])
        place = stations[number]
        near = np.linalg.norm(targets - place[:3], axis=1) < 15
        if not near.any():
            near[:] = True
        found = np.array([float(row["odom_" + k]) for k in "xyz"])
        r, t = rigid_fit(true_scale * cameras[near], targets[near])
        scaled[number] = float(np.linalg.norm(r @ (true_scale * found) + t - place[:3]))
        r, t = rigid_fit(cameras[near], targets[near])
        errors[number] = float(np.linalg.norm(r @ found + t - place[:3]))
        turns.append(angle_deg((r @ rotation([float(row["odom_" + k]) for k in ("qx", "qy", "qz", "qw")])).T @ rotation(place[3:])))
        try:
            sigmas = np.array([float(row[f"sigma_{k}_m"]) for k in "xyz"])
            world = np.array([float(row[k]) for k in "xyz"]) - place[:3]
            normalised.append(float((world ** 2 / sigmas ** 2).sum() / 3))
        except ValueError:
            pass  # no global frame: nothing to normalise
    score.update(answers=len(errors), expected=len(expected), answered=len(expected & set(errors)),
                 missing=sorted(expected - set(errors)), panoramas=errors, scaled=scaled, turns=turns, normalised=normalised)
    return score


def summarise(score):
    """What the table shows, from the answers of one run or of several."""
    errors = np.array(list(score.get("panoramas", {}).values()))
    if len(errors):
        score.update(pano_median=float(np.median(errors)), pano_p90=float(np.percentile(errors, 90)), pano_max=float(errors.max()),
                     pano_rot_deg=float(np.median(score["turns"])))
        scaled = np.array(list(score["scaled"].values()))
        score.update(scaled_median=float(np.median(scaled)), scaled_p90=float(np.percentile(scaled, 90)))
    if score.get("normalised"):
        score["nees"] = float(np.mean(score["normalised"]))
    return score


COLUMNS = [("answered", "{}"), ("expected", "{}"), ("pano_median", "{:.3f}"), ("pano_p90", "{:.3f}"), ("pano_max", "{:.3f}"),
           ("scaled_median", "{:.3f}"), ("scaled_p90", "{:.3f}"),
           ("pano_rot_deg", "{:.2f}"), ("nees", "{:.2f}"), ("cam_h", "{:.3f}"), ("cam_v", "{:.3f}"), ("ate", "{:.3f}"),
           ("ate_sim", "{:.3f}"), ("scale_percent", "{:+.2f}"), ("rpe_m", "{:.3f}"), ("rpe_deg", "{:.2f}"), ("frames", "{}")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project")
    parser.add_argument("truth")
    parser.add_argument("--runs", help="comma separated; default: every run of the truth")
    parser.add_argument("--variants", default=",paper", help="default: trigpoint's own and paper")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    runs = args.runs.split(",") if args.runs else sorted(
        name[:-len("_cameras.tum")] for name in os.listdir(f"{args.truth}/runs") if name.endswith("_cameras.tum"))
    rows = []
    for variant in args.variants.split(","):
        pooled = {"panoramas": {}, "scaled": {}, "turns": [], "normalised": [], "answered": 0, "expected": 0}
        for run in runs:
            result = f"{args.project}/results/localize/{run}" + (f"@{variant}" if variant else "")
            if not os.path.exists(f"{result}/cameras_odom.tum"):
                print(f"nothing at {result}", file=sys.stderr)
                continue
            score = summarise(score_run(result, args.truth, run))
            rows.append((run, variant or "trigpoint", score))
            for key in ("panoramas", "scaled"):
                pooled[key].update({f"{run}/{station}": error for station, error in score.get(key, {}).items()})
            for key in ("turns", "normalised", "answered", "expected"):
                pooled[key] += score.get(key, [] if isinstance(pooled[key], list) else 0)
        if pooled["panoramas"] and len(runs) > 1:
            rows.append(("pooled", variant or "trigpoint", summarise(pooled)))
    for run in runs:
        if os.path.exists(f"{args.project}/runs/{run}/odometry.tum"):
            rows.append((run, "odometry", score_odometry(args.project, args.truth, run)))
    if args.json:
        print(json.dumps([{"run": run, "mode": mode, **score} for run, mode, score in rows], indent=1))
        return
    print("| run | mode | " + " | ".join(name for name, _ in COLUMNS) + " |")
    print("|---|---|" + "---|" * len(COLUMNS))
    for run, mode, score in rows:
        cells = ["" if score.get(name) is None else form.format(score[name]) for name, form in COLUMNS]
        print(f"| {run} | {mode} | " + " | ".join(cells) + " |")
    for run, mode, score in rows:
        if score.get("missing"):
            print(f"{run}, {mode}: not answered: " + ", ".join(f"S{k}" for k in score["missing"]))


if __name__ == "__main__":
    main()
