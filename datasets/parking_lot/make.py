#!/usr/bin/env python3
"""Cuts this example site from the full lot it is a part of.

    make.py FULL_LOT FULL_LOT_TRUTH OUT

Pictures are copied as they are; tables are cut to the rows that belong to what is kept.
"""
import csv
import datetime
import math
import os
import shutil
import sys

STATIONS = [57, 110, 71, 109]
# run here -> run of the full lot, first and last frame
RUNS = {"run1": ("run1", 0, 92), "run2": ("run3", 100, 123)}


def lines(path):
    with open(path, encoding="utf-8") as text:
        return text.read().splitlines()


def write(path, rows):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as out:
        out.write("\n".join(rows) + "\n")


def copy(source, target):
    os.makedirs(os.path.dirname(target), exist_ok=True)
    shutil.copyfile(source, target)


def cut_table(source, target, keep):
    """Comments, the header, and the rows for which keep(row as a dictionary) holds."""
    comments = [line for line in lines(source) if line.startswith("#")]
    header, *rows = [line for line in lines(source) if line and not line.startswith("#")]
    kept = [row for row in rows if keep(dict(zip(header.split(","), next(csv.reader([row])))))]
    write(target, comments + [header] + kept)


def cut_times(source, target, first, last, header_rows=0):
    """Rows whose first field is a time in [first, last]."""
    rows, seen = [], 0
    for line in lines(source):
        if line.startswith("#") or seen < header_rows:
            seen += not line.startswith("#")
            rows.append(line)
        elif line.strip() and first <= float(line.replace(",", " ").split()[0]) <= last:
            rows.append(line)
    write(target, rows)


def cut_nmea(source, target, run_yaml, first, last):
    zero = next(line.split()[1] for line in lines(run_yaml) if line.startswith("time_zero_utc"))
    zero = datetime.datetime.fromisoformat(zero.replace("Z", "+00:00"))
    midnight = zero.replace(hour=0, minute=0, second=0, microsecond=0)
    offset = (zero - midnight).total_seconds()

    def time_of(sentence):
        field = sentence.split(",")[1]
        return int(field[:2]) * 3600 + int(field[2:4]) * 60 + float(field[4:]) - offset

    write(target, [line for line in lines(source) if line and first <= time_of(line) <= last])


def main(full, truth, out):
    for name in ("origin.json", "tags.yaml", "aerial.tif"):
        copy(os.path.join(full, name), os.path.join(out, name))
    cut_table(f"{full}/stations.csv", f"{out}/stations.csv", lambda row: int(row["tag_id"]) in STATIONS)
    cut_table(f"{full}/control_points.csv", f"{out}/control_points.csv", lambda row: int(row["tag_id"]) in STATIONS)
    cut_table(f"{full}/panoramas.csv", f"{out}/panoramas.csv", lambda row: int(row["station"][1:]) in STATIONS)
    cut_table(f"{truth}/tags.csv", f"{out}/truth/tags.csv", lambda row: int(row["tag_id"]) in STATIONS)
    for station in STATIONS:
        copy(f"{full}/panoramas/pano_{station:03d}.jpg", f"{out}/panoramas/pano_{station:03d}.jpg")
    write(f"{out}/truth/panoramas.tum", [line for line in lines(f"{truth}/panoramas.tum")
                                         if line.startswith("#") or int(line.split()[0]) in STATIONS])
    for run, (source, begin, end) in RUNS.items():
        here, there = f"{out}/runs/{run}", f"{full}/runs/{source}"
        comments = [line for line in lines(f"{there}/images.txt") if line.startswith("#")]
        frames = [line for line in lines(f"{there}/images.txt") if not line.startswith("#")][begin:end + 1]
        write(f"{here}/images.txt", comments + frames)
        for frame in frames:
            copy(f"{there}/{frame.split()[1]}", f"{here}/{frame.split()[1]}")
        first, last = (float(frame.split()[0]) for frame in (frames[0], frames[-1]))
        for name in ("camchain.yaml", "run.yaml"):
            copy(f"{there}/{name}", f"{here}/{name}")
        cut_times(f"{there}/odometry.tum", f"{here}/odometry.tum", first, last)
        if os.path.exists(f"{there}/gps.csv"):
            cut_times(f"{there}/gps.csv", f"{here}/gps.csv", first - 1, last + 1, header_rows=1)
        if os.path.exists(f"{there}/gps.nmea"):
            cut_nmea(f"{there}/gps.nmea", f"{here}/gps.nmea", f"{there}/run.yaml", first - 1, last + 1)
        cut_times(f"{truth}/runs/{source}_cameras.tum", f"{out}/truth/runs/{run}_cameras.tum", first, last)
    report(out)


def report(out):
    """Which stations each run passes: the distance of the nearest frame, frames within 12 m."""
    def positions(path):
        return {float(line.split()[0]): tuple(map(float, line.split()[1:4])) for line in lines(path) if line[0] != "#"}
    stations = positions(f"{out}/truth/panoramas.tum")
    for run in RUNS:
        cameras = positions(f"{out}/truth/runs/{run}_cameras.tum")
        for station, place in stations.items():
            distances = [math.dist(place, camera) for camera in cameras.values()]
            print(f"{run}: {len(cameras)} frames, S{station:.0f}: nearest {min(distances):.1f} m, "
                  f"{sum(d < 12 for d in distances)} frames within 12 m")


if __name__ == "__main__":
    main(*sys.argv[1:4])
