#!/usr/bin/env python3
"""Are results better than the odometry they were given? Runs, whole and thinned out, localized cold and scored: one table.

    against_odometry.py PROJECT:RUN[:TRUTH] ... [--every 1,2,4] [--starts N] [--set OPTION=VALUE]...

    against_odometry.py strecha/castle_P19:run1 strecha/herz_jesu_P25:run1 --every 1
    against_odometry.py lot_a:run1 kitti_00:run1 --every 2,3,4,6,8,10,12,16,20 --starts 5
    against_odometry.py strecha/castle_P19:run1 strecha/herz_jesu_P25:run1 --noise 1,1.5,2,3,6 --seeds 1,2

TRUTH is a folder with runs/<run>_cameras.tum (world_from_cam); default: PROJECT_truth. Of each run every K-th image is kept,
from the first, and with --starts from up to N of the K first images. With --noise the odometry is drawn anew about the truth,
its noise so many times the one that `reconstruct` takes it to have (steps: 0.1 deg and 0.3 deg a root of a metre; 5 mm and 2 %
of the length; a scale of 1 %), once for each of --seeds. ATE after a similarity fit (images see no scale), of the
cameras and of the odometry at the same images, m; relative error over 20 m (a third of shorter runs); CPU seconds, everything
included. A case counts as help below 0.9 of odometry's ATE, as harm above 1.1 of it.
"""
import argparse
import math
import os
import sys
import tempfile

import numpy as np

from measure import copy_project, program, read_rows, run
from score_lot import cam_from_body, matched, nearest, poses_of, rotation, score_trajectory, tum

HELP, HARM = 0.9, 1.1


def thin_out(images, every, start):
    """Keeps every `every`-th time of images.txt (images of one moment belong together); returns how many images remain."""
    header, rows = read_rows(images)
    times = sorted({float(row[0]) for row in rows})[start::every]
    kept = [" ".join(row) for row in rows if float(row[0]) in times]
    os.remove(images)  # a hard link to the original
    with open(images, "w", encoding="utf-8") as out:
        out.write("\n".join(header + kept) + "\n")
    return len(kept)


def turn(vector):
    """Rotation matrix of a rotation vector, rad."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def quaternion(r):
    """x, y, z, w of a rotation matrix, by its largest component."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)]]) / 3
    return np.linalg.eigh(k)[1][:, -1]


def redraw_odometry(project, name, truth, noise, seed):
    """Writes odometry.tum anew, at the times that truth and the old one share."""
    file = f"{project}/runs/{name}/odometry.tum"
    t = cam_from_body(f"{project}/runs/{name}/camchain.yaml")
    cameras, old = tum(f"{truth}/runs/{name}_cameras.tum"), tum(file)
    bodies = []
    for time in sorted(cameras):
        if abs(nearest(time, old) - time) < 0.01:
            r = rotation(cameras[time][3:])
            bodies.append((time, r @ t[:3, :3], cameras[time][:3] + r @ t[:3, 3]))
    random = np.random.default_rng(seed)
    scale = 1 + 0.01 * random.standard_normal()
    r, c = np.eye(3), np.zeros(3)
    rows = [(bodies[0][0], r, c)]
    for (_, r0, c0), (time, r1, c1) in zip(bodies, bodies[1:]):
        step = r0.T @ (c1 - c0)
        length = np.linalg.norm(step)
        sigma_turn = math.radians(noise * math.hypot(0.1, 0.3 * min(length, math.sqrt(length))))
        sigma_step = noise * math.hypot(0.005, 0.02 * length)
        c = c + r @ (scale * step + sigma_step * random.standard_normal(3))
        r = r @ r0.T @ r1 @ turn(sigma_turn * random.standard_normal(3))
        rows.append((time, r, c))
    os.remove(file)  # a hard link to the original
    with open(file, "w", encoding="utf-8") as out:
        out.write("# timestamp tx ty tz qx qy qz qw\n")
        for time, r, c in rows:
            out.write(f"{time:.6f} " + " ".join(f"{v:.9f}" for v in (*c, *quaternion(r))) + "\n")


def odometry_cameras(project, name, times):
    """world_from_cam that odometry alone gives the first camera, at some times."""
    odometry = tum(f"{project}/runs/{name}/odometry.tum")
    t = cam_from_body(f"{project}/runs/{name}/camchain.yaml")
    cameras = []
    for time in times:
        body = odometry[nearest(time, odometry)]
        r = rotation(body[3:]) @ t[:3, :3].T
        cameras.append((r, body[:3] - r @ t[:3, 3]))
    return cameras


def measure_case(source, name, truth, every, start, drawn, options):
    with tempfile.TemporaryDirectory() as work, open(os.path.join(work, "log"), "w", encoding="utf-8") as log:
        project = os.path.join(work, "project")
        copy_project(source, project, [name])
        images = thin_out(f"{project}/runs/{name}/images.txt", every, start)
        if drawn:
            redraw_odometry(project, name, truth, *drawn)
        run([program(), "init", project], log)
        cost = run([program(), "localize", project, "--run", name, *options], log, check=False)
        if cost["code"] != 0:
            return {"images": images, "failed": cost["code"]}
        triples = matched(tum(f"{truth}/runs/{name}_cameras.tum"), tum(f"{project}/results/localize/{name}/cameras_odom.tum"))
        poses = poses_of([row for _, row, _ in triples])
        ours = score_trajectory(poses, poses_of([row for _, _, row in triples]))
        theirs = score_trajectory(poses, odometry_cameras(project, name, [time for time, _, _ in triples]))
        return {"images": images, "cpu": cost["cpu"], "ours": ours, "odometry": theirs}


def number(value):
    return "" if value is None else f"{value:.4f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--every", default="1", help="keep every K-th image; several K, comma-separated")
    parser.add_argument("--starts", type=int, default=1, help="first images tried for each K, at most")
    parser.add_argument("--noise", help="odometry drawn anew, its noise so many times what is assumed; comma-separated")
    parser.add_argument("--seeds", default="1", help="of --noise, comma-separated")
    parser.add_argument("--set", action="append", default=[], help="option of localize")
    arguments = parser.parse_args()
    options = [word for value in arguments.set for word in ("--set", value)]
    draws = [None]
    if arguments.noise:
        draws = [(float(n), int(k)) for n in arguments.noise.split(",") for k in arguments.seeds.split(",")]
    print("| run | noise, seed | every | from | images | ATE, m | odometry's, m | relative, m | odometry's, m | CPU s | |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    counts = {"help": 0, "same": 0, "harm": 0, "failed": 0}
    for entry in arguments.runs:
        source, name, *rest = entry.split(":")
        truth = rest[0] if rest else source.rstrip("/") + "_truth"
        cases = [(every, start, drawn) for every in map(int, arguments.every.split(","))
                 for start in range(min(every, arguments.starts)) for drawn in draws]
        for every, start, drawn in cases:
            case = measure_case(source, name, truth, every, start, drawn, options)
            of = f"| {os.path.basename(source)} {name} | {'as given' if drawn is None else f'{drawn[0]:g}, {drawn[1]}'} | {every} | {start} | {case['images']} |"
            if "failed" in case:
                counts["failed"] += 1
                print(f"{of} | | | | | exit code {case['failed']} |", flush=True)
                continue
            ratio = case["ours"]["ate_sim"] / case["odometry"]["ate_sim"]
            verdict = "help" if ratio < HELP else "harm" if ratio > HARM else "same"
            counts[verdict] += 1
            values = [number(case[who][what]) for what in ("ate_sim", "rpe_m") for who in ("ours", "odometry")]
            print(f"{of} {' | '.join(values)} | {case['cpu']:.0f} | {verdict} |", flush=True)
    print("\n" + ", ".join(f"{key}: {value}" for key, value in counts.items()))
    return 0 if counts["failed"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
