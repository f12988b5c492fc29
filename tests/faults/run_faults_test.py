#!/usr/bin/env python3
"""What run_faults.py makes of a result that a failed command left."""
import contextlib
import io
import json
import pathlib
import tempfile
import types
import unittest

import numpy as np

import run_faults

HEADER = "# trigpoint tags 1; frame=enu; datum=control; sigma=1\ntag_id,x,y,z,sigma_x_m,sigma_y_m,sigma_z_m\n"
NAMED = "error: odometry.tum contradicts the images"
OTHER = "error: something else"


class Judging(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.project = pathlib.Path(temporary.name)
        self.runner = object.__new__(run_faults.Runner)
        self.runner.run, self.runner.baseline = "run1", {"survey": {"warning: odometry takes 0 s"}}
        self.truth = types.SimpleNamespace(tags={"110": np.zeros(3)})

    def verdict(self, code, said, tags=None, cause="odometry", header=HEADER):
        if tags is not None:
            folder = self.project / "results" / "survey"
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "tags.csv").write_text(header + tags + "\n")
        return run_faults.verdict_of(self.runner.observe(self.project, ["detect", "survey"], code, said, self.truth), cause)

    def test_no_result_is_refused(self):
        self.assertEqual(self.verdict(1, NAMED), "refused")
        self.assertEqual(self.verdict(1, NAMED.replace("error", "trigpoint")), "refused")
        self.assertEqual(self.verdict(1, OTHER), "unnamed")
        self.assertEqual(self.verdict(-11, NAMED), "crashed")
        self.assertEqual(self.verdict(0, ""), "silent")

    def test_progress_and_old_warnings_name_nothing(self):
        self.assertEqual(self.verdict(1, "odometry against images: 3 s\nwarning: odometry takes 7 s\n" + OTHER), "unnamed")

    def test_what_is_always_said_names_nothing(self):
        said = ("error: localize: none of 9 panoramas and photos is localized: they show other places, or the run is wrong; "
                "check units, clocks and order of odometry and images, and the calibration; column reason of "
                "results/localize/*/panoramas.csv has the cause")
        self.assertEqual(self.verdict(1, said), "unnamed")
        self.assertEqual(self.verdict(1, said.replace("is wrong;", "is wrong: odometry is 3 times too long;")), "refused")

    def test_a_false_result_of_a_failed_command_is_false(self):
        self.assertEqual(self.verdict(1, NAMED, "110,0.88,0,0,0.2,0.2,0.2"), "FALSE")

    def test_a_right_result_of_a_failed_command_is_warned(self):
        self.assertEqual(self.verdict(1, NAMED, "110,0.1,0,0,0.2,0.2,0.2"), "warned")
        self.assertEqual(self.verdict(1, OTHER, "110,0.1,0,0,0.2,0.2,0.2"), "unnamed")

    def test_a_position_without_numbers_is_false(self):
        self.assertEqual(self.verdict(0, "", "110,0.1,0,0,,0.2,0.2"), "FALSE")

    def test_a_result_that_says_nothing_is_silent(self):
        self.assertEqual(self.verdict(0, "", "110,,,,,,"), "silent")

    def test_a_result_without_georeference_has_its_cause(self):
        other = HEADER.replace("enu", "map")
        self.assertEqual(self.verdict(0, NAMED.replace("error", "warning"), "110,0,0,0,1,1,1", header=other), "withheld")
        self.assertEqual(self.verdict(0, "", "110,0,0,0,1,1,1", header=other), "unnamed")
        self.assertEqual(self.verdict(0, NAMED, "110,0,0,0,1,1,1", cause=None, header=other), "unnamed")


class Table(unittest.TestCase):
    def test_columns_of_other_data_stay(self):
        with tempfile.TemporaryDirectory() as folder:
            page, measured = pathlib.Path(folder) / "faults.md", pathlib.Path(folder) / "a.json"
            first, second = run_faults.faults.FAULTS[:2]
            for name, verdict in (("a", "right"), ("b", "refused"), ("a", "warned")):
                results = [{"group": f.group, "fault": f.name, "verdict": verdict} for f in (first, second)]
                measured.write_text(json.dumps({"name": name, "results": results}))
                run_faults.write_table(page, [measured])
            text = page.read_text()
        self.assertIn("| a | 0 | 2 | 0 | 0 | 0 |\n| b | 0 | 0 | 0 | 2 | 0 |\n", text)
        self.assertIn(f"| {second.name} | warned | refused |\n", text)


class Stations(unittest.TestCase):
    """Truth and tables write one station in two ways."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.site = pathlib.Path(temporary.name)
        (self.site / "runs/back").mkdir(parents=True)
        (self.site / "runs/back/images.txt").write_text("0.5 images/1.jpg\n")
        (self.site / "origin.json").write_text('{"lat": 48, "lon": 8, "alt": 200}')
        (self.site / "back_cameras.tum").write_text("0.5 0 0 0 0 0 0 1\n")
        (self.site / "panoramas_back.tum").write_text("# station tx ty tz qx qy qz qw\n1 1 2 3 0 0 0 1\n40 4 5 6 0 0 0 1\n")

    def table(self, *stations):
        (self.site / "panoramas.csv").write_text("file,station\n" + "".join(f"{s}.jpg,{s}\n" for s in stations))
        return run_faults.Truth(self.site, self.site, "back")

    def test_each_panorama_has_its_truth(self):
        truth = self.table("S001", "S040")
        self.assertEqual(list(truth.panorama({"panorama": "S001.jpg", "station": "S040"})), [1, 2, 3])
        self.assertEqual(list(truth.panorama({"panorama": "another.jpg", "station": "S40"})), [4, 5, 6])
        self.assertIsNone(truth.panorama({"panorama": "another.jpg", "station": "S041"}))

    def test_truth_that_is_not_there_is_said(self):
        (self.site / "back_cameras.tum").unlink()
        with self.assertRaisesRegex(SystemExit, "truth of cameras, found none"):
            self.table("S001")

    def test_a_station_without_truth_is_said(self):
        with self.assertRaisesRegex(SystemExit, "none for S041"):
            self.table("S001", "S041")


class Resuming(unittest.TestCase):
    """A run that was stopped goes on with what its file has."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.file, self.asked = self.folder / "f.json", []
        (self.folder / "program").write_text("one")

    def run_all(self, stop_at=None, resume=True):
        runner = object.__new__(run_faults.Runner)
        runner.options = types.SimpleNamespace(program=self.folder / "program", site=self.folder, json=self.file,
                                               resume=resume, run="run1", every=1, features=0, jobs=1)
        runner.prepare = lambda: None
        runner.chosen = lambda: [(i, types.SimpleNamespace(name=f"fault {i}", group="odometry")) for i in range(4)]

        def one(index, fault):
            if index == stop_at:
                raise InterruptedError
            self.asked.append(index)
            return {"fault": fault.name, "group": fault.group, "index": index, "verdict": "right"}
        runner.one = one
        with contextlib.redirect_stdout(io.StringIO()):
            return runner.run_all()

    def test_what_is_there_is_not_made_again(self):
        with self.assertRaises(InterruptedError):
            self.run_all(stop_at=2)
        self.assertEqual([r["index"] for r in json.loads(self.file.read_text())["results"]], [0, 1])
        self.asked.clear()
        self.assertEqual([r["index"] for r in self.run_all()], [0, 1, 2, 3])
        self.assertEqual(self.asked, [2, 3])
        self.assertEqual(len(json.loads(self.file.read_text())["results"]), 4)

    def test_another_program_does_not_go_on_with_it(self):
        self.run_all()
        (self.folder / "program").write_text("two")
        with self.assertRaises(SystemExit):
            self.run_all()
        self.asked.clear()
        self.run_all(resume=False)
        self.assertEqual(self.asked, [0, 1, 2, 3])


if __name__ == "__main__":
    unittest.main()
