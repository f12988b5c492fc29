#!/usr/bin/env python3
"""Time, memory and size of a report over many stations and runs, made from the results of a small project.

    report_scale.py TRIGPOINT SITE OUT [--stations 200] [--runs 50] [--pdf]

Copies the small tables of SITE (a project with results of localize and evaluate) into OUT as often as needed: stations
in a grid, runs with noise of their own; pictures, images and sparse models are links. Then runs `trigpoint report` on
it and prints one JSON object.
"""
import argparse
import csv
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import time


def read_csv(path):
    with open(path, encoding="utf-8") as f:
        return list(csv.DictReader(line for line in f if not line.startswith("#")))


def write_csv(path, comment, rows):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as f:
        if comment:
            f.write("# " + comment + "\n")
        writer = csv.DictWriter(f, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def link(source, target):
    os.makedirs(os.path.dirname(target), exist_ok=True)
    os.symlink(os.path.abspath(source), target)


def quantile(values, q):
    h = (len(values) - 1) * q
    low = int(h)
    return values[low] + (h - low) * (values[min(low + 1, len(values) - 1)] - values[low])


def make(site, out, stations, runs, rng):
    run = sorted(r for r in os.listdir(os.path.join(site, "results/localize")) if "@" not in r and r[0] != ".")[0]
    source = os.path.join(site, "results/localize", run)
    answers = [r for r in read_csv(os.path.join(source, "panoramas.csv")) if r["station"].startswith("S")]
    localized = [r for r in answers if r["status"] == "localized"]
    geotags = {r["station"]: r for r in read_csv(os.path.join(site, "panoramas.csv"))}
    shutil.copy(os.path.join(site, "origin.json"), out)
    shutil.copy(os.path.join(site, "tags.yaml"), out)
    names, places, rows = [], [], []
    for k in range(stations):
        base = localized[k % len(localized)]
        name, file = f"S{k:03}", f"panoramas/pano_{k:03}.jpg"
        link(os.path.join(site, base["panorama"]), os.path.join(out, file))
        names.append((name, file, base))
        places.append((float(base["x"]) + 45 * (k // len(localized) % 5), float(base["y"]) + 35 * (k // len(localized) // 5)))
        rows.append(dict(geotags[base["station"]], file=file, station=name))
    write_csv(os.path.join(out, "panoramas.csv"), "", rows)
    write_csv(os.path.join(out, "stations.csv"), "",
              [dict(station=n, tag_id=k, east_m=0, north_m=0, up_m=1, sigma_m=0.01) for k, (n, _, _) in enumerate(names)])
    matches = os.path.join(source, "matches.csv")
    matches = read_csv(matches) if os.path.exists(matches) else []
    errors = []
    for r in range(runs):
        this = f"run{r:02}"
        link(os.path.join(site, "runs", run), os.path.join(out, "runs", this))
        target = os.path.join(out, "results/localize", this)
        lines, kept = [], []
        for (name, file, base), (x, y) in zip(names, places):
            answered = rng.random() < 0.8
            line = dict(base, panorama=file, station=name, x=x + rng.gauss(0, 0.1), y=y + rng.gauss(0, 0.1))
            if not answered:
                line = {k: "" for k in base} | dict(panorama=file, station=name, status="rejected", reason="only 7 matches with points of the run",
                                                    view_matches=7, inliers=0, views=0, geotag_status="unused")
            lines.append(line)
            kept += [dict(m, panorama=file) for m in matches if answered and m["panorama"] == base["panorama"]][:200]
            for method in ("g1", "single"):
                for reference, kind in (("control", "absolute"), ("self", "relative")):
                    e = [rng.gauss(0, 0.15 if method == "single" else 0.4) for _ in range(3)]
                    row = dict(run=this, variant="", method=method, station=name, panorama=file, tag_id=names.index((name, file, base)), reference=reference,
                               kind=kind, status=line["status"], reason=line["reason"], error_3d_m="", error_h_m="", error_v_m="", de_m="", dn_m="", du_m="",
                               error_rot_deg="", sigma_e_m="", sigma_n_m="", sigma_u_m="", nees="", dof="")
                    if answered:
                        row.update(error_3d_m=sum(v * v for v in e) ** 0.5, error_h_m=(e[0] ** 2 + e[1] ** 2) ** 0.5, error_v_m=abs(e[2]), de_m=e[0],
                                   dn_m=e[1], du_m=e[2])
                        if method == "single":
                            row.update(sigma_e_m=0.15, sigma_n_m=0.15, sigma_u_m=0.15, nees=sum((v / 0.15) ** 2 for v in e), dof=3)
                    errors.append(row)
        write_csv(os.path.join(target, "panoramas.csv"), "trigpoint panoramas 1; frame=enu; datum=geotags; sigma=1", lines)
        if kept:
            write_csv(os.path.join(target, "matches.csv"), "trigpoint matches 1", kept)
        for file in ("cameras.csv", "cameras.tum", "cameras_odom.tum", "sparse"):
            link(os.path.join(source, file), os.path.join(target, file))
        manifest = json.load(open(os.path.join(source, "manifest.json"), encoding="utf-8"))
        json.dump(dict(manifest, name=this), open(os.path.join(target, "manifest.json"), "w", encoding="utf-8"))
    write_csv(os.path.join(out, "results/evaluate/errors.csv"), "trigpoint errors 1; unit=m; axes=enu; sigma=1", errors)
    groups = []
    for method, reference, kind in sorted({(e["method"], e["reference"], e["kind"]) for e in errors}):
        its = [e for e in errors if (e["method"], e["reference"], e["kind"]) == (method, reference, kind)]
        values = sorted(e["error_3d_m"] for e in its if e["error_3d_m"] != "")
        groups.append(dict(variant="", method=method, reference=reference, kind=kind, shares_evidence=reference == "self", attempts=len(its), answers=len(values),
                           median_interval_m=[quantile(values, 0.45), quantile(values, 0.55)], p90_interval_m=None,
                           error_3d=dict(over_answers=dict(median_m=quantile(values, 0.5), p90_m=quantile(values, 0.9), mean_m=sum(values) / len(values), max_m=values[-1]),
                                         over_attempts=dict(median_m=quantile(values, 0.6), p90_m=None)),
                           cumulative=[dict(error_m=v, share=(i + 1) / len(its), low=max(0, (i + 1) / len(its) - 0.05), high=min(1, (i + 1) / len(its) + 0.05))
                                       for i, v in enumerate(values)],
                           nees=dict(count=len(values), mean_per_dof=1.0, bounds=[0.95, 1.05]), estimate_rests_on=[], reference_rests_on=[]))
    json.dump(dict(schema="trigpoint evaluate 1", confidence=0.95, unit="m", groups=groups), open(os.path.join(out, "results/evaluate/summary.json"), "w", encoding="utf-8"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trigpoint")
    parser.add_argument("site")
    parser.add_argument("out")
    parser.add_argument("--stations", type=int, default=200)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--pdf", action="store_true")
    options = parser.parse_args()
    if not os.path.exists(options.out):
        os.makedirs(options.out)
        make(options.site, options.out, options.stations, options.runs, random.Random(1))
    shutil.rmtree(os.path.join(options.out, "results/report"), ignore_errors=True)
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    begun = time.time()
    subprocess.run([options.trigpoint, "report", options.out, "--quiet"] + ["--pdf"] * options.pdf, check=True, env=environment)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    report = os.path.join(options.out, "results/report")
    print(json.dumps(dict(stations=options.stations, runs=options.runs, wall_s=round(time.time() - begun, 1), cpu_s=round(usage.ru_utime + usage.ru_stime, 1),
                          peak_mib=round(usage.ru_maxrss / 1024, 1), html_mb=round(os.path.getsize(os.path.join(report, "index.html")) / 1e6, 2),
                          pdf_mb=round(os.path.getsize(os.path.join(report, "report.pdf")) / 1e6, 2) if options.pdf else None)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
