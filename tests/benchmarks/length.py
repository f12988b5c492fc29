#!/usr/bin/env python3
"""Cost of localize against the length of a run.

    length.py PROJECT RUN [--frames 100,200,400,800] [--work DIR]

Makes runs of the given lengths by driving RUN's images back and forth (odometry too, in the same time), localizes each
in a project of its own, cold, and prints wall and CPU time and peak memory: of everything, and of the stage localize
by itself (features are found before it, a few pictures at a time). GPS is left out.
"""
import argparse
import json
import os
import shutil
import tempfile

from measure import copy_project, link, program, read_rows, run


def back_and_forth(rows, first, last, end):
    """Rows (time first), driven from `first` to `last` and back again until the time `end`."""
    lap, out, number = last - first, [], 0
    while first + number * lap < end:
        forth = number % 2 == 0
        for row in rows if forth else reversed(rows):
            t = float(row[0])
            since = t - first if forth else last - t
            if 0 <= since <= lap and (since > 0 or number == 0):  # the turning point belongs to one lap
                out.append([f"{first + number * lap + since:.9f}"] + row[1:])
        number += 1
    return [row for row in out if float(row[0]) <= end + 1e-6]


def make_run(project, name, frames):
    folder = os.path.join(project, "runs", name)
    comments, images = read_rows(f"{folder}/images.txt")
    odometry_comments, odometry = read_rows(f"{folder}/odometry.tum")
    first, last = float(images[0][0]), float(images[-1][0])
    step = (last - first) / (len(images) - 1)
    long = back_and_forth(images, first, last, first + (frames + 1) * step)[:frames]
    names = []
    for number, row in enumerate(long):
        new = f"repeated/{number:06d}{os.path.splitext(row[1])[1]}"
        link(f"{folder}/{row[1]}", f"{folder}/{new}")
        names.append([row[0], new] + row[2:])
    end = float(long[-1][0])
    write(f"{folder}/images.txt", comments, names)
    write(f"{folder}/odometry.tum", odometry_comments, back_and_forth(odometry, first, last, end + step))
    for file in os.listdir(folder):
        if file == "gps.csv" or file.endswith((".nmea", ".gpx")):
            os.remove(f"{folder}/{file}")


def write(path, comments, rows):
    os.remove(path)  # it may be a hard link to the original
    with open(path, "w", encoding="utf-8") as out:
        out.write("\n".join(comments + [" ".join(row) for row in rows]) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project")
    parser.add_argument("run")
    parser.add_argument("--frames", default="100,200,400,800")
    parser.add_argument("--work", help="folder to work in, kept; default: a temporary one")
    args = parser.parse_args()
    work = args.work or tempfile.mkdtemp(prefix="trigpoint-length-")
    print("| frames | wall s | CPU s | wall ms a frame | peak MiB | of localize itself |\n|---|---|---|---|---|---|")
    for frames in map(int, args.frames.split(",")):
        project = os.path.join(work, str(frames))
        copy_project(args.project, project, [args.run])
        make_run(project, args.run, frames)
        with open(os.path.join(work, f"{frames}.log"), "w", encoding="utf-8") as log:
            cost = run([program(), "localize", project, "--run", args.run], log)
        with open(os.path.join(project, "results", "localize", args.run, "manifest.json"), encoding="utf-8") as manifest:
            own = json.load(manifest)["peak_memory_bytes"] / 2**20
        print(f"| {frames} | {cost['wall']:.1f} | {cost['cpu']:.1f} | {1000 * cost['wall'] / frames:.0f} | {cost['memory']:.0f} | {own:.0f} |", flush=True)
    if not args.work:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
