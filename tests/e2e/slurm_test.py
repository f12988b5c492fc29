#!/usr/bin/env python3
"""trigpoint batch on a real Slurm: a controller and two node daemons on this machine.

    slurm_test.py PROGRAM SOURCE_DIR

Skipped (exit code 77) where Slurm or munge is not installed.
"""
import filecmp
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import guides_test
import slurm_cluster

PROGRAM, SOURCE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
del sys.argv[1:3]
SKIPPED = 77
RUNS = ("run2", "run3", "run4")
# Of a result, but not of its content: times, machines, resources.
NOT_CONTENT = {"manifest.json", "log.txt"}


def trigpoint(*arguments, expect=0, limit=None):
    def before():
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False, preexec_fn=before)
    assert expect is None or done.returncode == expect, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def records(batch):
    found = []
    for name in sorted(os.listdir(f"{batch}/tasks")) if os.path.isdir(f"{batch}/tasks") else []:
        if not name.startswith("."):
            with open(f"{batch}/tasks/{name}", encoding="utf-8") as file:
                found.append(json.load(file))
    return found


def files_of(results):
    found = {}
    for folder, _, names in os.walk(results):
        for name in names:
            path = os.path.join(folder, name)
            relative = os.path.relpath(path, results)
            if name not in NOT_CONTENT and not any(part.startswith(".") for part in relative.split(os.sep)):
                found[relative] = path
    return found


class Slurm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.dir = tempfile.mkdtemp(prefix="trigpoint-slurm-")
        cls.addClassCleanup(shutil.rmtree, cls.dir, ignore_errors=True)
        cls.cluster = slurm_cluster.Cluster(os.path.join(cls.dir, "slurm"))
        cls.addClassCleanup(cls.cluster.stop)
        cls.local = cls.make_site("local")
        trigpoint("batch", cls.list_of(cls.local), "--engine", "local")

    @classmethod
    def make_site(cls, name):
        site = os.path.join(cls.dir, name)
        shutil.copytree(os.path.join(SOURCE, "datasets/parking_lot"), site)
        shutil.rmtree(os.path.join(site, "runs/run1"))
        for run in RUNS[1:]:
            shutil.copytree(f"{site}/runs/run2", f"{site}/runs/{run}")
        # Coarse views, so that the whole of it takes seconds.
        with open(os.path.join(site, "trigpoint.yaml"), "w", encoding="utf-8") as file:
            file.write("stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n"
                       "  survey: {tie_points: false}\n")
        return site

    @classmethod
    def list_of(cls, site):
        path = f"{site}.txt"
        with open(path, "w", encoding="utf-8") as file:
            file.write(os.path.basename(site) + "\n")
        return path

    def submit(self, name, *options, **how):
        site = self.make_site(name)
        done = trigpoint("batch", self.list_of(site), "--engine", "slurm", *options, **how)
        return site, f"{site}-batch", done

    def wait_until_running(self, batch, node=None):
        """The first task that runs (on a node) and has begun to compute."""
        def running():
            return [r for r in records(batch) if r["end"] == "running" and node in (None, r["attempts"][-1]["host"])]
        self.cluster.wait_for(running, "a running task")
        return running()[0]

    def assert_same_as_local(self, site):
        wanted, found = files_of(f"{self.local}/results"), files_of(f"{site}/results")
        self.assertEqual(sorted(wanted), sorted(found))
        self.assertGreater(len(wanted), 40)
        # The report names its project and when it was made.
        other = [name for name in wanted if not name.startswith("report/") and
                 not filecmp.cmp(wanted[name], found[name], shallow=False)]
        self.assertEqual(other, [])
        self.assertEqual([name for name in os.listdir(f"{site}/results") if name.startswith((".tmp", ".old"))], [])

    def test_a_node_that_is_lost_loses_nothing(self):
        site, batch, done = self.submit("lost", "--threads", "1", "--partition", "other")
        self.assertLessEqual(len(done.stdout.splitlines()), 12)
        self.assertRegex(done.stdout, r"^Submitted \d+ array jobs to Slurm: 0 of 1 done")
        # While it is queued, a second one is refused.
        refused = trigpoint("batch", f"{site}.txt", "--engine", "slurm", expect=1).stderr
        self.assertRegex(refused, r"jobs? of this batch (is|are) in the queue")
        self.wait_until_running(batch, "node1")
        self.addCleanup(self.cluster.start_node, "node1")
        self.cluster.freeze_node("node1")
        lost = [i for i, r in enumerate(records(batch)) if r["end"] == "running" and r["attempts"][-1]["host"] == "node1"]
        self.assertGreater(len(lost), 0)
        self.cluster.lose_node("node1")
        self.cluster.tell_of_lost_node("node1")
        self.finish(batch, 600)
        summary = self.summary(batch)
        self.assertEqual((summary["done"], summary["failed"]), (1, 0))
        for i in lost:
            attempts = records(batch)[i]["attempts"]
            self.assertEqual([attempts[0]["host"], attempts[0]["ended"]], ["node1", ""])
            self.assertEqual(attempts[-1]["host"], "node2")
        self.assert_same_as_local(site)
        # Several tasks at a time, and what they cost.
        stages = summary["stages"]
        self.assertEqual(stages["features"]["tasks"], len(RUNS))
        for stage in ("features", "localize", "evaluate"):
            self.assertGreater(stages[stage]["cpu_seconds"], 0)
            self.assertGreater(stages[stage]["peak_memory_bytes"], 1 << 20)
        # The same again: nothing is computed twice, and what is asked for is what was measured.
        trigpoint("batch", f"{site}.txt", "--engine", "slurm", "--wait")
        again = records(batch)
        self.assertLessEqual({r["end"] for r in again}, {"up to date", "not needed"})
        asked = [r["attempts"][-1]["memory_bytes"] >> 20 for r in again if r["end"] == "up to date"]
        self.assertGreater(len(asked), 10)
        self.assertLess(max(asked), 2048)

    def test_what_lacks_memory_is_tried_with_more(self):
        # Every task is given less than most need: those that are killed for it are tried once more with twice of it.
        site, batch, _ = self.submit("small", "--task-memory", "120M", "--wait", expect=None)
        attempts = [r["attempts"] for r in records(batch)]
        again = [a for a in attempts if len(a) == 2]
        self.assertGreater(len(again), 0)
        for first, second in again:
            self.assertEqual([first["memory_bytes"] >> 20, second["memory_bytes"] >> 20], [120, 240])
        enough = [second for _, second in again if second["ended"]]
        self.assertGreater(max((a["peak_memory_bytes"] for a in enough), default=0), 120 << 20)
        self.assertTrue(all(len(a) <= 2 for a in attempts))
        # What 240 MiB are not enough for is left, and done with what the others showed and a larger default.
        trigpoint("batch", "resume", batch, "--task-memory", "2G", "--wait")
        self.assert_same_as_local(site)

    def test_cancel_and_resume(self):
        site, batch, _ = self.submit("cancelled")
        self.wait_until_running(batch)
        done = trigpoint("batch", "cancel", f"{site}.txt")
        self.assertLessEqual(len(done.stdout.splitlines()), 12)
        self.assertEqual(self.cluster.run("squeue", "-h"), "")
        ends = [r["end"] for r in records(batch)]
        self.assertIn("cancelled", ends)
        self.assertNotIn("running", ends)
        self.assertEqual(self.summary(batch)["entries"][0]["status"], "cancelled")
        trigpoint("batch", "resume", f"{site}.txt", "--wait")
        self.assertEqual(self.summary(batch)["done"], 1)
        self.assert_same_as_local(site)

    def test_a_full_disk_loses_nothing(self):
        # Slurm hands the limits of the one who submits to the tasks: files beyond 300 kB cannot be written.
        site, batch, _ = self.submit("full", "--wait", expect=1, limit=300_000)
        failed = [r for r in records(batch) if r["end"] == "failed"]
        self.assertGreater(len(failed), 0)
        self.assertTrue([r for r in failed if "disk" in r["reason"]], failed)
        self.assertTrue(all(len(r["attempts"]) == 1 for r in failed))  # its cause is named: not tried again
        self.assertIn("skipped", [r["end"] for r in records(batch)])
        self.assertEqual([n for n in os.listdir(f"{site}/results") if n.startswith(".tmp")], [])
        trigpoint("batch", "resume", batch, "--wait")
        self.assert_same_as_local(site)

    def test_container_and_options_reach_the_jobs(self):
        # A stand-in for Apptainer that writes down how it is called and runs the program.
        stand_in = os.path.join(self.dir, "bin/apptainer")
        os.makedirs(os.path.dirname(stand_in))
        with open(stand_in, "w", encoding="utf-8") as file:
            file.write(f"#!/bin/bash\necho \"$@\" >>{self.dir}/apptainer.log\n"
                       f"while [[ $1 != trigpoint ]]; do shift; done; shift\nexec {PROGRAM} \"$@\"\n")
        os.chmod(stand_in, 0o755)
        old = os.environ["PATH"]
        os.environ["PATH"] = os.path.dirname(stand_in) + ":" + old
        self.addCleanup(os.environ.__setitem__, "PATH", old)
        image = os.path.join(self.dir, "trigpoint.sif")
        here = os.getcwd()
        os.chdir(self.dir)
        self.addCleanup(os.chdir, here)
        site, batch, _ = self.submit("contained", "--container", "trigpoint.sif", "--partition", "other",
                                     "--sbatch=--comment=lot 7", "--sbatch=--hold", "--task-memory", "1.5G")
        jobs = self.cluster.run("squeue", "-h", "-r", "-o", "%i %P %k").splitlines()
        self.assertTrue(jobs and all(line.split(" ", 1)[1] == "other lot 7" for line in jobs), jobs)
        trigpoint("batch", "cancel", batch)
        done = trigpoint("batch", "status", batch, "--json")
        self.assertEqual(json.loads(done.stdout)["entries"][0]["status"], "cancelled")
        # What the first call was given stays, unless another is given now.
        trigpoint("batch", "resume", batch, "--partition", "main", "--sbatch=--comment=again", "--wait")
        with open(f"{self.dir}/apptainer.log", encoding="utf-8") as log:
            called = log.read().splitlines()
        self.assertTrue(all(line.startswith("exec --bind ") and f" {image} trigpoint batch " in line for line in called))
        self.assertTrue(any(f"--bind {site}" in line for line in called))
        self.assert_same_as_local(site)

    def test_the_guide_works_as_written(self):
        folder = os.path.join(self.dir, "guide")
        os.makedirs(folder)
        site = self.make_site("guide/my_site")
        with open(f"{folder}/sites.txt", "w", encoding="utf-8") as file:
            file.write("my_site\n")
        ran = 0
        for language, needs, text, line in guides_test.blocks(os.path.join(SOURCE, "docs/guides/cluster.md")):
            if language == "sh" and needs == "a Slurm cluster":
                path = os.path.dirname(PROGRAM) + os.pathsep + os.environ["PATH"]
                done = subprocess.run(["bash", "-e", "-c", text], cwd=folder, env={**os.environ, "PATH": path},
                                      capture_output=True, text=True, check=False)
                self.assertEqual(done.returncode, 0, f"cluster.md:{line}\n{done.stdout}\n{done.stderr}")
                ran += 1
        self.assertEqual(ran, 2)
        self.finish(f"{folder}/sites-batch", 600)
        self.assertEqual(self.summary(f"{folder}/sites-batch")["done"], 1)
        self.assert_same_as_local(site)

    def finish(self, batch, seconds):
        self.cluster.wait_for(lambda: self.cluster.run("squeue", "-h") == "", "the end of the batch", seconds)
        return trigpoint("batch", "status", batch)

    @staticmethod
    def summary(batch):
        with open(f"{batch}/summary.json", encoding="utf-8") as file:
            return json.load(file)


if __name__ == "__main__":
    if slurm_cluster.missing():
        print("skipped: not installed:", ", ".join(slurm_cluster.missing()))
        sys.exit(SKIPPED)
    unittest.main()
