#!/usr/bin/env python3
"""COLMAP and trigpoint on the same runs, one after the other on this machine, against truth: one table.

    compare_colmap.py PROJECT:RUN[:TRUTH] ... [--work DIR] [--skip-colmap]

TRUTH is a folder with runs/<run>_cameras.tum (world_from_cam) and panoramas_<run>.tum or panoramas.tum (first column: the
station's number); default: PROJECT_truth, if it is there.

COLMAP (apt install colmap) gets the run's images with their calibration, held, and, as images, the same views of the
panoramas that localize uses (8 of 90 deg); features, exhaustive (up to 60 images) or sequential matching and mapping with
its defaults, on the CPU. The views of panoramas are registered by exhaustive matching of each with every fifth image.
trigpoint localizes the run cold, views and features included. Cutting the views is not counted for COLMAP.

Accuracy: cameras after a similarity fit to the truth (root mean square, m; COLMAP has no scale) and, for trigpoint, after a
rigid one; rotations after that fit (median, deg); panoramas after the cameras' fit (median and largest, m). Completeness:
images and panoramas answered. CPU and wall seconds, peak MiB.
"""
import argparse
import csv
import os
import re
import shutil
import sys
import tempfile

import numpy as np

from measure import copy_project, link, program, read_rows, run


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


def add_features(database, images, names, model, params, log, work):
    listing = os.path.join(work, "list.txt")
    with open(listing, "w", encoding="utf-8") as out:
        out.write("\n".join(names) + "\n")
    return run(["colmap", "feature_extractor", "--database_path", database, "--image_path", images, "--image_list_path", listing,
                "--ImageReader.single_camera", "1", "--ImageReader.camera_model", model,
                "--ImageReader.camera_params", ",".join(f"{v:.9g}" for v in params), "--SiftExtraction.use_gpu", "0"], log)


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


def run_colmap(project, name, work, log):
    images, database = os.path.join(work, "images"), os.path.join(work, "database.db")
    folder = os.path.join(project, "runs", name)
    shutil.copytree(folder, os.path.join(images, "run"), copy_function=link)
    steps, views = {}, []
    if os.path.exists(os.path.join(project, "panoramas.csv")):
        run([program("write_views"), project, os.path.join(images, "views")], log)
        views = sorted(view for view in os.listdir(f"{images}/views") if view.endswith(".jpg"))
    rows = read_rows(f"{folder}/images.txt")[1]
    frames = [f"run/{row[1]}" for row in rows]
    steps[f"features of {len(frames)} images"] = add_features(database, images, frames, *camera_of(f"{folder}/camchain.yaml"), log, work)
    matcher = "exhaustive" if len(frames) <= 60 else "sequential"
    steps[matcher + " matching"] = run(["colmap", matcher + "_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"], log)
    model = os.path.join(work, "model")
    os.makedirs(model)
    fixed = ["--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0"]
    steps["mapping"] = run(["colmap", "mapper", "--database_path", database, "--image_path", images, "--output_path", model, *fixed], log)
    def size(number):
        return os.path.getsize(os.path.join(model, number, "images.bin"))
    models = sorted(os.listdir(model), key=size)
    last = os.path.join(model, models[-1])
    if views:
        width, focal = map(float, read_rows(f"{images}/views/camera.txt")[1][0])
        steps[f"features of {len(views)} views"] = add_features(database, images, [f"views/{view}" for view in views], "SIMPLE_PINHOLE",
                                                                [focal, width / 2, width / 2], log, work)
        pairs = os.path.join(work, "pairs.txt")
        with open(pairs, "w", encoding="utf-8") as out:
            for view in views:
                for frame in frames[::1 if len(frames) <= 60 else 5]:
                    out.write(f"views/{view} {frame}\n")
        steps["matching of views"] = run(["colmap", "matches_importer", "--database_path", database, "--match_list_path", pairs, "--match_type", "pairs",
                                          "--SiftMatching.use_gpu", "0"], log)
        os.makedirs(os.path.join(work, "registered"))
        steps["registration of views"] = run(["colmap", "image_registrator", "--database_path", database, "--input_path", last, "--output_path",
                                              os.path.join(work, "registered"), *fixed], log)
        last = os.path.join(work, "registered")
    os.makedirs(os.path.join(work, "text"))
    run(["colmap", "model_converter", "--input_path", last, "--output_path", os.path.join(work, "text"), "--output_type", "TXT"], log)
    registered = read_images(os.path.join(work, "text"))
    stamp = {f"run/{row[1]}": round(float(row[0]), 4) for row in rows}
    cameras = {stamp[n]: (c, r) for n, (c, r, _) in registered.items() if n in stamp}
    sums = {}
    for n, (c, _, weight) in registered.items():
        if n.startswith("views/"):
            at = sums.setdefault(station_number(os.path.basename(n).rsplit("_", 1)[0]), [np.zeros(3), 0])
            at[0] = at[0] + weight * c
            at[1] += weight
    panoramas = {k: v / w for k, (v, w) in sums.items() if w > 0}
    return steps, cameras, panoramas, len(models)


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


def row_text(title, system, cost, cameras, images, panoramas, wanted, truth, panorama_truth, note):
    similar = errors(cameras, truth, True)
    rigid = errors(cameras, truth, False) if system == "trigpoint" else None
    places = panorama_errors(panoramas, panorama_truth, (rigid or similar)["fit"]) if similar and panoramas else []
    def number(value, digits=4):
        return "" if value is None else f"{value:.{digits}f}"
    return (f"| {title} | {system} | {number(similar and similar['rmse'])} | {number(rigid and rigid['rmse'])} | {number(similar and similar['deg'], 3)} | "
            f"{len(cameras)} of {images} | {number(float(np.median(places)) if places else None)} | {number(max(places) if places else None)} | "
            f"{f'{len(panoramas)} of {wanted}' if wanted else ''} | {cost['cpu']:.0f} | {cost['wall']:.0f} | {cost['memory']:.0f} | {note} |")


def ours(project, name):
    folder = os.path.join(project, "results", "localize", name)
    panoramas = {}
    with open(os.path.join(folder, "panoramas.csv"), encoding="utf-8") as text:
        for row in csv.DictReader(line for line in text if not line.startswith("#")):
            if row["status"] == "localized" and row["odom_x"]:
                panoramas[station_number(row["station"])] = np.array([float(row[f"odom_{a}"]) for a in "xyz"])
    return read_tum(os.path.join(folder, "cameras_odom.tum")), panoramas


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", metavar="PROJECT:RUN[:TRUTH]")
    parser.add_argument("--work", help="folder to work in, kept; default: a temporary one")
    parser.add_argument("--skip-colmap", action="store_true", help="trigpoint alone")
    args = parser.parse_args()
    if not args.skip_colmap and not shutil.which("colmap"):
        sys.exit("colmap is not installed: apt install colmap")
    top = args.work or tempfile.mkdtemp(prefix="trigpoint-colmap-")
    print("| run | system | cameras, rmse sim3 m | rigid m | rotation median deg | images | panoramas, median m | max m | panoramas | CPU s | wall s | "
          "peak MiB | |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|")
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
        if os.path.exists(os.path.join(project, "panoramas.csv")):
            wanted = len(read_rows(os.path.join(project, "panoramas.csv"))[1]) - 1
        elif os.path.exists(os.path.join(project, "photos.csv")):
            wanted = len(read_rows(os.path.join(project, "photos.csv"))[1]) - 1
        with open(os.path.join(work, "trigpoint.log"), "w", encoding="utf-8") as log:
            cost = run([program(), "localize", project, "--run", name], log)
        cameras, panoramas = ours(project, name)
        print(row_text(title, "trigpoint", cost, cameras, images, panoramas, wanted, *known, ""), flush=True)
        if args.skip_colmap:
            continue
        with open(os.path.join(work, "colmap.log"), "w", encoding="utf-8") as log:
            steps, cameras, panoramas, models = run_colmap(project, name, work, log)
        cost = {"cpu": sum(s["cpu"] for s in steps.values()), "wall": sum(s["wall"] for s in steps.values()), "memory": max(s["memory"] for s in steps.values())}
        note = "" if models == 1 else f"split into {models} models, the largest shown"
        print(row_text(title, "COLMAP", cost, cameras, images, panoramas, wanted if panoramas else 0, *known, note), flush=True)
        details += [f"| {title} | {step} | {c['cpu']:.0f} | {c['wall']:.0f} | {c['memory']:.0f} |" for step, c in steps.items()]
    if details:
        print("\n| run | COLMAP's step | CPU s | wall s | peak MiB |\n|---|---|---|---|---|\n" + "\n".join(details))
    if not args.work:
        shutil.rmtree(top)


if __name__ == "__main__":
    main()
