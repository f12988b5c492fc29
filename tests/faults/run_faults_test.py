#!/usr/bin/env python3
"""What run_faults.py makes of a result that a failed command left."""
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


if __name__ == "__main__":
    unittest.main()
