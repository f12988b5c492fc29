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


class Judging(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.project = pathlib.Path(temporary.name)
        self.runner = object.__new__(run_faults.Runner)
        self.runner.run, self.runner.baseline = "run1", {}
        self.runner.truth = types.SimpleNamespace(tags={"110": np.zeros(3)})

    def verdict(self, code, said, tags=None):
        if tags:
            folder = self.project / "results" / "survey"
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "tags.csv").write_text(HEADER + tags + "\n")
        fault = types.SimpleNamespace(cause="odometry")
        return self.runner.judge(self.project, ["detect", "survey"], code, said, fault)["verdict"]

    def test_no_result_is_refused(self):
        self.assertEqual(self.verdict(1, "odometry.tum contradicts the images"), "refused")
        self.assertEqual(self.verdict(1, "something else"), "unnamed")

    def test_a_false_result_of_a_failed_command_is_false(self):
        self.assertEqual(self.verdict(1, "odometry.tum contradicts the images", "110,0.88,0,0,0.2,0.2,0.2"), "FALSE")

    def test_a_right_result_of_a_failed_command_is_warned(self):
        self.assertEqual(self.verdict(1, "odometry.tum contradicts the images", "110,0.1,0,0,0.2,0.2,0.2"), "warned")
        self.assertEqual(self.verdict(1, "something else"), "unnamed")


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
