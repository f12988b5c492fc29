#!/usr/bin/env python3
"""Cuts this example site from the full lot it is a part of, and renders a calibration board.

    make.py FULL_LOT FULL_LOT_TRUTH OUT

Pictures of the runs and panoramas are copied as they are, photos are halved; tables are cut to the rows that belong to
what is kept. The board is seen by the runs' own camera, whose intrinsics are thus the truth of the calibration.
"""
import csv
import datetime
import math
import os
import shutil
import sys

import numpy as np
from PIL import Image

STATIONS = [57, 110, 71, 109]
# run here -> run of the full lot, first and last frame
RUNS = {"run1": ("run1", 0, 92), "run2": ("run3", 100, 123)}
PHOTOS = ("station_110", range(1, 15))  # the level circle of the set's two
# The runs' camera (camchain.yaml), and the board: checkerboard:9x6:0.04.
WIDTH, HEIGHT, FOCAL = 960, 600, 402.767823
COLUMNS, ROWS, SQUARE_M = 9, 6, 0.04


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


def halve_photos(source, target, truth, truth_out):
    """2 x 2 pixels to one, EXIF kept: a focal length in millimetres of 35 mm film holds at any size."""
    os.makedirs(target, exist_ok=True)
    for number in PHOTOS[1]:
        photo = Image.open(f"{source}/IMG_{number:04d}.jpg")
        photo.reduce(2).save(f"{target}/IMG_{number:04d}.jpg", quality=85, exif=photo.info["exif"])
    kept = [line for line in lines(truth) if line.startswith("#") or int(line.split()[0]) in PHOTOS[1]]
    write(truth_out, [kept[0].replace("1600x1200, focal 1331.4236 px", "800x600, focal 665.7118 px")] + kept[1:])


def rotation(axis, angle):
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def board_picture(cam_from_board, centre, random):
    """Grey picture of the board, 4 x 4 rays a pixel, in front of a plain wall."""
    samples = 4
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    picture = np.zeros((HEIGHT, WIDTH))
    normal = cam_from_board[:, 2]
    for dv in steps:
        for du in steps:
            u, v = np.meshgrid(np.arange(WIDTH) + du, np.arange(HEIGHT) + dv)
            rays = np.stack([(u - (WIDTH - 1) / 2) / FOCAL, (v - (HEIGHT - 1) / 2) / FOCAL, np.ones_like(u)], -1)
            hits = rays * ((normal @ centre) / (rays @ normal))[..., None] - centre
            x, y = (hits @ cam_from_board[:, i] / SQUARE_M + n / 2 for i, n in ((0, COLUMNS + 1), (1, ROWS + 1)))
            inside = (x > 0) & (x < COLUMNS + 1) & (y > 0) & (y < ROWS + 1)
            paper = (x > -1) & (x < COLUMNS + 2) & (y > -1) & (y < ROWS + 2)
            dark = inside & ((np.floor(x) + np.floor(y)) % 2 == 0)
            picture += np.where(dark, 40, np.where(paper, 215, 120 + 30 * rays[..., 1]))
    return np.clip(picture / samples ** 2 + random.normal(0, 1, picture.shape), 0, 255).astype(np.uint8)


def render_boards(target):
    """Boards all over the picture, near and far, tilted by up to 35 deg."""
    os.makedirs(target, exist_ok=True)
    random = np.random.default_rng(1)
    corners = np.array([[x, y, 0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * [
        (COLUMNS + 1) * SQUARE_M, (ROWS + 1) * SQUARE_M, 0]
    places = [(u, v) for v in (0.22, 0.5, 0.78) for u in (0.2, 0.4, 0.6, 0.8)]
    for number, (u, v) in enumerate(places, 1):
        while True:
            distance = random.uniform(0.35, 0.6)
            ray = np.array([(u - 0.5) * WIDTH / FOCAL, (v - 0.5) * HEIGHT / FOCAL, 1])
            direction = random.uniform(0, 2 * math.pi)
            turned = rotation((math.cos(direction), math.sin(direction), 0), random.uniform(0.2, 0.6)) @ rotation(
                (0, 0, 1), random.uniform(-0.3, 0.3))
            seen = corners @ turned.T + distance * ray
            pixels = seen[:, :2] / seen[:, 2:] * FOCAL + [(WIDTH - 1) / 2, (HEIGHT - 1) / 2]
            if seen[:, 2].min() > 0.1 and (pixels > 4).all() and (pixels < [WIDTH - 5, HEIGHT - 5]).all():
                break
        Image.fromarray(board_picture(turned, distance * ray, random)).save(f"{target}/board_{number:02d}.jpg",
                                                                            quality=90)


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
    name = PHOTOS[0]
    halve_photos(f"{full}/photos/{name}", f"{out}/photos/{name}", f"{truth}/photos/{name}.tum",
                 f"{out}/truth/photos/{name}.tum")
    render_boards(f"{out}/board")
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
