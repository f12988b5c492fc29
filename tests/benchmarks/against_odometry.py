#!/usr/bin/env python3
"""Are results better than the odometry they were given? Runs, whole and thinned out, localized cold and scored: one table.

    against_odometry.py PROJECT:RUN[:TRUTH] ... [--every 1,2,4] [--starts N] [--set OPTION=VALUE]...

    against_odometry.py strecha/castle_P19:run1 strecha/herz_jesu_P25:run1 --every 1
    against_odometry.py lot_a:run1 kitti_00:run1 --every 2,3,4,6,8,10,12,16,20 --starts 5

TRUTH is a folder with runs/<run>_cameras.tum (world_from_cam); default: PROJECT_truth. Of each run every K-th image is kept,
from the first, and with --starts from up to N of the K first images. ATE after a similarity fit (images see no scale), of the
cameras and of the odometry at the same images, m; relative error over 20 m (a third of shorter runs); CPU seconds, everything
included. A case counts as help below 0.9 of odometry's ATE, as harm above 1.1 of it.
"""
import argparse
import os
import sys
import tempfile

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


def measure_case(source, name, truth, every, start, options):
    with tempfile.TemporaryDirectory() as work, open(os.path.join(work, "log"), "w", encoding="utf-8") as log:
        project = os.path.join(work, "project")
        copy_project(source, project, [name])
        images = thin_out(f"{project}/runs/{name}/images.txt", every, start)
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
    parser.add_argument("--set", action="append", default=[], help="option of localize")
    arguments = parser.parse_args()
    options = [word for value in arguments.set for word in ("--set", value)]
    print("| run | every | from | images | ATE, m | odometry's, m | relative, m | odometry's, m | CPU s | |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    counts = {"help": 0, "same": 0, "harm": 0, "failed": 0}
    for entry in arguments.runs:
        source, name, *rest = entry.split(":")
        truth = rest[0] if rest else source.rstrip("/") + "_truth"
        for every in [int(k) for k in arguments.every.split(",")]:
            for start in range(min(every, arguments.starts)):
                case = measure_case(source, name, truth, every, start, options)
                if "failed" in case:
                    counts["failed"] += 1
                    print(f"| {os.path.basename(source)} {name} | {every} | {start} | {case['images']} | | | | | | exit code {case['failed']} |", flush=True)
                    continue
                ratio = case["ours"]["ate_sim"] / case["odometry"]["ate_sim"]
                verdict = "help" if ratio < HELP else "harm" if ratio > HARM else "same"
                counts[verdict] += 1
                values = [number(case[who][what]) for what in ("ate_sim", "rpe_m") for who in ("ours", "odometry")]
                print(f"| {os.path.basename(source)} {name} | {every} | {start} | {case['images']} | {' | '.join(values)} | {case['cpu']:.0f} | {verdict} |", flush=True)
    print("\n" + ", ".join(f"{key}: {value}" for key, value in counts.items()))
    return 0 if counts["failed"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
