#!/usr/bin/env python3
"""Plants the faults of faults.py into copies of a good project and judges what the program makes of each.

  run_faults.py PROGRAM SITE[:RUN]... [--truth DIR] [--every N] [--features N] [--quick] [--only REGEX]
                [--json FILE [--resume]] [--jobs N] [--work DIR] [--combinations N] [--variations N]
  run_faults.py --table docs/faults.md FILE.json...

RUN is run1 unless given. The truth is in SITE/truth or SITE_truth unless --truth names it. With several sites, --json is
a folder, which gets a file for each.

Verdicts: right (a result within its sigmas, nothing new said), warned (within its sigmas, with a warning), withheld (no
position on the Earth, with the cause), refused (exit 1 naming the cause, without a result). Failures: FALSE (a position
outside three of its stated sigmas, whatever the exit code), unnamed (refused or withheld without the cause), silent
(exit 0 without a result), crashed. --json keeps what was said and found; --table judges it again.
--combinations draws one to three faults at once, --variations good projects (other stretches, noise and geotags), of
which few may be warned of or refused; both begin at --first. --json is written after every fault; --resume goes on with it.
"""
import argparse
import concurrent.futures
import copy
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
import field_faults
from site_files import NotApplicable, Project, copy_links, rotation, station_number

GOOD = ("right", "warned", "withheld", "refused")
GATE = 3.0  # stated sigmas
ALL_FAULTS = faults.FAULTS + field_faults.FAULTS
ROUNDING_M = 0.0005  # of what results and truth are written in
# Said whenever nothing is localized or georeferenced, whatever the cause.
ALWAYS_SAID = (r"they show other places, or the run is wrong|"
               r"; check units, clocks and order of odometry and images, and the calibration; column reason of \S+ has the cause|"
               r"none of \d+ panoramas? (and|or) photos? is localized|"
               r"; of \d+ panoramas and photos \d+ are localized and have a geotag, and \d+ GPS fixes lie at the images' times")


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


def by_station(values):
    return {station_number(name): value for name, value in values.items()}


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
        # The second: where a panorama's lenses stand apart, the truth is that of the run's lens.
        for name in ("panoramas.tum", f"panoramas_{run}.tum"):
            if (folder / name).exists():
                self.panoramas.update(by_station(self.poses(folder / name)))
                self.attitudes.update(by_station(self.attitudes_of(folder / name)))
        # A picture was taken where it was taken, whatever a faulty table says of it.
        tables = [site / name for name in ("panoramas.csv", "photos.csv") if (site / name).exists()]
        self.stations = {row["file"]: row.get("station", "") for table in tables for row in rows_of(table)}
        if (folder / "tags.csv").exists():
            for row in rows_of(folder / "tags.csv"):
                self.tags[row["tag_id"]] = np.array([float(row[k]) for k in "xyz"])
        for name, needed, there in (("cameras", True, self.cameras), ("panoramas", self.stations, self.panoramas),
                                    ("tags", (site / "tags.yaml").exists(), self.tags)):
            if needed and not there:
                raise SystemExit(f"{folder}: expected the truth of {name}, found none")
        unknown = [s for s in self.stations.values() if s and station_number(s) not in self.panoramas]
        if unknown:
            raise SystemExit(f"{folder}: expected the panoramas' truth for each station, found none for {', '.join(unknown)}")

    def panorama(self, row):
        """Where a panorama was taken, whatever station a faulty table gives it; None where that is not known."""
        return self.panoramas.get(station_number(self.stations.get(row["panorama"], row["station"])))

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
        self.count, self.outside, self.worst, self.largest_m, self.squares, self.unknown = 0, 0, 0.0, 0.0, 0.0, 0

    def add(self, found, truth, sigma):
        if truth is None:
            self.unknown += 1
            return
        error, sigma = np.asarray(found) - truth, np.asarray(sigma)
        self.squares += float(np.mean((error / np.maximum(sigma, 1e-9)) ** 2))
        off = sigmas_off(error, sigma) if np.isfinite([*error, *sigma]).all() else math.inf
        self.count += 1
        self.outside += int(off > GATE)
        self.worst = max(self.worst, off)
        self.largest_m = max(self.largest_m, float(np.linalg.norm(error)))


def numbers(row, *keys):
    """NaN for what the program left empty."""
    return [float(row[k] or "nan") for k in keys]


def place_of(row, truth):
    latitude, longitude, height = numbers(row, "latitude_deg", "longitude_deg", "height_m")
    return truth.earth.enu({"latitude_deg": latitude, "longitude_deg": longitude, "height_m": height})


def judge_localize(project, run, truth, positions):
    folder = project / "results" / "localize" / run
    manifest = json.loads((folder / "manifest.json").read_text())
    if not manifest["metrics"].get("on_earth"):
        return manifest["metrics"].get("earth_reason") or "not georeferenced"
    for row in rows_of(folder / "cameras.csv"):
        positions.add(place_of(row, truth), truth.camera(row), numbers(row, *(f"sigma_{k}_m" for k in "enu")))
    for row in rows_of(folder / "panoramas.csv"):
        if row["status"] == "localized":
            positions.add(place_of(row, truth), truth.panorama(row), numbers(row, *(f"sigma_{k}_m" for k in "xyz")))
    return ""


def judge_survey(project, truth, positions):
    folder = project / "results" / "survey"
    if "frame=enu" not in header_of(folder / "tags.csv"):
        return "not georeferenced"
    for row in rows_of(folder / "tags.csv"):
        if row["x"]:  # else it was not seen
            positions.add(numbers(row, *"xyz"), truth.tags.get(row["tag_id"]), numbers(row, *(f"sigma_{k}_m" for k in "xyz")))
    return ""


def without_numbers(line):
    return re.sub(r"[0-9.]+", "0", line)


def messages_of(text):
    """Errors and warnings: what tells a user of a fault. Progress and paths do not."""
    return [line for line in text.splitlines() if re.match(r"(warning|error|trigpoint): ", line)]


def names_cause(record, cause):
    said = "\n".join([*record["messages"], record.get("withheld", "")])
    return cause is not None and re.search(cause, re.sub(ALWAYS_SAID, "", said), re.I) is not None


def verdict_of(record, cause):
    """Of what a fault led to. `cause`: a regular expression, or None where nothing has to be said."""
    named, code = names_cause(record, cause), record["exit"]
    if code < 0 or code > 3:
        return "crashed"
    if not record["result"] and code != 0:
        return "refused" if named else "unnamed"
    if record.get("outside", 0) > 0:
        return "FALSE"
    if record.get("withheld"):
        return "withheld" if named else "unnamed"
    if not record["result"] or record["count"] == 0:
        return "silent"
    if code != 0:
        return "warned" if named else "unnamed"
    return "warned" if record["messages"] else "right"


def truth_folder(given, site):
    """Where the truth of a site lies."""
    beside = site.resolve().with_name(site.resolve().name + "_truth")
    folder = pathlib.Path(given) if given else beside if beside.is_dir() else site / "truth"
    if not folder.is_dir():
        raise SystemExit(f"{folder}: expected a folder with the truth of {site}, found none; name it by --truth")
    return folder


class Runner:
    def __init__(self, options):
        self.options = options
        self.program = str(pathlib.Path(options.program).resolve())
        self.work = pathlib.Path(options.work or tempfile.mkdtemp(prefix="faults-"))
        self.base = self.work / "good"
        self.site = pathlib.Path(options.site)
        self.run = options.run
        self.truth = Truth(truth_folder(options.truth, self.site), self.site, self.run)
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
            said = said.replace(str(self.base), "")
            good = self.observe(self.base, names, code, said, self.truth)
            print("good:", names[-1], good, flush=True)
            if verdict_of(good, None) not in ("right", "warned") or good["unknown"]:
                raise SystemExit("the good project is not judged right, or has positions without truth")
            self.baseline[names[-1]] = {without_numbers(line) for line in messages_of(said)}
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

    def observe(self, project, names, code, said, truth):
        """What a fault led to, as --json keeps it."""
        old = self.baseline.get(names[-1], set())
        messages = [line for line in messages_of(said) if without_numbers(line) not in old]
        made = self.results_of(project, names)
        record = {"exit": code, "result": bool(made), "messages": messages}
        positions = Positions()
        if "localize" in made:
            record["withheld"] = judge_localize(project, self.run, truth, positions)
        if "survey" in made:
            record["withheld"] = judge_survey(project, truth, positions) or record.get("withheld", "")
        record.update(count=positions.count, outside=positions.outside, unknown=positions.unknown,
                      worst_sigmas=round(float(positions.worst), 2), largest_m=round(positions.largest_m, 3),
                      mean_square=round(positions.squares / max(1, positions.count), 3))
        return record

    def one(self, index, fault):
        folder = self.work / f"{index:03}"
        result = {"fault": fault.name, "group": fault.group, "index": index}
        try:
            if "survey" in fault.commands and not (self.base / "tags.yaml").exists():
                raise NotApplicable("tags.yaml")
            shutil.rmtree(folder, ignore_errors=True)  # of a run that was stopped
            copy_links(self.base, folder)
            project = Project(folder, self.run)
            project.init, project.site, project.truth = False, self.site, copy.deepcopy(self.truth)
            fault.apply(project)
            said, code = "", 0
            if project.init:
                code, said = self.init(folder)
            if code == 0:
                code, more = self.commands(folder, fault.commands)
                said += more
            said = said.replace(str(folder), "")
            result.update(self.observe(folder, fault.commands, code, said, project.truth))
            result["verdict"] = verdict_of(result, fault.cause)
        except (NotApplicable, KeyError, ValueError, IndexError) as e:  # a table of another form cannot hold it
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
        return [(i, f) for i, f in enumerate(ALL_FAULTS)
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
                figures = "".join(f" {k}={result[k]}" for k in ("count", "outside", "worst_sigmas", "largest_m") if k in result)
                said = [result.get("said") or result.get("withheld") or "", *result.get("messages", [])]
                print(f"{mark} {result['verdict']:9} {result['group']}: {result['fault']}{figures}\n"
                      + "".join(f"      {line[:400]}\n" for line in said if line), end="", flush=True)
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
        sources = sorted(pathlib.Path(__file__).parent.glob("*.py"))
        self.made_of["suite"] = hashlib.sha256(b"".join(file.read_bytes() for file in sources)).hexdigest()
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


def columns_of(page):
    """Of each data set that the page has a column for: the verdict of each fault."""
    columns, names, group = {}, [], None
    for line in page.read_text().splitlines() if page.exists() else []:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("## "):
            group, names = line[3:].lower(), []
        elif group and line.startswith("| fault |"):
            names = cells[1:]
        elif group and line.startswith("| "):
            for name, verdict in zip(names, cells[1:]):
                record = {"verdict": verdict or "not applicable"}
                columns.setdefault(name, {})[group, cells[0]] = record
    return columns


def write_table(path, files):
    """A page with a row for each fault and a column for each data set. What is not in `files` stays as it was."""
    columns = columns_of(pathlib.Path(path))
    for file in files:
        data = json.loads(pathlib.Path(file).read_text())
        results = {(r["group"], r["fault"]): r for r in data["results"]}
        for fault in ALL_FAULTS:
            record = results.get((fault.group, fault.name))
            if record and "messages" in record:
                record["verdict"] = verdict_of(record, fault.cause)
        columns.setdefault(data["name"], {}).update(results)
    sets = list(columns.items())
    lines = [pathlib.Path(__file__).with_name("page.md").read_text().rstrip(), ""]
    lines += ["| data | " + " | ".join([*GOOD, "failed"]) + " |", "|---|" + "---|" * (len(GOOD) + 1)]
    for name, results in sets:
        verdicts = [r["verdict"] for r in results.values()]
        failed = sum(v not in (*GOOD, "not applicable") for v in verdicts)
        lines.append(f"| {name} | " + " | ".join(str(verdicts.count(v)) for v in GOOD) + f" | {failed} |")
    group, groups = None, list(dict.fromkeys(fault.group for fault in ALL_FAULTS))
    for fault in sorted(ALL_FAULTS, key=lambda fault: groups.index(fault.group)):
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
    parser.add_argument("--expect", type=int, help="how many faults --only must name")
    parser.add_argument("files", nargs="+")
    options = parser.parse_args()
    if options.table:
        write_table(options.table, options.files)
        return 0
    program, *sites = options.files
    if not sites or len(sites) > 1 and options.truth:
        parser.error("expected PROGRAM SITE[:RUN]..., and --truth for one site alone")
    codes = []
    for site in sites:
        try:
            codes.append(judge_site(options, program, site, len(sites) > 1))
        except SystemExit as e:  # the others are still judged
            print(e, file=sys.stderr)
            codes.append(2)
    return max(codes) if len(sites) == 1 else max([c for c in codes if c < 2], default=2)


def judge_site(options, program, site, of_several):
    """All faults in one site; the exit code."""
    options = copy.copy(options)
    options.program = program
    options.site, _, run = site.partition(":")
    options.run = run or "run1"
    if options.json and of_several:
        name = pathlib.Path(options.site).resolve().name + (f"_{run}" if run else "")
        options.json = pathlib.Path(options.json) / f"{name}.json"
        options.json.parent.mkdir(parents=True, exist_ok=True)
    runner = Runner(options)
    try:
        results = runner.run_all()
    finally:
        if not options.work:
            shutil.rmtree(runner.work, ignore_errors=True)
    bad = [r for r in results if r["verdict"] not in (*GOOD, "not applicable")]
    print(f"{site}: {len(results)} faults: " + ", ".join(
        f"{sum(r['verdict'] == v for r in results)} {v}" for v in (*GOOD, "not applicable")) + f", {len(bad)} failed",
        flush=True)
    if options.variations:
        print(squares_text([r["mean_square"] for r in results if r.get("count")]))
    if options.expect is not None and len(results) != options.expect:
        print(f"expected {options.expect} faults, found {len(results)}: see --only", file=sys.stderr)
        return 2
    if all(r["verdict"] == "not applicable" for r in results):
        print("expected faults to plant, found none: see --only", file=sys.stderr)
        return 2
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
