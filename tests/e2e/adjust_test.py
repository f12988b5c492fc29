#!/usr/bin/env python3
"""`trigpoint adjust` on the embedded site: two runs in one solution, and where that shows.

    adjust_test.py PROGRAM SOURCE
"""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest


def trigpoint(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)


def rows(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


class Adjust(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.dir = tempfile.mkdtemp(prefix="trigpoint adjust ")
        cls.addClassCleanup(shutil.rmtree, cls.dir)
        cls.site = os.path.join(cls.dir, "site")
        shutil.copytree(os.path.join(SOURCE, "datasets/parking_lot"), cls.site)
        for part in ("photos", "board"):
            shutil.rmtree(os.path.join(cls.site, part))
        with open(os.path.join(cls.site, "trigpoint.yaml"), "w", encoding="utf-8") as file:
            file.write("stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n")
        done = trigpoint("localize", cls.site)
        assert done.returncode == 0, done.stderr
        cls.done = trigpoint("adjust", cls.site)

    def test_joins_the_runs(self):
        self.assertEqual(self.done.returncode, 0, self.done.stderr)
        lines = [line for line in self.done.stdout.split("\n") if line]
        self.assertLessEqual(len(lines), 12, self.done.stdout)
        self.assertTrue(lines[0].startswith("Adjust done in"), lines[0])
        result = os.path.join(self.site, "results", "site")
        runs = rows(result, "runs.csv")
        self.assertEqual([run["run"] for run in runs], ["run1", "run2"])
        panoramas = rows(result, "panoramas.csv")
        names = [row["panorama"] for row in panoramas]
        self.assertEqual(len(names), len(set(names)))  # each once
        shared = [row for row in panoramas if row["runs"] == "run1+run2"]
        self.assertGreater(len(shared), 0)
        self.assertEqual(int(runs[0]["shared_panoramas"]), len(shared))
        self.assertTrue(os.path.exists(os.path.join(result, "solution.db")))
        for run in ("run1", "run2"):
            alone = rows(self.site, "results", "localize", run, "cameras.csv")
            joint = rows(result, run, "cameras.csv")
            self.assertEqual([row["image"] for row in joint], [row["image"] for row in alone])
            self.assertEqual(len(rows(result, run, "cameras_cov.csv")), len(joint))

    def test_stands_beside_the_runs(self):
        done = trigpoint("evaluate", self.site)
        self.assertEqual(done.returncode, 0, done.stderr)
        errors = rows(self.site, "results", "evaluate", "errors.csv")
        mine = [row for row in errors if row["variant"] == "site"]
        self.assertGreater(len(mine), 0)
        self.assertEqual({row["run"] for row in mine}, {"site"})
        status = json.loads(trigpoint("status", self.site, "--json").stdout)
        states = {row["stage"]: row["state"] for row in status["stages"] if not row["name"]}
        self.assertEqual(states["site"], "done")

    def test_a_variant_of_the_command_line_is_done_on_every_page(self):
        """Its options are in no trigpoint.yaml: the report must not say that it is out of date."""
        done = trigpoint("adjust", self.site, "--use", "control", "--variant", "held")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(trigpoint("report", self.site).returncode, 0)
        with open(os.path.join(self.site, "results/report/index.html"), encoding="utf-8") as page:
            cells = re.findall(r"<td[^>]*>(?:<[^>]+>)*([^<]*)", page.read())
        self.assertEqual(cells[cells.index("site@held") + 1], "done")

    def test_of_runs_that_are_not_there(self):
        done = trigpoint("adjust", self.site, "--run", "run3")
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("run3", done.stderr)


if __name__ == "__main__":
    PROGRAM, SOURCE = sys.argv[1:3]
    unittest.main(argv=sys.argv[:1])
