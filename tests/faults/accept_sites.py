#!/usr/bin/python3
"""Random sites of tags, with and without a planted fault: does a survey with gates accept what is wrong?

  accept_sites.py TRIGPOINT [--faults N] [--good N] [--coverage N] [--first K] [--jobs N] [--json FILE] [--only REGEX]
                  [--work DIR]

A site is accepted wrongly (FALSE) if the command ends with 0 and a tag that is said to be ok lies outside of the region
that its covariance states (chi-square of three degrees, 0.01 % over all tags of the site). A refusal (exit code 1 or 3)
names the fault if a sentence or a row of gates.json holds its tag, run or kind. A site without a fault is
refused if the exit code is not 0, and warned of if a warning is said. --coverage: one site of 50 tags, 5 of them control
and 30 check points, is drawn again; the share of tags inside of the 95 % regions, and of check points' differences
inside of theirs, is counted. Ends with 1 if more sites are accepted wrongly, refused or warned of than the limits allow.
"""
import argparse
import collections
import concurrent.futures
import csv
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import made_sites
from site_files import turn

CHI2_95 = 7.815  # three degrees of freedom
LIMITS = {"accepted wrongly": 0.003, "refused": 0.01, "warned": 0.05}  # shares of all sites of their kind


def chi2_beyond(tags):
    """Chi-square of three degrees of freedom that one of `tags` exceeds with a probability of 0.01 %."""
    low, high = 0.0, 100.0
    for _ in range(60):
        x = 0.5 * (low + high)
        tail = math.erfc(math.sqrt(x / 2)) + math.sqrt(2 * x / math.pi) * math.exp(-x / 2)
        low, high = (x, high) if tail > 0.0001 / tags else (low, x)
    return high


# --- faults: each changes a site and returns words one of which a refusal or a warning must hold -----------------------


def log_uniform(draw, low, high):
    return math.exp(draw.uniform(math.log(low), math.log(high)))


def direction(draw, flat=False):
    v = draw.normal(size=3)
    if flat:
        v[2] = 0
    return v / np.linalg.norm(v)


def tags_named(*tags):
    return [rf"(tags?|points?|control|check|\band|,) (point )?{t}\b" for t in tags]


def moved_tag(site, draw):
    tag = int(draw.choice(list(site.tags)))
    old = site.tags[tag]
    new = made_sites.Tag(old.at + log_uniform(draw, 0.03, 2) * direction(draw), old.r)
    for later in site.runs[int(draw.integers(1, len(site.runs))):]:
        later.tags[tag] = [new]
    return tags_named(tag)


def exchanged_sheets(site, draw):
    a, b = (int(t) for t in draw.choice(list(site.tags), 2, replace=False))
    for run in site.runs[int(draw.integers(1, len(site.runs))):]:
        run.tags[a], run.tags[b] = [site.tags[b]], [site.tags[a]]
    return tags_named(a, b)


def exchanged_points(site, draw):
    a, b = (int(t) for t in draw.choice(list(site.points), 2, replace=False))
    site.points[a][1], site.points[b][1] = site.points[b][1], site.points[a][1]
    return tags_named(a, b)


def check_points_of_another_datum(site, draw):
    shift = log_uniform(draw, 0.1, 100) * direction(draw, flat=bool(draw.integers(0, 2)))
    for tag, (role, p) in site.points.items():
        if role == "check":
            site.points[tag][1] = p + shift
    return tags_named(*[t for t, (role, _) in site.points.items() if role == "check"])


def heights_of_another_datum(site, draw):
    """Of some of the points, as when two crews worked with and without a geoid."""
    wrong = [int(t) for t in draw.choice(list(site.points), len(site.points) // 2, replace=False)]
    shift = draw.choice([-1, 1]) * log_uniform(draw, 0.3, 50)
    for tag in wrong:
        site.points[tag][1] = site.points[tag][1] + [0, 0, shift]
    return ["heights", *tags_named(*site.points)]  # either half may be the wrong one


def east_and_north_exchanged(site, draw):
    for tag, (_, p) in site.points.items():
        site.points[tag][1] = p[[1, 0, 2]]
    return [r"mirror|exchang|swap|axes|handed", *tags_named(*site.points)]


def control_in_feet(site, draw):
    factor = float(draw.choice([1 / 0.3048, 0.3048, 1 / 0.9144, 1000, 0.01]))
    for tag, (_, p) in site.points.items():
        site.points[tag][1] = factor * p
    return [r"feet|unit|scale|size|metres", *tags_named(*site.points)]


def sizes_in_another_unit(site, draw):
    site.stated_size = site.size * float(draw.choice([0.3048, 1 / 0.3048, 0.0254 / 0.01, 1.25, 0.8]))
    return [r"size|smaller|larger|scale|unit"]


def all_sheets_scaled(site, draw):
    factor = 1 + float(draw.choice([-1, 1])) * log_uniform(draw, 0.01, 0.15)
    site.stated_size = site.size * factor
    return [r"size|smaller than stated|larger than stated|scale"]


def one_sheet_scaled(site, draw):
    tag = int(draw.choice(list(site.tags)))
    site.printed[tag] = site.size * (1 + float(draw.choice([-1, 1])) * log_uniform(draw, 0.03, 0.3))
    return tags_named(tag)


def duplicated_sheet(site, draw):
    a, b = (int(t) for t in draw.choice(list(site.tags), 2, replace=False))
    for run in site.runs:
        run.tags[a] = [site.tags[a], site.tags[b]]
        run.tags.pop(b)
    site.tags.pop(b)
    site.points.pop(b, None)
    return tags_named(a, b)


def clock(site, draw):
    run = site.runs[int(draw.integers(0, len(site.runs)))]
    site.clock_s[run.name] = float(draw.choice([-1, 1])) * log_uniform(draw, 0.1, 5)
    return [rf"{run.name}.*(clock|offset|odometry|jump|time)|(clock|offset|odometry|time).*{run.name}"]


def wrong_control(site, draw):
    tag = int(draw.choice([t for t, (role, _) in site.points.items() if role == "control"]))
    site.points[tag][1] = site.points[tag][1] + log_uniform(draw, 0.03, 20) * direction(draw)
    return tags_named(tag)


def digits_exchanged(site, draw):
    tag = int(draw.choice(list(site.points)))
    p = site.points[tag][1].copy()
    axis = int(draw.integers(0, 3))
    p[axis] += float(draw.choice([-0.9, 0.9, -0.09, 0.09, 9, -9]))
    site.points[tag][1] = p
    return tags_named(tag)


def sign_lost(site, draw):
    tag = int(draw.choice(list(site.points)))
    p = site.points[tag][1].copy()
    p[int(draw.integers(0, 2))] *= -1
    site.points[tag][1] = p
    return tags_named(tag)


def odometry_scaled(site, draw):
    run = site.runs[int(draw.integers(0, len(site.runs)))]
    factor = float(draw.choice([0.3048, 1 / 0.3048, 0.9, 1.1, 1.3]))
    run.odometry = [(s, factor * t, r) for s, t, r in run.odometry]
    return [rf"{run.name}.*(scale|odometry|unit|feet)|(scale|odometry|unit|feet).*{run.name}"]


def odometry_turned(site, draw):
    run = site.runs[int(draw.integers(0, len(site.runs)))]
    by = turn(2, float(draw.choice([90, -90, 180])))
    run.odometry = [(s, by @ t, r) for s, t, r in run.odometry]
    return [rf"{run.name}.*odometry|odometry.*{run.name}"]


FAULTS = [moved_tag, exchanged_sheets, exchanged_points, check_points_of_another_datum, heights_of_another_datum,
          east_and_north_exchanged, control_in_feet, sizes_in_another_unit, all_sheets_scaled, one_sheet_scaled,
          duplicated_sheet, clock, wrong_control, digits_exchanged, sign_lost, odometry_scaled, odometry_turned]


# --- what the program makes of them --------------------------------------------------------------------------------


def rows_of(path):
    return list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))


def errors_of(folder, site):
    """Tag -> (error of its centre, its covariance); where a tag hung in two places, the nearer one."""
    survey = folder / "results" / "survey"
    covariances = {int(row["tag_a"]): np.array([[float(row[f"c{i}{j}"]) for j in (3, 4, 5)] for i in (3, 4, 5)])
                   for row in rows_of(survey / "tags_cov.csv") if row["tag_a"] == row["tag_b"]}
    result = {}
    for row in rows_of(survey / "tags.csv"):
        tag = int(row["tag_id"])
        if not row["x"] or tag not in covariances:
            continue
        places = [p.at for run in site.runs for p in run.tags.get(tag, [])]
        at = np.array([float(row[k]) for k in "xyz"])
        result[tag] = (min((at - p for p in places), key=np.linalg.norm), covariances[tag], row["status"])
    return result


class Runner:
    def __init__(self, options):
        self.program = str(pathlib.Path(options.program).resolve())
        self.work = pathlib.Path(options.work or tempfile.mkdtemp(prefix="sites-"))
        self.keep = bool(options.work)

    def survey(self, folder):
        done = subprocess.run([self.program, "survey", str(folder), "--threads", "1"], capture_output=True, text=True,
                              errors="replace", timeout=600)
        said = (done.stdout + done.stderr).replace(str(folder), "")
        gates = folder / "results" / "gates" / "gates.json"
        summary = folder / "results" / "survey" / "summary.json"
        if summary.exists():
            said += "\n".join("warning: " + w for w in json.loads(summary.read_text()).get("warnings", []))
        return done.returncode, said, gates.read_text() if gates.exists() else ""

    def one(self, kind, index, fault):
        site = made_sites.Site(index)
        draw = np.random.default_rng(70000 + index)
        words = fault(site, draw) if fault else []
        folder = self.work / f"{kind}{index:05}"
        site.write(folder)
        code, said, gates = self.survey(folder)
        warnings = sorted({line for line in said.splitlines() if re.match(r"warning", line, re.I)})
        result = {"index": index, "fault": fault.__name__ if fault else "", "exit": code, "said": warnings[:12],
                  "gates": [g["name"] + " " + g["verdict"] for g in json.loads(gates)["gates"]] if gates else []}
        result["last"] = ([line for line in said.splitlines() if line.startswith("error:")] or [""])[-1][:400]
        if code not in (0, 1, 3):
            result["verdict"] = "crashed"
            return result
        told = [*warnings, *(line for line in said.splitlines() if line.startswith("error:"))]
        if gates:
            told += [f"{g['name']} {g['message']}" for g in json.loads(gates)["gates"] if g["verdict"] != "passed"]
        named = any(re.search(w, line, re.I) for w in words for line in told)
        if code == 1:
            result["verdict"] = "refused" if not fault or named else "unnamed"
        else:
            errors = errors_of(folder, site)
            limit = chi2_beyond(len(errors))
            outside = [t for t, (e, c, status) in errors.items() if e @ np.linalg.solve(c, e) > limit and status == "ok"]
            result["outside"] = outside
            result["largest_m"] = round(float(max(np.linalg.norm(e) for e, _, _ in errors.values())), 4)
            if outside and code == 0:
                result["verdict"] = "FALSE"
            elif not fault:
                result["verdict"] = "refused" if code else "warned" if warnings else "right"
            elif code == 3:
                result["verdict"] = "refused" if named else "unnamed"
            else:
                result["verdict"] = "warned" if named else "right"
        if not self.keep:
            shutil.rmtree(folder, ignore_errors=True)
        return result

    def covered(self, index):
        """Of one draw of the site: tags and check points inside of their 95 % regions, and how many there are."""
        site = made_sites.Site(index, tags=50, controls=5, checks=30, runs=3)
        folder = self.work / f"coverage{index:05}"
        site.write(folder)
        self.survey(folder)
        control = {t for t, (role, _) in site.points.items() if role == "control"}
        tags = [e @ np.linalg.solve(c, e) for t, (e, c, _) in errors_of(folder, site).items() if t not in control]
        checks = [float(row["chi2_3dof"]) for row in rows_of(folder / "results" / "survey" / "check.csv")
                  if row["status"] == "check"]
        shutil.rmtree(folder, ignore_errors=True)
        return [float(x) for x in tags], checks


def shown(share, limit):
    return f"{100 * share:.1f} % (limit {100 * limit:g} %)"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    for name in ("faults", "good", "coverage", "first"):
        parser.add_argument(f"--{name}", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json")
    parser.add_argument("--only", default="")
    parser.add_argument("--work")
    options = parser.parse_args()
    runner = Runner(options)
    chosen = [f for f in FAULTS if re.search(options.only, f.__name__)]
    numbers = range(options.first, options.first + max(options.faults, options.good, options.coverage))
    failed = False
    report = {}
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for kind, count in (("fault", options.faults), ("good", options.good)):
            items = [(kind, i, chosen[i % len(chosen)] if kind == "fault" else None) for i in numbers[:count]]
            results = []
            for result in pool.map(lambda item: runner.one(*item), items):
                results.append(result)
                if result["verdict"] in ("FALSE", "unnamed", "crashed") or (kind == "good" and result["verdict"] != "right"):
                    print(json.dumps(result), flush=True)
            if not results:
                continue
            report[kind] = results
            verdicts = collections.Counter(r["verdict"] for r in results)
            print(f"{kind}: {count} sites: " + ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items())), flush=True)
            for name in sorted({r["fault"] for r in results} - {""}):
                of_one = collections.Counter(r["verdict"] for r in results if r["fault"] == name)
                print(f"  {name}: " + ", ".join(f"{n} {v}" for v, n in sorted(of_one.items())))
            if kind == "fault":
                wrong = (verdicts["FALSE"] + verdicts["crashed"]) / count
                print("accepted wrongly: " + shown(wrong, LIMITS["accepted wrongly"]))
                failed |= wrong > LIMITS["accepted wrongly"] or verdicts["unnamed"] > 0
            else:
                for name in ("refused", "warned"):
                    print(f"{name}: " + shown(verdicts[name] / count, LIMITS[name]))
                    failed |= verdicts[name] / count > LIMITS[name]
                failed |= verdicts["FALSE"] + verdicts["crashed"] > 0
        if options.coverage:
            draws = list(pool.map(runner.covered, numbers[:options.coverage]))
            report["coverage"] = {}
            for what, k in (("tags", 0), ("check points", 1)):
                values = np.array([x for d in draws for x in d[k]])
                of_draws = [np.mean(np.array(d[k]) < CHI2_95) for d in draws]
                share = float(np.mean(values < CHI2_95))
                report["coverage"][what] = share
                print(f"coverage: {100 * share:.1f} +- {100 * np.std(of_draws) / math.sqrt(len(of_draws)):.1f} % of "
                      f"{len(values)} {what} lie inside of their 95 % regions (limits 93 and 97 %); mean chi-square "
                      f"{values.mean():.2f} of 3")
                failed |= not 0.93 <= share <= 0.97
    if not options.work:
        shutil.rmtree(runner.work, ignore_errors=True)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(report, indent=1) + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
