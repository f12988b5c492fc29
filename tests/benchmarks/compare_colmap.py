#!/usr/bin/env python3
"""COLMAP and trigpoint on the same run, one after the other on this machine.

    compare_colmap.py PROJECT RUN [--work DIR] [--skip-colmap]

COLMAP (apt install colmap) gets the run's images with their calibration and, as images, the same views of the
panoramas that localize uses (8 of 90 deg); features, sequential matching and mapping with its defaults, on the CPU.
trigpoint localizes the run cold, views and features included. Prints CPU and wall seconds of both and their ratio.
Cutting the views is not counted for COLMAP.
"""
import argparse
import os
import re
import shutil
import sys
import tempfile

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


def run_colmap(project, name, work):
    images, database = os.path.join(work, "images"), os.path.join(work, "database.db")
    folder = os.path.join(project, "runs", name)
    shutil.copytree(folder, os.path.join(images, "run"), copy_function=link)
    with open(os.path.join(work, "colmap.log"), "w", encoding="utf-8") as log:
        run([program("write_views"), project, os.path.join(images, "views")], log)
        views = sorted(name for name in os.listdir(f"{images}/views") if name.endswith(".jpg"))
        size, focal = map(float, read_rows(f"{images}/views/camera.txt")[1][0])
        frames = [f"run/{row[1]}" for row in read_rows(f"{folder}/images.txt")[1]]
        first = add_features(database, images, frames, *camera_of(f"{folder}/camchain.yaml"), log, work)
        second = add_features(database, images, [f"views/{view}" for view in views], "SIMPLE_PINHOLE",
                              [focal, size / 2, size / 2], log, work)
        steps = {f"features of {len(frames)} images": first, f"features of {len(views)} views": second}
        steps["sequential matching"] = run(["colmap", "sequential_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"], log)
        model = os.path.join(work, "model")
        os.makedirs(model)
        steps["mapping"] = run(["colmap", "mapper", "--database_path", database, "--image_path", images, "--output_path", model], log)
    return steps


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project")
    parser.add_argument("run")
    parser.add_argument("--work", help="folder to work in, kept; default: a temporary one")
    parser.add_argument("--skip-colmap", action="store_true", help="trigpoint alone")
    args = parser.parse_args()
    if not args.skip_colmap and not shutil.which("colmap"):
        sys.exit("colmap is not installed: apt install colmap")
    work = args.work or tempfile.mkdtemp(prefix="trigpoint-colmap-")
    os.makedirs(work, exist_ok=True)
    project = os.path.join(work, "project")
    copy_project(args.project, project, [args.run])
    with open(os.path.join(work, "trigpoint.log"), "w", encoding="utf-8") as log:
        ours = run([program(), "localize", project, "--run", args.run], log)
    print("| | step | CPU s | wall s | peak MiB |\n|---|---|---|---|---|")
    print(f"| trigpoint | localize, cold | {ours['cpu']:.0f} | {ours['wall']:.0f} | {ours['memory']:.0f} |", flush=True)
    if not args.skip_colmap:
        steps = run_colmap(project, args.run, work)
        for name, cost in steps.items():
            print(f"| COLMAP | {name} | {cost['cpu']:.0f} | {cost['wall']:.0f} | {cost['memory']:.0f} |")
        cpu, wall = (sum(cost[k] for cost in steps.values()) for k in ("cpu", "wall"))
        print(f"| COLMAP | sum | {cpu:.0f} | {wall:.0f} | |")
        print(f"| ratio | | {cpu / ours['cpu']:.1f} | {wall / ours['wall']:.1f} | |")
    if not args.work:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
