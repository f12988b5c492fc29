#!/usr/bin/env python3
"""Trigpoint, Hugin's command line and OpenCV's Stitcher on the same photos.

A third of Trigpoint's verified matches is kept apart (whole tracks, used by none of the three: Hugin's control points
within 3 px of one are removed). Each says where a point of the first photo lies in the second; the error is the distance
from where it was found. Prints one JSON object; CPU seconds are those of the programs themselves.

  compare_stitchers.py PHOTOS_DIR [--trigpoint bin/trigpoint] [--opencv bin/opencv_stitcher] [--width 4096] [--skip-blend]

Needs hugin-tools and enblend (not part of the product).
"""
import argparse
import csv
import json
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile

import numpy as np


def run(command, **kwargs):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **kwargs)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done, cpu


def rms(errors):
    """Of one coordinate, px; the median distance beside it; how many of the matches it could predict."""
    good = [e for e in errors if e is not None and math.isfinite(e)]
    if not good:
        return {"rms_px": None, "median_px": None, "predicted": 0, "of": len(errors)}
    g = np.array(good)
    # Without the worst hundredth: a wrong match among the held out ones is nobody's error.
    trimmed = np.sort(g)[: max(1, int(0.99 * len(g)))]
    return {"rms_px": round(float(np.sqrt((g**2).mean() / 2)), 3),
            "rms_of_99_percent_px": round(float(np.sqrt((trimmed**2).mean() / 2)), 3),
            "median_px": round(float(np.median(g)), 3), "predicted": len(good), "of": len(errors)}


def trigpoint(binary, photos, width, work):
    site = os.path.join(work, "site", "photos", "set")
    os.makedirs(site)
    for photo in photos:
        os.symlink(os.path.abspath(photo), os.path.join(site, os.path.basename(photo)))
    root = os.path.join(work, "site")
    held = {}
    # Matches are held out in a run of its own; the time is that of the plain one.
    done, _ = run([binary, "stitch", root, "--quiet", "--set", "rig.hold_out=0.333", "--set", "compose=false"])
    if done.returncode != 0:
        return None, None, done.stderr
    with open(os.path.join(root, "results", "stitch", "set", "held_out.csv")) as f:
        held = list(csv.DictReader(line for line in f if not line.startswith("#")))
    done, cpu = run([binary, "stitch", root, "--quiet", "--threads", "1", "--set", f"panorama.width={width}"])
    with open(os.path.join(root, "results", "stitch", "set", "rig.json")) as f:
        placed = sum(1 for p in json.load(f)["photos"] if p["placed"])

    def error(row, u, v):
        if not row[u]:
            return None
        return math.hypot(float(row[u]) - float(row["u_b"]), float(row[v]) - float(row["v_b"]))

    result = {"placed": placed, "cpu_seconds": round(cpu, 1),
              "own_centres": rms([error(r, "rig_u_b", "rig_v_b") for r in held]),
              "rotations_only": rms([error(r, "turn_u_b", "turn_v_b") for r in held])}
    return result, held, ""


def trafo(pto, image, points, reverse=False):
    """pano_trafo: photo pixels to panorama pixels, or back."""
    if not points:
        return []
    text = "\n".join(f"{x:.6f} {y:.6f}" for x, y in points) + "\n"
    command = ["pano_trafo"] + (["-r"] if reverse else []) + [pto, str(image)]
    done = subprocess.run(command, input=text, stdout=subprocess.PIPE, text=True)
    out = []
    for line in done.stdout.splitlines():
        numbers = line.split()
        if len(numbers) >= 2:
            out.append((float(numbers[0]), float(numbers[1])))
    return out


def hugin(photos, held, width, work, blend):
    pto = os.path.join(work, "a.pto")
    times = {}

    def step(name, command):
        done, cpu = run(command, cwd=work)
        times[name] = round(cpu, 1)
        if done.returncode != 0:
            raise RuntimeError(f"{name}: {done.stderr[-300:]}")

    try:
        step("pto_gen", ["pto_gen", "-o", pto] + [os.path.abspath(p) for p in photos])
        step("cpfind", ["cpfind", "--multirow", "-n", "1", "-o", pto, pto])
        step("cpclean", ["cpclean", "-o", pto, pto])
        # Control points that are among those held out take no part.
        index = {os.path.basename(p): i for i, p in enumerate(photos)}
        near = {}
        for row in held:
            a, b = index[row["photo_a"]], index[row["photo_b"]]
            near.setdefault((a, b), []).append((float(row["u_a"]), float(row["v_a"])))
            near.setdefault((b, a), []).append((float(row["u_b"]), float(row["v_b"])))
        kept = []
        for line in open(pto):
            m = re.match(r"c n(\d+) N(\d+) x([-\d.]+) y([-\d.]+)", line)
            if m:
                there = near.get((int(m[1]), int(m[2])), [])
                if any(math.hypot(float(m[3]) - x, float(m[4]) - y) < 3 for x, y in there):
                    continue
            kept.append(line)
        open(pto, "w").writelines(kept)
        step("autooptimiser", ["autooptimiser", "-a", "-m", "-l", "-s", "-o", pto, pto])
        step("pano_modify", ["pano_modify", "--projection=2", "--fov=360x180", f"--canvas={width}x{width // 2}", "-o", pto, pto])
        text = open(pto).read()
        connected = len(photos)
        rows = []
        by_pair = {}
        for row in held:
            by_pair.setdefault((index[row["photo_a"]], index[row["photo_b"]]), []).append(row)
        errors = []
        for (a, b), rows in by_pair.items():
            pano = trafo(pto, a, [(float(r["u_a"]), float(r["v_a"])) for r in rows])
            back = trafo(pto, b, pano, reverse=True)
            if len(back) != len(rows):
                errors += [None] * len(rows)
                continue
            for r, (x, y) in zip(rows, back):
                e = math.hypot(x - float(r["u_b"]), y - float(r["v_b"]))
                errors.append(e if e < 200 else None)
        if blend:
            step("nona", ["nona", "-m", "TIFF_m", "-o", os.path.join(work, "n"), pto])
            layers = sorted(f for f in os.listdir(work) if re.match(r"n\d+\.tif", f))
            step("enblend", ["enblend", "-w", "-o", os.path.join(work, "hugin.tif")] + layers)
        return {"cpu_seconds": round(sum(times.values()), 1), "steps": times, "held_out": rms(errors),
                "photos": connected, "far_off": sum(1 for e in errors if e is None),
                "control_points": text.count("\nc n")}
    except (RuntimeError, OSError) as e:
        return {"error": str(e), "steps": times}


def opencv(binary, photos, held, work):
    done, _ = run([binary, os.path.join(work, "opencv.jpg")] + photos)
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        return {"error": done.stderr[-300:] or "no answer"}
    cameras = {c["index"]: c for c in answer["cameras"]}
    scale = answer["work_scale"]
    index = {os.path.basename(p): i for i, p in enumerate(photos)}
    errors = []
    for row in held:
        a, b = cameras.get(index[row["photo_a"]]), cameras.get(index[row["photo_b"]])
        if a is None or b is None:
            errors.append(None)
            continue

        def k(c):
            return np.array([[c["focal"], 0, c["ppx"]], [0, c["focal"] * c["aspect"], c["ppy"]], [0, 0, 1]])

        ray = np.array(a["r"]).reshape(3, 3) @ np.linalg.inv(k(a)) @ np.array(
            [(float(row["u_a"]) + 0.5) * scale - 0.5, (float(row["v_a"]) + 0.5) * scale - 0.5, 1])
        p = k(b) @ np.linalg.inv(np.array(b["r"]).reshape(3, 3)) @ ray
        if p[2] <= 0:
            errors.append(None)
            continue
        x, y = (p[0] / p[2] + 0.5) / scale - 0.5, (p[1] / p[2] + 0.5) / scale - 0.5
        e = math.hypot(x - float(row["u_b"]), y - float(row["v_b"]))
        errors.append(e if e < 200 else None)
    return {"status": answer["status"], "placed": len(cameras), "cpu_seconds": round(answer["cpu_seconds"], 1),
            "held_out": rms(errors)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos")
    parser.add_argument("--pattern", default=r".*\.(jpe?g|png|tiff?)$")
    parser.add_argument("--trigpoint", default="build/release/bin/trigpoint")
    parser.add_argument("--opencv", default="build/release/bin/opencv_stitcher")
    parser.add_argument("--width", type=int, default=4096)
    parser.add_argument("--skip-blend", action="store_true", help="leave out Hugin's nona and enblend (minutes)")
    options = parser.parse_args()
    photos = sorted(os.path.join(options.photos, f) for f in os.listdir(options.photos)
                    if re.match(options.pattern, f, re.I))
    work = tempfile.mkdtemp(prefix="stitchers_")
    try:
        ours, held, error = trigpoint(os.path.abspath(options.trigpoint), photos, options.width, work)
        if ours is None:
            sys.exit("trigpoint: " + error)
        result = {"photos": len(photos), "held_out_matches": len(held), "trigpoint": ours}
        if shutil.which("cpfind"):
            result["hugin"] = hugin(photos, held, options.width, work, not options.skip_blend)
        if os.path.exists(options.opencv):
            result["opencv"] = opencv(os.path.abspath(options.opencv), photos, held, work)
        print(json.dumps(result, indent=1))
    finally:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
