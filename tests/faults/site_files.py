"""Reads and rewrites the files of a project folder: what the faults of faults.py are made of."""
import csv
import math
import os
import pathlib
import re

import numpy as np


class NotApplicable(Exception):
    """The project has no such file or too little in it."""


def rotation(q):
    """3 x 3 of a quaternion x y z w."""
    x, y, z, w = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def quaternion(r):
    """x y z w of a 3 x 3 rotation."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
                  [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r.trace()]]) / 3
    return np.linalg.eigh(k, "L")[1][:, 3]


def turn(axis, degrees):
    """Rotation about an axis (0, 1, 2)."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    r = np.eye(3)
    r[i, i] = r[j, j] = c
    r[i, j], r[j, i] = -s, s
    return r


class Pose:
    def __init__(self, stamp, t, q):
        self.stamp, self.t, self.r = stamp, np.array(t, float), rotation(q)


class Project:
    """A folder whose files may be links to those of the good project: they are replaced, never changed in place."""

    def __init__(self, folder, run):
        self.dir = pathlib.Path(folder)
        self.run = self.dir / "runs" / run

    def path(self, name):
        """A file of the run, else of the site."""
        path = self.run / name
        path = path if path.exists() else self.dir / name
        if not path.exists():
            raise NotApplicable(name)
        return path

    def text(self, name):
        return self.path(name).read_text()

    def write(self, path, content):
        path = pathlib.Path(path)
        if path.exists() or path.is_symlink():
            path.unlink()
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content)

    def edit(self, name, change):
        path = self.path(name)
        before = path.read_text()
        after = change(before)
        if after == before:
            raise NotApplicable(name)
        self.write(path, after)

    def lines(self, name):
        """Comments and rows of a text file."""
        lines = [line for line in self.text(name).splitlines() if line.strip()]
        return [x for x in lines if x.startswith("#")], [x for x in lines if not x.startswith("#")]

    def rows(self, name, change):
        """Changes the rows of a text file without header (comments stay)."""
        comments, rows = self.lines(name)
        self.write(self.path(name), "\n".join(comments + list(change(rows))) + "\n")

    # Trajectories

    def odometry(self):
        _, rows = self.lines("odometry.tum")
        poses = []
        for row in rows:
            v = [float(x) for x in row.split()]
            poses.append(Pose(row.split()[0], v[1:4], v[4:8]))
        return poses

    def write_odometry(self, rows, header="# timestamp tx ty tz qx qy qz qw"):
        self.write(self.run / "odometry.tum", "\n".join([header, *rows]) + "\n")

    def poses(self, change):
        """Changes every pose by change(k, pose) -> (t, 3 x 3) or None to drop it."""
        rows = []
        for k, pose in enumerate(self.odometry()):
            changed = change(k, pose)
            if changed is not None:
                rows.append(tum_row(pose.stamp, *changed))
        self.write_odometry(rows)

    # Tables

    def table(self, name, change=None):
        """Rows of a CSV file with header as dictionaries; writes them back if `change` is given."""
        path = self.path(name)
        comments, rows = self.lines(name)
        table = list(csv.DictReader(rows))
        if not table:
            raise NotApplicable(name)
        if change is None:
            return table
        changed = change(table)
        table = table if changed is None else changed
        fields = list(table[0].keys())
        text = [",".join(fields)] + [",".join(str(row[f]) for f in fields) for row in table]
        self.write(path, "\n".join(comments + text) + "\n")
        return table

    def column(self, name, field, change):
        """Changes one column by change(value as number) -> value."""

        def edit(table):
            if field not in table[0]:
                raise NotApplicable(f"{name}: {field}")
            for row in table:
                row[field] = change(float(row[field]))

        self.table(name, edit)

    def panoramas(self):
        """Table of geotags: panoramas.csv, else photos.csv."""
        for name in ("panoramas.csv", "photos.csv"):
            if (self.dir / name).exists():
                return name
        raise NotApplicable("panoramas.csv")

    def images(self):
        _, rows = self.lines("images.txt")
        return [self.run / row.split()[1] for row in rows]


def tum_row(stamp, t, r):
    q = quaternion(r)
    return f"{stamp} " + " ".join(f"{v:.9f}" for v in [*t, *q])


def station_number(name):
    """A station as tables and truth write it: S057, S57, 57."""
    return re.sub(r"^S?0*(?=.)", "", name)


def copy_links(source, target):
    """Copies a folder with hard links: fast, and files are replaced, never changed in place."""
    for root, _, files in os.walk(source):
        to = pathlib.Path(target) / pathlib.Path(root).relative_to(source)
        to.mkdir(parents=True, exist_ok=True)
        for name in files:
            if name == ".lock":  # a link would lock both
                continue
            os.link(pathlib.Path(root) / name, to / name)
