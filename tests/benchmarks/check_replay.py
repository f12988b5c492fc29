#!/usr/bin/env python3
"""A site copied at the speed of its recording while `trigpoint check --watch` looks on.

    check_replay.py PROGRAM SITE WORK [--rate 10] [--survey SURVEY/tags.csv]

Tables are there from the beginning, pictures of the runs arrive one after the other, `rate` a second, then the photo
sets. Prints how far behind the check was, what it found at a quarter, half, three quarters and the end, and, with the
tags.csv of a survey of the same site, its sigmas beside the predicted ones.
"""
import argparse
import csv
import json
import os
import shutil
import signal
import statistics
import subprocess
import time


def rows(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def looked_at(log):
    try:
        with open(log, "rb") as file:
            return max(0, file.read().count(b"\n") - 1)
    except FileNotFoundError:
        return 0


def wait_for_summary(path, pictures, seconds):
    end = time.time() + seconds
    while time.time() < end:
        try:
            with open(path, encoding="utf-8") as file:
                summary = json.load(file)
            if summary["pictures"] >= pictures and summary["waiting"] == 0:
                return summary
        except (FileNotFoundError, json.JSONDecodeError):
            pass
        time.sleep(0.2)
    raise SystemExit(f"no summary of {pictures} pictures within {seconds} s")


def show(share, summary):
    print(f"== {share}: {summary['light']}, {summary['pictures']} pictures, "
          f"{summary['planned_tags_seen']} of {summary['planned_tags']} planned tags")
    for finding in summary["findings"]:
        if finding["light"] != "green":
            print(f"  {finding['light']:5} {finding['topic']}: {finding['text']}")
    for advice in summary["next"]:
        print(f"  next: {advice['what']} ({advice['why']})")


def compare(predicted, survey):
    stated = {row["tag_id"]: row for row in rows(survey)}
    ratios = []
    for row in rows(predicted):
        other = stated.get(row["tag_id"])
        if not other or not row["sigma_x_m"] or not other["sigma_x_m"]:
            continue
        p, s = (sum(float(r[f"sigma_{a}_m"]) ** 2 for a in "xyz") ** 0.5 for r in (row, other))
        ratios.append(p / s)
        print(f"  tag {row['tag_id']}: predicted {1e3 * p:.2f} mm, survey {1e3 * s:.2f} mm, ratio {p / s:.3f}")
    print(f"  ratio: median {statistics.median(ratios):.3f}, {min(ratios):.3f} to {max(ratios):.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("program")
    parser.add_argument("site")
    parser.add_argument("work")
    parser.add_argument("--rate", type=float, default=10)
    parser.add_argument("--survey")
    a = parser.parse_args()
    site = os.path.join(a.work, "site")
    shutil.rmtree(site, ignore_errors=True)
    shutil.copytree(a.site, site, ignore=lambda folder, names: [
        n for n in names if n in ("results", "photos") or (os.path.basename(folder) == "images" and "runs" in folder)])
    pictures = []
    for run in sorted(os.listdir(os.path.join(a.site, "runs"))):
        folder = os.path.join("runs", run, "images")
        os.makedirs(os.path.join(site, folder), exist_ok=True)
        pictures += [os.path.join(folder, name) for name in sorted(os.listdir(os.path.join(a.site, folder)))]
    out = os.path.join(site, "results", "check")
    with open(os.path.join(a.work, "watch.txt"), "w", encoding="utf-8") as log:
        watch = subprocess.Popen([a.program, "check", site, "--watch"], stdout=log, stderr=log)
        try:
            done, behind, begun = 0, [], time.time()
            for quarter in (1, 2, 3, 4):
                until = len(pictures) * quarter // 4
                start, first = time.time(), done
                for picture in pictures[first:until]:
                    shutil.copyfile(os.path.join(a.site, picture), os.path.join(site, picture))
                    done += 1
                    behind.append(done - looked_at(os.path.join(out, "pictures.jsonl")))
                    time.sleep(max(0, start + (done - first) / a.rate - time.time()))
                begun_waiting = time.time()
                summary = wait_for_summary(os.path.join(out, "summary.json"), done, 300)
                print(f"{time.time() - begun_waiting:.1f} s after the last picture of this quarter all of it is judged")
                show(f"{quarter}/4", summary)
            print(f"{len(pictures)} pictures at {a.rate:g} a second, behind by {statistics.median(behind)} pictures "
                  f"(median), {max(behind)} at most; {time.time() - begun:.0f} s in all")
            if os.path.isdir(os.path.join(a.site, "photos")):
                shutil.copytree(os.path.join(a.site, "photos"), os.path.join(site, "photos"))
                begun_waiting = time.time()
                sets = len(os.listdir(os.path.join(site, "photos")))
                while sum(f["topic"] == "photo sets" for f in summary["findings"]) < sets:
                    if time.time() - begun_waiting > 300:
                        raise SystemExit("the photo sets were not judged within 300 s")
                    time.sleep(0.5)
                    summary = wait_for_summary(os.path.join(out, "summary.json"), done, 300)
                print(f"photo sets judged after {time.time() - begun_waiting:.1f} s")
            show("end", summary)
            for finding in summary["findings"]:
                if finding["light"] == "green":
                    print(f"  green {finding['topic']}: {finding['text']}")
            if a.survey:
                compare(os.path.join(out, "tags.csv"), a.survey)
        finally:
            watch.send_signal(signal.SIGINT)
            watch.wait()


if __name__ == "__main__":
    main()
