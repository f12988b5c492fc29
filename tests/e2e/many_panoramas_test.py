#!/usr/bin/env python3
"""A site with more panoramas than one part of the references holds: the embedded one among a town of others.

    many_panoramas_test.py PROGRAM SOURCE
"""

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

from PIL import Image, ImageChops

OTHERS = 140
HEADER = ("file,station,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,"
          "sigma_h_m,sigma_v_m,sigma_heading_deg,sigma_tilt_deg")


def trigpoint(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)


def rows(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


class ManyPanoramas(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.dir = tempfile.mkdtemp(prefix="trigpoint many ")
        cls.addClassCleanup(shutil.rmtree, cls.dir)
        cls.site = os.path.join(cls.dir, "site")
        shutil.copytree(os.path.join(SOURCE, "datasets/parking_lot"), cls.site)
        for part in ("photos", "board", "runs/run2"):
            shutil.rmtree(os.path.join(cls.site, part))
        cls.own = [row["file"] for row in rows(cls.site, "panoramas.csv")]
        os.mkdir(os.path.join(cls.site, "town"))
        small = [Image.open(os.path.join(cls.site, file)).resize((512, 256)) for file in cls.own]
        with open(os.path.join(cls.site, "panoramas.csv"), "a", encoding="utf-8") as table:
            for k in range(OTHERS):
                table.write(cls.other(small, k) + "\n")
        with open(os.path.join(cls.site, "trigpoint.yaml"), "w", encoding="utf-8") as file:
            file.write("stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n"
                       "  localize: {retrieval: {words: 2000, most_references: 30}}\n")
        cls.done = trigpoint("localize", cls.site, "--run", "run1", "--verbose")

    @classmethod
    def other(cls, small, k):
        """A picture of the town, 1 to 15 km from the site, upside down; its row of the table."""
        picture = ImageChops.offset(small[k % len(small)], 37 * k, 0).rotate(180)
        file = f"town/{k:03d}.jpg"
        picture.save(os.path.join(cls.site, file), quality=80)
        latitude, longitude = 48.022 + 0.01 * (k // 12), 7.84 + 0.01 * (k % 12)
        return f"{file},T{k},{latitude:.6f},{longitude:.6f},242,{k},0,0,0.3,0.5,1,0.3"

    def parts(self):
        """Time of computation of each part's result."""
        names = sorted(n for n in os.listdir(os.path.join(self.site, "results")) if n.startswith("references"))
        times = {}
        for name in names:
            with open(os.path.join(self.site, "results", name, "manifest.json"), encoding="utf-8") as file:
                times[name] = json.load(file)
        return times

    def test_a_run_is_tested_with_the_references_of_its_region(self):
        self.assertEqual(self.done.returncode, 0, self.done.stderr)
        answers = {row["panorama"]: row for row in rows(self.site, "results", "localize", "run1", "panoramas.csv")}
        self.assertEqual(len(answers), len(self.own) + OTHERS)
        for file in self.own:
            self.assertEqual(answers[file]["status"], "localized", answers[file])
        reasons = [row["reason"] for file, row in answers.items() if file not in self.own]
        self.assertGreaterEqual(sum(r.startswith("not tested, as the run is elsewhere") for r in reasons), OTHERS - 30)

    def test_another_panorama_changes_one_part_only(self):
        before = self.parts()
        self.assertEqual(list(before), ["references@000of002", "references@001of002"])
        self.assertEqual(sum(m["metrics"]["pictures"] for m in before.values()), len(self.own) + OTHERS)
        # The words of both are in the first one's codebook, whose options were written as another stage's.
        self.assertEqual(before["references@000of002"]["options"]["codebook"]["words"], 2000)
        self.assertIn("codebook.bin", before["references@000of002"]["files"])
        self.assertNotIn("codebook.bin", before["references@001of002"]["files"])
        small = [Image.open(os.path.join(self.site, file)).resize((512, 256)) for file in self.own]
        with open(os.path.join(self.site, "panoramas.csv"), "a", encoding="utf-8") as table:
            # One that is not among the 32 whose pictures the codebook is made from.
            table.write(self.other(small, OTHERS + 6) + "\n")
        state = trigpoint("status", self.site)
        self.assertEqual(state.stdout.count("references@"), 2, state.stdout)
        done = trigpoint("references", self.site)
        self.assertEqual(done.returncode, 0, done.stderr)
        after = self.parts()
        changed = [name for name in after if after[name]["identity"] != before[name]["identity"]]
        self.assertEqual(len(changed), 1)
        pictures = [m["metrics"]["pictures"] for m in (before[changed[0]], after[changed[0]])]
        self.assertEqual(pictures[1] - pictures[0], 1)
        self.assertNotIn("references", [n for n in os.listdir(os.path.join(self.site, "results"))])


if __name__ == "__main__":
    PROGRAM, SOURCE = sys.argv[1:3]
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
