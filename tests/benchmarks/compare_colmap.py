#!/usr/bin/env python3
"""COLMAP and trigpoint on the same runs, one after the other on this machine, against truth: one table.

    compare_colmap.py PROJECT:RUN[:TRUTH] ... [--work DIR] [--skip-colmap]

TRUTH is a folder with runs/<run>_cameras.tum (world_from_cam) and panoramas_<run>.tum or panoramas.tum (first column: the
station's number); default: PROJECT_truth, if it is there.

    compare_colmap.py lot_a:run1 kitti_00:run1 strecha/fountain_P11:run1 strecha/herz_jesu_P8:run1 heidelberg:front heidelberg:back

COLMAP (apt install colmap) gets the run's images with their calibration, held, and its defaults, on the CPU: features,
exhaustive (up to 60 images) or sequential matching, mapping. Then the references as images: geotagged photos, or the same
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
import os
import re
import shutil
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


def feature_command(database, images, names, model, params, work):
    """Without `params` COLMAP takes each image's focal length from its EXIF."""
    listing = os.path.join(work, "list.txt")
    with open(listing, "w", encoding="utf-8") as out:
        out.write("\n".join(names) + "\n")
    camera = ["--ImageReader.single_camera", "1", "--ImageReader.camera_model", model, "--ImageReader.camera_params", ",".join(f"{v:.9g}" for v in params)]
    return ["colmap", "feature_extractor", "--database_path", database, "--image_path", images, "--image_list_path", listing,
            "--SiftExtraction.use_gpu", "0", *(camera if params else [])]


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
    steps[title] = cost
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


def run_colmap(project, name, work, log):
    """Costs by step, camera poses by time, reference positions by station, points, and what is odd."""
    images, database = os.path.join(work, "images"), os.path.join(work, "database.db")
    folder = os.path.join(project, "runs", name)
    shutil.copytree(folder, os.path.join(images, "run"), copy_function=link)
    references = put_references(project, images, log)
    rows = read_rows(f"{folder}/images.txt")[1]
    frames = [f"run/{row[1]}" for row in rows]
    steps, note, last = {}, "", None
    fixed = ["--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0"]
    try:
        step(steps, f"features of {len(frames)} images", feature_command(database, images, frames, *camera_of(f"{folder}/camchain.yaml"), work), log)
        matcher = "exhaustive" if len(frames) <= 60 else "sequential"
        step(steps, matcher + " matching", ["colmap", matcher + "_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"], log)
        model = os.path.join(work, "model")
        os.makedirs(model)
        step(steps, "mapping", ["colmap", "mapper", "--database_path", database, "--image_path", images, "--output_path", model, *fixed], log)
        models = sorted((m for m in os.listdir(model) if os.path.exists(f"{model}/{m}/images.bin")), key=lambda m: os.path.getsize(f"{model}/{m}/images.bin"))
        if not models:
            raise Failed("no model")
        if len(models) > 1:
            note = f"split into {len(models)} models, the largest shown"
        last = os.path.join(model, models[-1])
        if references:
            names = [name for group in references for name in group[0]]
            for group, camera, params in references:
                step(steps, f"features of {len(group)} references", feature_command(database, images, group, camera, params, work), log)
            pairs = os.path.join(work, "pairs.txt")
            with open(pairs, "w", encoding="utf-8") as out:
                out.writelines(f"{view} {frame}\n" for view in names for frame in frames[::1 if len(frames) <= 60 else 5])
            step(steps, "matching of references", ["colmap", "matches_importer", "--database_path", database, "--match_list_path", pairs, "--match_type",
                                                   "pairs", "--SiftMatching.use_gpu", "0"], log)
            for out in ("registered", "adjusted"):
                os.makedirs(os.path.join(work, out))
            step(steps, "registration of references", ["colmap", "image_registrator", "--database_path", database, "--input_path", last, "--output_path",
                                                       os.path.join(work, "registered"), *fixed], log)
            step(steps, "joint adjustment", ["colmap", "bundle_adjuster", "--input_path", os.path.join(work, "registered"), "--output_path",
                                             os.path.join(work, "adjusted"), "--BundleAdjustment.refine_focal_length", "0",
                                             "--BundleAdjustment.refine_extra_params", "0"], log)
            last = os.path.join(work, "adjusted")
    except Failed as failure:
        note = f"{note}; {failure}" if note else str(failure)
    if not last:
        return steps, {}, {}, 0, note
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
    return steps, cameras, {k: v / w for k, (v, w) in sums.items() if w > 0}, count_points(last), note


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
    args = parser.parse_args()
    if not args.skip_colmap and not shutil.which("colmap"):
        sys.exit("colmap is not installed: apt install colmap")
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
        if args.skip_colmap:
            continue
        with open(os.path.join(work, "colmap.log"), "w", encoding="utf-8") as log:
            steps, *answer, note = run_colmap(project, name, work, log)
        total = {key: sum(s[key] for s in steps.values()) for key in ("cpu", "wall")}
        total["memory"] = max(s["memory"] for s in steps.values())
        print(row_text(title, "COLMAP", total, *with_counts(answer, images, wanted), *known, note, f"{total['cpu'] / cost['cpu']:.1f}"), flush=True)
        details += [f"| {title} | {name_of} | {c['cpu']:.0f} | {c['wall']:.0f} | {c['memory']:.0f} |" for name_of, c in steps.items()]
    if details:
        print("\n| run | COLMAP's step | CPU s | wall s | peak MiB |\n|---|---|---|---|---|\n" + "\n".join(details))
    if not args.work:
        shutil.rmtree(top)


def with_counts(answer, images, wanted):
    cameras, panoramas, points = answer
    return cameras, images, panoramas, wanted, points


if __name__ == "__main__":
    main()
