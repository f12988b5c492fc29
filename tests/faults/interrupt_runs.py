#!/usr/bin/env python3
"""Kills `trigpoint run` at random moments, and takes memory and disk from it in every stage: nothing is lost.

  interrupt_runs.py PROGRAM SITE [--kills N] [--memory N] [--disk N] [--seed S]

After each, what was finished before is untouched, `status` works, and the run that then goes to its end leaves the same
bytes as one that nobody disturbed. Too little memory or a full disk is exit code 1 with one sentence that says so. The
disk is a small file system of its own in memory; without the right to mount one, these draws are left out.
"""
import argparse
import hashlib
import json
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

# The second run of the example site with coarse views, so that the whole of it takes seconds.
OPTIONS = """stages:
  references: {views: {size_px: 400}, references: {max_features: 600}}
  survey: {tie_points: false}
"""
# Of a manifest: when and how fast results were made, and the hash over it.
TIMES = {"start", "end", "wall_seconds", "cpu_seconds", "peak_memory_bytes",
         "detector_peak_memory_bytes", "seconds", "sha256"}


def make_site(source, target):
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("results", "run1", "photos", "board", "trigpoint.yaml"))
    (target / "trigpoint.yaml").write_text(OPTIONS)


def manifests(site):
    """The finished stages; hidden folders hold what is half-made, or the record of a failure."""
    found = {}
    for path in (site / "results").rglob("manifest.json"):
        stage = path.parent.relative_to(site / "results")
        if not any(part.startswith(".") for part in stage.parts):
            found[str(stage)] = json.loads(path.read_text())
    return found


def without_times(value):
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in TIMES}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def digest(path):
    if path.name == "manifest.json":
        return json.dumps(without_times(json.loads(path.read_text())), sort_keys=True)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def contents(site):
    """Every file of the results. Logs and the report say when and how fast results were made: of these, the names."""
    results = site / "results"
    files = {str(p.relative_to(results)): p for p in results.rglob("*") if p.is_file()}
    timed = [name for name in files if name.startswith("report/") or name.endswith("log.txt") or name == ".hashes"]
    return {name: "" if name in timed else digest(path) for name, path in files.items()}


class Interruptions:
    def __init__(self, options):
        self.program = str(pathlib.Path(options.program).resolve())
        self.source = pathlib.Path(options.site)
        self.draw = random.Random(options.seed)
        self.work = pathlib.Path(tempfile.mkdtemp(prefix="interrupt-"))
        self.failures = []
        self.good = self.work / "good"
        make_site(self.source, self.good)
        done = self.run(self.good)
        if done.returncode != 0:
            raise SystemExit(f"the undisturbed run fails: {done.stderr}")
        self.expected = contents(self.good)
        made = manifests(self.good)
        self.seconds = {stage: m["wall_seconds"] for stage, m in made.items()}
        self.order = sorted(made, key=lambda stage: made[stage]["end"])
        self.offset = self.draw.randrange(len(self.order))  # the stage that the first draw begins with

    def run(self, site, command="run", *flags, **limits):
        return subprocess.run([self.program, command, str(site), *flags], capture_output=True, text=True, errors="replace",
                              check=False, timeout=1800, **limits)

    def expect(self, condition, what):
        if not condition:
            self.failures.append(what)
            print("!", what, flush=True)

    def copy(self, name, stages):
        """The good site with the results of these stages."""
        site = self.work / name
        shutil.rmtree(site, ignore_errors=True)
        make_site(self.source, site)
        for stage in stages:
            shutil.copytree(self.good / "results" / stage, site / "results" / stage)
        return site

    def expect_kept(self, before, site, what):
        now = manifests(site)
        for stage, manifest in before.items():
            self.expect(stage in now and now[stage]["end"] == manifest["end"], f"{what}: {stage} is lost or made again")
        self.expect(self.run(site, "status").returncode == 0, f"{what}: status fails")

    def expect_same(self, site, what):
        """Goes to the end; then all is as if nothing had happened."""
        done = self.run(site)
        self.expect(done.returncode == 0, f"{what}: the next run fails: {done.stderr[-300:]}")
        now = contents(site)
        differ = [f for f in sorted({*now, *self.expected}) if now.get(f) != self.expected.get(f)]
        self.expect(not differ, f"{what}: these differ: {differ[:5]}")
        stages = json.loads(self.run(site, "status", "--json").stdout)["stages"]
        undone = [s["stage"] for s in stages if s["state"] not in ("done", "not needed")]
        self.expect(not undone, f"{what}: these are not done: {undone}")

    def kill(self, wanted):
        """Chains of kills: each at any moment of what is left to do."""
        kills, chains = 0, 0
        while kills < wanted:
            site = self.copy("killed", [])
            chains += 1
            for _ in range(10):
                before = manifests(site)
                left = sum(s for stage, s in self.seconds.items() if stage not in before)
                child = subprocess.Popen([self.program, "run", str(site)], stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL, start_new_session=True)
                time.sleep(self.draw.uniform(0, 1) * left)
                child.send_signal(signal.SIGKILL)
                killed = child.wait() == -signal.SIGKILL
                kills += killed
                self.expect_kept(before, site, f"kill {kills}")
                if not killed or kills >= wanted:
                    break
            self.expect_same(site, f"chain {chains} of kills")
        print(f"{kills} kills in {chains} chains", flush=True)

    def peak_kib(self, *arguments):
        """The most address space that the program takes."""
        child = subprocess.Popen([self.program, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        most = 0
        while child.poll() is None:
            try:
                found = re.search(r"VmPeak:\s*(\d+)", pathlib.Path(f"/proc/{child.pid}/status").read_text())
            except OSError:
                found = None
            most = max(most, int(found[1]) if found else 0)
            time.sleep(0.005)
        return most

    def stages_before(self, index):
        return self.order[:index]

    def starve(self, wanted):
        # With less than it takes to say its status, the system does not even start it.
        least = self.peak_kib("status", str(self.good))
        most = self.peak_kib("run", str(self.copy("starved", [])))
        refused = 0
        for k in range(wanted):
            first = (k + self.offset) % len(self.order)
            kib = self.draw.uniform(least, most)
            what = f"{kib / 1024:.0f} of {most / 1024:.0f} MiB from {self.order[first]} on"
            site = self.copy("starved", self.stages_before(first))
            before = manifests(site)
            limit = int(kib * 1024)
            done = self.run(site, preexec_fn=lambda b=limit: resource.setrlimit(resource.RLIMIT_AS, (b, b)))
            self.expect(done.returncode in (0, 1), f"{what}: exit code {done.returncode}: {done.stderr[-300:]}")
            refused += done.returncode == 1
            if done.returncode == 1:
                self.expect(re.search(r"memory", done.stderr), f"{what}: memory is not named: {done.stderr[-300:]}")
            self.expect_kept(before, site, what)
            self.expect_same(site, what)
        print(f"{wanted} times too little memory, {refused} refused", flush=True)

    def starve_alone(self, wanted):
        """Commands that `run` needs more memory for elsewhere, or that it does not have: little more than they start with."""
        least = self.peak_kib("status", str(self.good))
        commands = [("survey", []), ("print", ["--ids", "300-303", "--size", "100"]), ("plan", [])]
        before_survey = self.stages_before(self.order.index("survey"))
        for k in range(wanted):
            kib = least + self.draw.uniform(0, 200) * 1024
            for command, flags in commands:
                what = f"{kib / 1024:.0f} MiB for {command}"
                site = self.copy("alone", before_survey)
                limit = int(kib * 1024)
                done = self.run(site, command, *flags,
                                preexec_fn=lambda b=limit: resource.setrlimit(resource.RLIMIT_AS, (b, b)))
                self.expect(done.returncode in (0, 1), f"{what}: exit code {done.returncode}: {done.stderr[-300:]}")
                self.expect(done.returncode == 0 or re.search(r"memory", done.stderr),
                            f"{what}: memory is not named: {done.stderr[-300:]}")
        print(f"{wanted} times too little memory for each of {len(commands)} commands", flush=True)

    def fill(self, wanted):
        size = sum(p.stat().st_size for p in (self.good / "results").rglob("*") if p.is_file())
        for k in range(wanted):
            first = (k + self.offset) % len(self.order)
            site = self.copy("full", [])
            results = site / "results"
            results.mkdir()
            kept = sum(p.stat().st_size for stage in self.stages_before(first)
                       for p in (self.good / "results" / stage).rglob("*") if p.is_file())
            free = int(self.draw.uniform(0, 1) * (size - kept))
            what = f"disk with {free / 1024:.0f} KiB left from {self.order[first]} on"
            # Every file takes whole pages.
            pages = len(list((self.good / "results").rglob("*"))) * 4096
            mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kept + pages + free}", "tmpfs", str(results)],
                                     capture_output=True, check=False)
            if mounted.returncode != 0:
                print("no right to mount a small disk: left out", flush=True)
                return
            try:
                for stage in self.stages_before(first):
                    shutil.copytree(self.good / "results" / stage, results / stage)
                before = manifests(site)
                done = self.run(site)
                self.expect(done.returncode in (0, 1), f"{what}: exit code {done.returncode}: {done.stderr[-300:]}")
                if done.returncode == 1:
                    self.expect(re.search(r"No space left|disk", done.stderr),
                                f"{what}: the disk is not named: {done.stderr[-300:]}")
                self.expect_kept(before, site, what)
                subprocess.run(["mount", "-o", "remount,size=1g", str(results)], check=True)
                self.expect_same(site, what)
            finally:
                subprocess.run(["umount", "-l", str(results)], check=False)
        print(f"{wanted} times a full disk", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("site")
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--memory", type=int, default=0)
    parser.add_argument("--disk", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    runs = Interruptions(options)
    try:
        runs.kill(options.kills)
        runs.starve(options.memory)
        runs.starve_alone(2 * options.memory)
        runs.fill(options.disk)
    finally:
        shutil.rmtree(runs.work, ignore_errors=True)
    print(f"{len(runs.failures)} failures")
    return 1 if runs.failures else 0


if __name__ == "__main__":
    sys.exit(main())
