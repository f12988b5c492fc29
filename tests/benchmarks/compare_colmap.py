#!/usr/bin/env python3
"""COLMAP and trigpoint on the same runs, one after the other on this machine, against truth: one table.

    compare_colmap.py PROJECT:RUN[:TRUTH] ... [--colmap PATH] [--modes incremental,global,rig] [--work DIR] [--skip-colmap]

TRUTH is a folder with runs/<run>_cameras.tum (world_from_cam) and panoramas_<run>.tum or panoramas.tum (first column: the
station's number); default: PROJECT_truth, if it is there.

    compare_colmap.py lot_a:run1 kitti_00:run1 strecha/fountain_P11:run1 strecha/herz_jesu_P8:run1 heidelberg:front heidelberg:back

COLMAP (apt install colmap, or --colmap with a program of any version from 3.8 to 4.x; options that were renamed are found by
its --help) gets the run's images with their calibration, held, and its defaults, on the CPU: features, exhaustive (up to 60
images) or sequential matching, mapping. Modes: `incremental` (mapper); `global` (global_mapper, from 4.0), with features and
matches of its own, so that each row has all its costs; `rig` (rig_configurator, from 3.12): the views of a panorama are one
frame of a rig whose rotations are held, and are mapped together with the images. Without --modes all that the program has; rig
only where there are panoramas. Else, after the mapping, the references as images: geotagged photos, or the same
views of the panoramas that localize uses (8 of 90 deg), each matched with every image (up to 60) or every fifth, registered,
and all adjusted together. A panorama is where its views are in the mean, weighted by the points each sees. Of several models
the largest counts. trigpoint localizes the run cold, views and features included, with odometry and geotags, which COLMAP has
no use for. Cutting the views is not counted for COLMAP. A step of COLMAP that fails ends its row with the reason.

Accuracy: cameras after a similarity fit to the truth (root mean square, m; COLMAP has no scale) and, for trigpoint, after a
rigid one; rotations after the similarity fit (median, deg); references after the cameras' similarity fit (median and largest,
m). Completeness: images, references, points. CPU and wall seconds, peak MiB; the last column is COLMAP's CPU time in units of
trigpoint's. Wall times mean something on an otherwise idle machine only; the load average before is printed.
"""
import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

from measure import copy_project, link, program, read_rows, run
from score_lot import panoramas_of


def camera_of(camchain):
    """COLMAP's model and parameters of the first camera; its pixels count from the corner of the first one."""
    with open(camchain, encoding="utf-8") as text:
        content = text.read()
    def numbers(key):
        return [float(v) for v in re.search(key + r":\s*\[([^\]]*)\]", content).group(1).split(",")]
    fx, fy, cx, cy = numbers("intrinsics")
    distortion = numbers("distortion_coeffs")
    model = "OPENCV_FISHEYE" if "equidistant" in content else "OPENCV" if any(distortion) else "PINHOLE"
    return model, [fx, fy, cx + 0.5, cy + 0.5] + ([] if model == "PINHOLE" else distortion)


class Colmap:
    """A program of some version: which commands it has and what their options are called."""

    def __init__(self, path):
        self.path = path
        text = self.says("help")
        self.version = (re.search(r"COLMAP\s+(\d[\w.]*)", text) or ["", "of unknown version"])[1]
        self.commands = set(re.findall(r"^\s+([a-z0-9_]+)\s*$", text, re.M))
        self.known = {}

    def says(self, *words):
        done = subprocess.run([self.path, *words], capture_output=True, text=True, check=False, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
        return done.stdout + done.stderr

    def command(self, name, options, choices=()):
        """`choices`: (names of which the first that is known is meant, value); one that has none of them is left out."""
        if name not in self.known:
            self.known[name] = set(re.findall(r"--([\w.]+)", self.says(name, "--help")))
        words = [self.path, name]
        for option, value in options.items():
            words += [f"--{option}", str(value)]
        for names, value in choices:
            option = next((n for n in names if n in self.known[name]), None)
            if option:
                words += [f"--{option}", str(value)]
        return words

    def modes(self):
        return ["incremental"] + ["global"] * ("global_mapper" in self.commands) + ["rig"] * ("rig_configurator" in self.commands)


NO_GPU = ((("SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"), 0), (("SiftMatching.use_gpu", "FeatureMatching.use_gpu"), 0))


def calibration_held(prefix):
    return [((f"{prefix}.ba_refine_{what}", f"{prefix}.refine_{what}"), 0) for what in ("focal_length", "principal_point", "extra_params")]


def feature_command(colmap, database, images, names, model, params, work):
    """Without `params` COLMAP takes each image's focal length from its EXIF."""
    listing = os.path.join(work, "list.txt")
    with open(listing, "w", encoding="utf-8") as out:
        out.write("\n".join(names) + "\n")
    camera = ["--ImageReader.single_camera", "1", "--ImageReader.camera_model", model, "--ImageReader.camera_params", ",".join(f"{v:.9g}" for v in params)]
    return colmap.command("feature_extractor", {"database_path": database, "image_path": images, "image_list_path": listing}, NO_GPU) + (camera if params else [])


def rotation(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def read_tum(path):
    """Rounded time -> (centre, rotation)."""
    poses = {}
    for row in read_rows(path)[1]:
        v = np.array(row, float)
        poses[round(v[0], 4)] = (v[1:4], rotation(v[4:8]))
    return poses


def fit(source, target, scaled):
    """Umeyama 1991: target = s R source + t."""
    a, b = np.array(source), np.array(target)
    am, bm = a.mean(0), b.mean(0)
    u, d, vt = np.linalg.svd((b - bm).T @ (a - am) / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    r = u @ sign @ vt
    s = (d * np.diag(sign)).sum() / ((a - am) ** 2).sum() * len(a) if scaled else 1.0
    return s, r, bm - s * r @ am


def errors(estimate, truth, scaled):
    """Root mean square and median rotation error after a fit, and the fit."""
    common = sorted(set(estimate) & set(truth))
    if len(common) < 3:
        return None
    s, r, t = fit([estimate[k][0] for k in common], [truth[k][0] for k in common], scaled)
    d = [np.linalg.norm(s * r @ estimate[k][0] + t - truth[k][0]) for k in common]
    angles = [np.degrees(np.arccos(np.clip((np.trace((r @ estimate[k][1]).T @ truth[k][1]) - 1) / 2, -1, 1))) for k in common]
    return {"rmse": float(np.sqrt(np.mean(np.square(d)))), "deg": float(np.median(angles)), "fit": (s, r, t), "count": len(common)}


class Failed(Exception):
    """A step of COLMAP that ended with an error."""


def step(steps, title, command, log):
    cost = run(command, log, check=False)
    before = steps.get(title, {"wall": 0, "cpu": 0, "memory": 0})  # one step may take several calls
    steps[title] = {"wall": before["wall"] + cost["wall"], "cpu": before["cpu"] + cost["cpu"], "memory": max(before["memory"], cost["memory"])}
    if cost["code"] != 0:
        raise Failed(f"{title}: exit code {cost['code']}")


def panorama_errors(places, truth, transform):
    s, r, t = transform
    return [float(np.linalg.norm(s * r @ places[k] + t - truth[k])) for k in sorted(places) if k in truth]


def station_number(name):
    return int("".join(re.findall(r"\d", name)) or -1)


def read_images(folder):
    """COLMAP's images.txt: name -> (centre, world_from_cam, number of points)."""
    images = {}
    with open(os.path.join(folder, "images.txt"), encoding="utf-8") as text:
        lines = [line.rstrip("\n") for line in text if not line.startswith("#")]
    for head, points in zip(lines[::2], lines[1::2]):
        f = head.split()
        q = np.array([float(f[2]), float(f[3]), float(f[4]), float(f[1])])
        r = rotation(q).T
        images[" ".join(f[9:])] = (-r @ np.array(f[5:8], float), r, sum(1 for p in points.split()[2::3] if p != "-1"))
    return images


def put_references(project, images, log):
    """Views of panoramas or geotagged photos below images/; groups of (names, camera model, parameters)."""
    panoramas, photos = (os.path.join(project, name) for name in ("panoramas.csv", "photos.csv"))
    if os.path.exists(panoramas):
        run([program("write_views"), project, os.path.join(images, "views")], log)
        width, focal = map(float, read_rows(f"{images}/views/camera.txt")[1][0])
        views = sorted(f"views/{view}" for view in os.listdir(f"{images}/views") if view.endswith(".jpg"))
        return [(views, "SIMPLE_PINHOLE", [focal, width / 2, width / 2])]
    groups = {}
    if os.path.exists(photos):
        with open(photos, encoding="utf-8") as text:
            for row in csv.DictReader(line for line in text if not line.startswith("#")):
                name = f"views/{station_number(row['station'])}_0" + os.path.splitext(row["file"])[1]
                link(os.path.join(project, row["file"]), os.path.join(images, name))
                groups.setdefault(row.get("camera") or "", []).append(name)
    return [(names, *(camera_of(os.path.join(project, camera)) if camera else ("SIMPLE_RADIAL", []))) for camera, names in groups.items()]


def rig_views(images, views):
    """The views of panoramas in a folder for each view, as rigs want them, and the rig with the rotations of views.txt."""
    cameras, names = [], []
    for view, *q in read_rows(f"{images}/views/views.txt")[1]:
        prefix = f"rig/{view}/"
        cameras.append({"image_prefix": prefix, **({"cam_from_rig_rotation": [float(v) for v in q], "cam_from_rig_translation": [0, 0, 0]}
                                                  if cameras else {"ref_sensor": True})})
        for name in views:
            station, _, its = os.path.basename(name)[:-len(".jpg")].rpartition("_")
            if its == view:
                names.append(prefix + station + ".jpg")
                link(os.path.join(images, name), os.path.join(images, names[-1]))
    reference = np.array([float(v) for v in read_rows(f"{images}/views/views.txt")[1][0][1:]])
    for camera in cameras[1:]:
        camera["cam_from_rig_rotation"] = product(camera["cam_from_rig_rotation"], reference * [1, -1, -1, -1])
    return names, [{"cameras": cameras}]


def product(a, b):
    """Of quaternions w x y z: the rotation b, then a."""
    w, v, x, u = a[0], np.array(a[1:]), b[0], np.array(b[1:])
    return [float(w * x - v @ u), *map(float, w * u + x * v + np.cross(v, u))]


class Mapping:
    """One mode of COLMAP on one run, step by step in a folder of its own."""

    def __init__(self, colmap, mode, project, name, work, log):
        self.colmap, self.mode, self.work, self.log = colmap, mode, work, log
        self.images, self.database = os.path.join(work, "images"), os.path.join(work, "database.db")
        self.folder = os.path.join(project, "runs", name)
        shutil.copytree(self.folder, os.path.join(self.images, "run"), copy_function=link)
        self.references = put_references(project, self.images, log)
        self.rows = read_rows(f"{self.folder}/images.txt")[1]
        self.frames = [f"run/{row[1]}" for row in self.rows]
        self.steps, self.note, self.last = {}, "", None

    def step(self, title, name, options, choices=()):
        step(self.steps, title, self.colmap.command(name, options, choices), self.log)

    def features(self, title, names, camera, params):
        step(self.steps, f"features of {len(names)} {title}", feature_command(self.colmap, self.database, self.images, names, camera, params, self.work), self.log)

    def pairs(self, names):
        """References with images: all, or every fifth of many."""
        pairs = os.path.join(self.work, "pairs.txt")
        with open(pairs, "w", encoding="utf-8") as out:
            out.writelines(f"{view} {frame}\n" for view in names for frame in self.frames[::1 if len(self.frames) <= 60 else 5])
        self.step("matching of references", "matches_importer", {"database_path": self.database, "match_list_path": pairs, "match_type": "pairs"}, NO_GPU)

    def map(self):
        model = os.path.join(self.work, "model")
        os.makedirs(model)
        command, prefix = ("global_mapper", "GlobalMapper") if self.mode == "global" else ("mapper", "Mapper")
        held = calibration_held(prefix) + [((f"{prefix}.ba_refine_sensor_from_rig",), 0)]
        self.step("mapping", command, {"database_path": self.database, "image_path": self.images, "output_path": model}, held)
        models = sorted((m for m in os.listdir(model) if os.path.exists(f"{model}/{m}/images.bin")), key=lambda m: os.path.getsize(f"{model}/{m}/images.bin"))
        if not models:
            raise Failed("no model")
        if len(models) > 1:
            self.note = f"split into {len(models)} models, the largest shown"
        self.last = os.path.join(model, models[-1])

    def match(self):
        matcher = "exhaustive" if len(self.frames) <= 60 else "sequential"
        self.step(matcher + " matching", matcher + "_matcher", {"database_path": self.database}, NO_GPU)

    def run(self):
        self.features("images", self.frames, *camera_of(f"{self.folder}/camchain.yaml"))
        if self.mode == "rig":
            views, rig = rig_views(self.images, self.references[0][0])
            for camera in rig[0]["cameras"]:
                self.features("references", [v for v in views if v.startswith(camera["image_prefix"])], *self.references[0][1:])
            config = os.path.join(self.work, "rig.json")
            with open(config, "w", encoding="utf-8") as out:
                json.dump(rig, out)
            self.step("rig", "rig_configurator", {"database_path": self.database, "rig_config_path": config})
            self.match()
            if len(self.frames) > 60:
                self.pairs(views)
            self.map()
            return
        self.match()
        self.map()
        if self.references:
            self.register()

    def register(self):
        for group, camera, params in self.references:
            self.features("references", group, camera, params)
        self.pairs([name for group in self.references for name in group[0]])
        for out in ("registered", "adjusted"):
            os.makedirs(os.path.join(self.work, out))
        registered, adjusted = os.path.join(self.work, "registered"), os.path.join(self.work, "adjusted")
        self.step("registration of references", "image_registrator", {"database_path": self.database, "input_path": self.last, "output_path": registered},
                  calibration_held("Mapper"))
        self.step("joint adjustment", "bundle_adjuster", {"input_path": registered, "output_path": adjusted}, calibration_held("BundleAdjustment"))
        self.last = adjusted

    def answer(self):
        """Camera poses by time, reference positions by station, number of points."""
        if not self.last:
            return {}, {}, 0
        text = os.path.join(self.work, "text")
        os.makedirs(text)
        run(self.colmap.command("model_converter", {"input_path": self.last, "output_path": text, "output_type": "TXT"}), self.log)
        registered = read_images(text)
        stamp = {f"run/{row[1]}": round(float(row[0]), 4) for row in self.rows}
        cameras = {stamp[n]: (c, r) for n, (c, r, _) in registered.items() if n in stamp}
        sums = {}
        for n, (c, _, weight) in registered.items():
            station = os.path.basename(n).rsplit("_", 1)[0] if n.startswith("views/") else os.path.basename(n) if n.startswith("rig/") else None
            if station is not None:
                at = sums.setdefault(station_number(station.removesuffix(".jpg")), [np.zeros(3), 0])
                at[0] = at[0] + weight * c
                at[1] += weight
        return cameras, {k: v / w for k, (v, w) in sums.items() if w > 0}, count_points(self.last)


def run_colmap(colmap, mode, project, name, work, log):
    """Costs by step, camera poses by time, reference positions by station, points, and what is odd."""
    mapping = Mapping(colmap, mode, project, name, work, log)
    try:
        mapping.run()
    except Failed as failure:
        mapping.note = f"{mapping.note}; {failure}" if mapping.note else str(failure)
    return mapping.steps, *mapping.answer(), mapping.note


def count_points(folder):
    """Of a binary model: the number it begins with."""
    with open(os.path.join(folder, "points3D.bin"), "rb") as model:
        return int.from_bytes(model.read(8), "little")


def read_truth(folder, name):
    cameras = os.path.join(folder, "runs", f"{name}_cameras.tum")
    truth = read_tum(cameras) if os.path.exists(cameras) else {}
    panoramas = {}
    for file in (f"panoramas_{name}.tum", "panoramas.tum"):
        path = os.path.join(folder, file)
        if os.path.exists(path):
            panoramas = {int(float(row[0])): np.array(row[1:4], float) for row in read_rows(path)[1]}
            break
    return truth, panoramas


def row_text(title, system, cost, cameras, images, panoramas, wanted, points, truth, panorama_truth, note, ratio):
    similar = errors(cameras, truth, True)
    rigid = errors(cameras, truth, False) if system == "trigpoint" else None
    places = panorama_errors(panoramas, panorama_truth, similar["fit"]) if similar and panoramas else []
    def number(value, digits=4):
        return "" if value is None else f"{value:.{digits}f}"
    return (f"| {title} | {system} | {number(similar and similar['rmse'])} | {number(rigid and rigid['rmse'])} | {number(similar and similar['deg'], 3)} | "
            f"{len(cameras)} of {images} | {points} | {number(float(np.median(places)) if places else None)} | {number(max(places) if places else None)} | "
            f"{f'{len(panoramas)} of {wanted}' if wanted else ''} | {cost['cpu']:.0f} | {cost['wall']:.0f} | {cost['memory']:.0f} | {ratio} | {note} |")


def ours(project, name):
    folder = os.path.join(project, "results", "localize", name)
    panoramas = {}
    for row in panoramas_of(folder):
        if row["status"] == "localized" and row["odom_x"]:
            panoramas[station_number(row["station"])] = np.array([float(row[f"odom_{a}"]) for a in "xyz"])
    return read_tum(os.path.join(folder, "cameras_odom.tum")), panoramas, count_points(os.path.join(folder, "sparse"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", metavar="PROJECT:RUN[:TRUTH]")
    parser.add_argument("--work", help="folder to work in, kept; default: a temporary one")
    parser.add_argument("--skip-colmap", action="store_true", help="trigpoint alone")
    parser.add_argument("--colmap", default="colmap", metavar="PATH", help="program of COLMAP, any version from 3.8")
    parser.add_argument("--modes", help="of incremental, global, rig; default: all that the program has")
    args = parser.parse_args()
    if not args.skip_colmap and not shutil.which(args.colmap):
        sys.exit(f"{args.colmap} is not there: apt install colmap, or --colmap PATH")
    colmap = None if args.skip_colmap else Colmap(shutil.which(args.colmap))
    modes = [] if args.skip_colmap else args.modes.split(",") if args.modes else colmap.modes()
    for mode in modes:
        if mode not in colmap.modes():
            sys.exit(f"--modes {mode}: COLMAP {colmap.version} has {', '.join(colmap.modes())}")
    top = args.work or tempfile.mkdtemp(prefix="trigpoint-colmap-")
    print(f"load average before: {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores\n")
    print("| run | system | cameras, rmse sim3 m | rigid m | rotation median deg | images | points | references, median m | max m | references | CPU s | wall s | "
          "peak MiB | CPU ratio | |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    details = []
    for item in args.runs:
        source, name, *truth = item.split(":")
        source = source.rstrip("/")
        title = f"{os.path.basename(source)} {name}"
        work = os.path.join(top, title.replace(" ", "_"))
        os.makedirs(work)
        known = read_truth(truth[0] if truth else source + "_truth", name)
        project = os.path.join(work, "project")
        copy_project(source, project, [name])
        images = len(read_rows(os.path.join(project, "runs", name, "images.txt"))[1])
        wanted = 0
        for table in ("panoramas.csv", "photos.csv"):
            if wanted == 0 and os.path.exists(os.path.join(project, table)):
                wanted = len(read_rows(os.path.join(project, table))[1]) - 1
        with open(os.path.join(work, "trigpoint.log"), "w", encoding="utf-8") as log:
            cost = run([program(), "localize", project, "--run", name], log)
        print(row_text(title, "trigpoint", cost, *with_counts(ours(project, name), images, wanted), *known, "", ""), flush=True)
        for mode in modes:
            if mode == "rig" and not os.path.exists(os.path.join(project, "panoramas.csv")):
                continue
            system = f"COLMAP {colmap.version} {mode}"
            with open(os.path.join(work, f"colmap_{mode}.log"), "w", encoding="utf-8") as log:
                steps, *answer, note = run_colmap(colmap, mode, project, name, os.path.join(work, mode), log)
            total = {key: sum(s[key] for s in steps.values()) for key in ("cpu", "wall")}
            total["memory"] = max(s["memory"] for s in steps.values())
            print(row_text(title, system, total, *with_counts(answer, images, wanted), *known, note, f"{total['cpu'] / cost['cpu']:.1f}"), flush=True)
            details += [f"| {title} | {system} | {name_of} | {c['cpu']:.0f} | {c['wall']:.0f} | {c['memory']:.0f} |" for name_of, c in steps.items()]
    if details:
        print("\n| run | system | step | CPU s | wall s | peak MiB |\n|---|---|---|---|---|---|\n" + "\n".join(details))
    if not args.work:
        shutil.rmtree(top)


def with_counts(answer, images, wanted):
    cameras, panoramas, points = answer
    return cameras, images, panoramas, wanted, points


if __name__ == "__main__":
    main()
