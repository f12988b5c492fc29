#!/usr/bin/env python3
"""Plants the faults of faults.py into copies of a good project and judges what the program makes of each.

  run_faults.py PROGRAM SITE [--truth DIR] [--run RUN] [--every N] [--features N] [--quick] [--only REGEX]
                [--json FILE [--resume]] [--jobs N] [--work DIR] [--combinations N] [--variations N]
  run_faults.py --table docs/faults.md FILE.json...

Verdicts: right (a result within its sigmas, nothing new said), warned (within its sigmas, with a warning), withheld (no
position on the Earth, with the cause), refused (exit 1 naming the cause, without a result). Failures: FALSE (a position
outside three of its stated sigmas, whatever the exit code), unnamed (refused or withheld without the cause), crashed.
--combinations draws one to three faults at once, --variations good projects (other stretches, noise and geotags), of
which few may be warned of or refused; both begin at --first. --json is written after every fault; --resume goes on with it.
"""
import argparse
import concurrent.futures
import csv
import hashlib
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import draws
import faults
from site_files import NotApplicable, Project, copy_links, rotation

GOOD = ("right", "warned", "withheld", "refused")
GATE = 3.0  # stated sigmas
ROUNDING_M = 0.005  # of what the truth is written in


def rows_of(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def header_of(path):
    return path.read_text().split("\n", 1)[0]


class Earth:
    """East, north, up about a site's true origin, of latitude, longitude, height."""

    A, E2 = 6378137.0, 6.69437999014e-3

    def __init__(self, latitude, longitude, height):
        lat, lon = math.radians(latitude), math.radians(longitude)
        self.origin = self.ecef(latitude, longitude, height)
        self.rotation = np.array([[-math.sin(lon), math.cos(lon), 0],
                                  [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)],
                                  [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)]])

    def ecef(self, latitude, longitude, height):
        lat, lon = math.radians(latitude), math.radians(longitude)
        n = self.A / math.sqrt(1 - self.E2 * math.sin(lat) ** 2)
        return np.array([(n + height) * math.cos(lat) * math.cos(lon), (n + height) * math.cos(lat) * math.sin(lon),
                         (n * (1 - self.E2) + height) * math.sin(lat)])

    def enu(self, row):
        place = self.ecef(float(row["latitude_deg"]), float(row["longitude_deg"]), float(row["height_m"]))
        return self.rotation @ (place - self.origin)


class Truth:
    def __init__(self, folder, site, run):
        self.cameras, self.panoramas, self.tags, self.attitudes = {}, {}, {}, {}
        rows = [line.split() for line in (site / "runs" / run / "images.txt").read_text().splitlines()
                if line and not line.startswith("#")]
        self.taken = {row[1]: row[0] for row in rows}
        origin = json.loads((site / "origin.json").read_text())
        self.earth = Earth(origin["lat"], origin["lon"], origin["alt"])
        for name in (f"runs/{run}_cameras.tum", f"{run}_cameras.tum"):
            if (folder / name).exists():
                self.cameras = self.poses(folder / name)
        for name in ("panoramas.tum", "photos.tum"):
            if (folder / name).exists():
                self.panoramas.update(self.poses(folder / name))
                self.attitudes.update(self.attitudes_of(folder / name))
        # A picture was taken where it was taken, whatever a faulty table says of it.
        table = site / "panoramas.csv"
        self.stations = {row["file"]: row.get("station", "") for row in rows_of(table)} if table.exists() else {}
        if (folder / "tags.csv").exists():
            for row in rows_of(folder / "tags.csv"):
                self.tags[row["tag_id"]] = np.array([float(row[k]) for k in "xyz"])

    def camera(self, row):
        """Where a picture was taken, whatever time a faulty list gives it; None where that is not known."""
        return self.cameras.get(f"{float(self.taken.get(row['image'], row['timestamp'])):.4f}")

    @staticmethod
    def lines(path):
        for line in path.read_text().splitlines():
            if line and not line.startswith("#"):
                name, *numbers = line.split()
                yield name if "." not in name else f"{float(name):.4f}", np.array(numbers, float)

    @classmethod
    def poses(cls, path):
        return {name: numbers[:3] for name, numbers in cls.lines(path)}

    @classmethod
    def attitudes_of(cls, path):
        """Heading (clockwise from north), pitch and roll in degrees, of cameras that look along z with y down."""
        result = {}
        for name, numbers in cls.lines(path):
            r = rotation(numbers[3:7])
            result[name] = np.degrees([np.arctan2(r[0, 2], r[1, 2]), np.arcsin(r[2, 2]), np.arctan2(-r[2, 0], -r[2, 1])])
        return result


def sigmas_off(error, sigma):
    """Largest error of an axis in stated sigmas."""
    return max((abs(e) - ROUNDING_M) / max(s, 1e-9) if abs(e) > ROUNDING_M else 0.0 for e, s in zip(error, sigma))


class Positions:
    """What a result states, against the truth."""

    def __init__(self):
        self.count, self.outside, self.worst, self.largest_m, self.squares = 0, 0, 0.0, 0.0, 0.0

    def add(self, error, sigma):
        self.squares += float(np.mean((np.asarray(error) / np.maximum(sigma, 1e-9)) ** 2))
        off = sigmas_off(error, sigma)
        self.count += 1
        self.outside += int(off > GATE)
        self.worst = max(self.worst, off)
        self.largest_m = max(self.largest_m, float(np.linalg.norm(error)))


def judge_localize(project, run, truth, positions):
    folder = project / "results" / "localize" / run
    manifest = json.loads((folder / "manifest.json").read_text())
    if not manifest["metrics"].get("on_earth"):
        return manifest["metrics"].get("earth_reason") or "not georeferenced"
    for row in rows_of(folder / "cameras.csv"):
        at = truth.camera(row)
        if at is not None and row.get("latitude_deg"):
            positions.add(truth.earth.enu(row) - at, [float(row[f"sigma_{k}_m"]) for k in "enu"])
    for row in rows_of(folder / "panoramas.csv"):
        station = truth.stations.get(row["panorama"], row["station"])
        at = truth.panoramas.get(station.lstrip("S"), truth.panoramas.get(station))
        if row["status"] == "localized" and at is not None and row.get("latitude_deg"):
            positions.add(truth.earth.enu(row) - at, [float(row[f"sigma_{k}_m"]) for k in "xyz"])
    return ""


def judge_survey(project, truth, positions):
    folder = project / "results" / "survey"
    if "frame=enu" not in header_of(folder / "tags.csv"):
        return "not georeferenced"
    for row in rows_of(folder / "tags.csv"):
        if row["tag_id"] in truth.tags and row["x"]:
            error = np.array([float(row[k]) for k in "xyz"]) - truth.tags[row["tag_id"]]
            positions.add(error, [float(row[f"sigma_{k}_m"]) for k in "xyz"])
    return ""


def warnings_of(text):
    """Warnings without their numbers, as those differ from run to run."""
    lines = [line for line in text.splitlines() if re.search(r"warning", line, re.I)]
    return {re.sub(r"[0-9.]+", "0", line) for line in lines}, lines


class Runner:
    def __init__(self, options):
        self.options = options
        self.program = str(pathlib.Path(options.program).resolve())
        self.work = pathlib.Path(options.work or tempfile.mkdtemp(prefix="faults-"))
        self.base = self.work / "good"
        self.site = pathlib.Path(options.site)
        truth = pathlib.Path(options.truth) if options.truth else self.site / "truth"
        self.run = options.run
        self.truth = Truth(truth, self.site, self.run)
        self.baseline = {}

    def call(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments), "--threads", "1"], capture_output=True, text=True,
                              errors="replace", timeout=self.options.timeout)
        return done.returncode, done.stdout + done.stderr

    def commands(self, project, names):
        """Runs the stages; the first failure ends it."""
        text = ""
        for name in names:
            arguments = [name, project] + (["--run", self.run] if name in ("localize", "detect") else [])
            code, said = self.call(*arguments)
            text += said
            if code != 0:
                return code, text
        return 0, text

    def prepare(self):
        """The good project with the results that faults leave as they are."""
        shutil.rmtree(self.base, ignore_errors=True)
        copy_links_or_copy(self.site, self.base)
        for other in (self.base / "runs").iterdir():
            if other.name != self.run:
                shutil.rmtree(other)
        project = Project(self.base, self.run)
        if self.options.every > 1:
            project.rows("images.txt", lambda rows: rows[::self.options.every])
            listed = set(project.images())
            for file in (project.run / "images").glob("*"):
                if file not in listed:
                    file.unlink()
        self.init(self.base)
        for names in (["localize"], ["detect", "survey"]):
            if names[0] == "detect" and not (self.base / "tags.yaml").exists():
                continue
            code, said = self.commands(self.base, names)
            if code != 0:
                raise SystemExit(f"the good project fails: {said}")
            self.baseline[names[-1]] = warnings_of(said)[0]
            verdict = self.judge(self.base, names, code, said, None)
            print("good:", names[-1], verdict, flush=True)
            if verdict["verdict"] not in ("right", "warned"):
                raise SystemExit("the good project is not judged right")
        for stage in ("localize", "survey"):
            shutil.rmtree(self.base / "results" / stage, ignore_errors=True)

    def init(self, project):
        code, said = self.call("init", project)
        if code != 0:
            return code, said
        n = self.options.features
        if n:
            options = f"{{images: {{max_features: {n}}}, references: {{max_features: {n}}}, views: {{size_px: 512}}}}"
            path = project / "trigpoint.yaml"
            path.write_text(re.sub(r"(?m)^stages: \{\}", f"stages: {{features: {options}, references: {options}}}",
                                   path.read_text()))
        return 0, said

    def results_of(self, project, names):
        """The stages whose result is there, whatever the exit code: a command that fails may have written one."""
        files = {"localize": f"localize/{self.run}/manifest.json", "survey": "survey/tags.csv"}
        return [name for name in names if name in files and (project / "results" / files[name]).exists()]

    def judge(self, project, names, code, said, fault):
        cause = fault.cause if fault else None
        names_cause = cause is not None and re.search(cause, said, re.I) is not None
        last = [line for line in said.strip().splitlines() if line][-1:]
        result = {"exit": code, "said": (last or [""])[0][-400:]}
        if code < 0 or code > 3:
            return {**result, "verdict": "crashed"}
        made = self.results_of(project, names)
        if code != 0 and not made:
            return {**result, "verdict": "refused" if names_cause else "unnamed"}
        positions, withheld = Positions(), ""
        if "localize" in made:
            withheld = judge_localize(project, self.run, self.truth, positions)
        if "survey" in made:
            withheld = judge_survey(project, self.truth, positions) or withheld
        result.update(count=positions.count, outside=positions.outside, worst_sigmas=round(float(positions.worst), 2),
                      largest_m=round(positions.largest_m, 3),
                      mean_square=round(positions.squares / max(1, positions.count), 3))
        new, lines = warnings_of(said)
        new -= self.baseline.get(names[-1], set())
        if new:
            result["said"] = [line for line in lines if re.sub(r"[0-9.]+", "0", line) in new][-1][-400:]
        if positions.outside > 0:
            return {**result, "verdict": "FALSE"}
        if withheld:
            result["said"] = withheld
            named = cause is None or re.search(cause, said + withheld, re.I)
            return {**result, "verdict": "withheld" if named else "unnamed"}
        if code != 0:
            return {**result, "verdict": "warned" if names_cause else "unnamed"}
        return {**result, "verdict": "warned" if new else "right"}

    def one(self, index, fault):
        folder = self.work / f"{index:03}"
        result = {"fault": fault.name, "group": fault.group, "index": index}
        try:
            if "survey" in fault.commands and not (self.base / "tags.yaml").exists():
                raise NotApplicable("tags.yaml")
            shutil.rmtree(folder, ignore_errors=True)  # of a run that was stopped
            copy_links(self.base, folder)
            project = Project(folder, self.run)
            project.init = False
            fault.apply(project)
            said, code = "", 0
            if project.init:
                code, said = self.init(folder)
            if code == 0:
                code, more = self.commands(folder, fault.commands)
                said += more
            result.update(self.judge(folder, fault.commands, code, said.replace(str(folder), ""), fault))
        except NotApplicable as e:
            result.update(verdict="not applicable", said=str(e))
        except subprocess.TimeoutExpired:
            result.update(verdict="crashed", said="no end")
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return result

    def chosen(self):
        numbers = range(self.options.first, self.options.first + max(self.options.combinations, self.options.variations))
        if self.options.combinations:
            return [(i, draws.combination(i)) for i in numbers]
        if self.options.variations:
            return [(i, draws.variation(i, self.truth)) for i in numbers]
        return [(i, f) for i, f in enumerate(faults.FAULTS)
                if (f.quick or not self.options.quick) and
                (not self.options.only or re.search(self.options.only, f"{f.group}: {f.name}"))]

    def run_all(self):
        record = Record(self.options)
        self.prepare()
        results = []

        def known_or_new(item):
            index, fault = item
            return record.known.get((index, fault.group, fault.name)) or self.one(index, fault)

        with concurrent.futures.ThreadPoolExecutor(self.options.jobs) as pool:
            for result in pool.map(known_or_new, self.chosen()):
                results.append(result)
                record.write(results)
                mark = " " if result["verdict"] in (*GOOD, "not applicable") else "!"
                numbers = "".join(f" {k}={result[k]}" for k in ("outside", "worst_sigmas", "largest_m") if k in result)
                print(f"{mark} {result['verdict']:9} {result['group']}: {result['fault']}{numbers}\n"
                      f"      {result.get('said', '')}", flush=True)
        return results


class Record:
    """The file of --json, complete after every fault. With --resume, what it has from the same program, site and
    options is not made again."""

    def __init__(self, options):
        self.path = pathlib.Path(options.json) if options.json else None
        self.name = pathlib.Path(options.site).resolve().name
        self.made_of = {"program": hashlib.sha256(pathlib.Path(options.program).read_bytes()).hexdigest(),
                        "site": str(pathlib.Path(options.site).resolve())}
        self.made_of.update({k: getattr(options, k) for k in ("run", "every", "features")})
        self.known = {}
        if options.resume and self.path and self.path.exists():
            data = json.loads(self.path.read_text())
            if data.get("made_of") != self.made_of:
                raise SystemExit(f"{self.path}: expected results of {self.made_of}, found {data.get('made_of')}; "
                                 "name another file by --json, or leave --resume out")
            self.known = {(r["index"], r["group"], r["fault"]): r for r in data["results"]}

    def write(self, results):
        if not self.path:
            return
        # Those that a stopped run had, and this one has not come to yet, are kept.
        mine = {(r["index"], r["group"], r["fault"]): r for r in results}
        merged = [*results, *(r for key, r in self.known.items() if key not in mine)]
        fresh = self.path.with_name(self.path.name + ".new")
        fresh.write_text(json.dumps({"name": self.name, "made_of": self.made_of, "results": merged}, indent=1) + "\n")
        os.replace(fresh, self.path)


def copy_links_or_copy(source, target):
    """The site's own files are copied: they may lie on another file system, and are the user's."""
    shutil.copytree(source, target,
                    ignore=shutil.ignore_patterns("results", "truth", "photos", "board", "trigpoint.yaml"))


def write_table(path, files):
    """A page with a row for each fault and a column for each data set."""
    sets = []
    for file in files:
        data = json.loads(pathlib.Path(file).read_text())
        sets.append((data["name"], {(r["group"], r["fault"]): r for r in data["results"]}))
    lines = [pathlib.Path(__file__).with_name("page.md").read_text().rstrip(), ""]
    lines += ["| data | " + " | ".join([*GOOD, "failed"]) + " |", "|---|" + "---|" * (len(GOOD) + 1)]
    for name, results in sets:
        verdicts = [r["verdict"] for r in results.values()]
        failed = sum(v not in (*GOOD, "not applicable") for v in verdicts)
        lines.append(f"| {name} | " + " | ".join(str(verdicts.count(v)) for v in GOOD) + f" | {failed} |")
    group = None
    for fault in faults.FAULTS:
        key = (fault.group, fault.name)
        found = [results.get(key) for _, results in sets]
        if not any(found):
            continue
        if fault.group != group:
            group = fault.group
            lines += ["", f"## {group.capitalize()}", "", "| fault | " + " | ".join(name for name, _ in sets) + " |",
                      "|---|" + "---|" * len(sets)]
        cells = ["" if r is None or r["verdict"] == "not applicable" else r["verdict"] for r in found]
        lines.append(f"| {fault.name} | " + " | ".join(cells) + " |")
    pathlib.Path(path).write_text("\n".join(lines) + "\n")


def squares_text(squares):
    """Mean square of standardised errors: 1 where sigmas are right, however errors of one draw hang together."""
    squares = np.array(squares)
    return (f"errors in stated sigmas: mean square {squares.mean():.2f} +- {squares.std() / math.sqrt(len(squares)):.2f} "
            f"(1 sigma, {len(squares)} draws), expected 1")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--table")
    parser.add_argument("--truth")
    parser.add_argument("--run", default="run1")
    parser.add_argument("--every", type=int, default=1, help="every n-th image of the run")
    parser.add_argument("--features", type=int, default=0, help="features of an image; 0: the default")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only")
    parser.add_argument("--json", help="results, written after every fault")
    parser.add_argument("--resume", action="store_true", help="what --json has of the same program and site is kept")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=3600)
    parser.add_argument("--work")
    parser.add_argument("--combinations", type=int, default=0)
    parser.add_argument("--variations", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("files", nargs="+")
    options = parser.parse_args()
    if options.table:
        write_table(options.table, options.files)
        return 0
    options.program, options.site = options.files
    runner = Runner(options)
    try:
        results = runner.run_all()
    finally:
        if not options.work:
            shutil.rmtree(runner.work, ignore_errors=True)
    bad = [r for r in results if r["verdict"] not in (*GOOD, "not applicable")]
    print(f"{len(results)} faults: " + ", ".join(
        f"{sum(r['verdict'] == v for r in results)} {v}" for v in (*GOOD, "not applicable")) + f", {len(bad)} failed")
    if options.variations:
        print(squares_text([r["mean_square"] for r in results if r.get("count")]))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
