#!/usr/bin/python3
"""score_lot.py finds the errors that were put into a result."""
import os
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import score_lot  # noqa: E402

POSE = " 0 0 0 1"


def write(path, lines):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as out:
        out.write("\n".join(lines) + "\n")


class ScoreLot(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.truth, self.result = self.folder.name + "/truth", self.folder.name + "/result"
        # 70 m along a bend; stations 1 and 2 beside it, 3 far away.
        self.path = [np.array([i, 0.01 * i * i, 0.1 * np.sin(i)]) for i in range(71)]
        self.stations = {1: np.array([20.0, 8, 1]), 2: np.array([50.0, 30, 1]), 3: np.array([500.0, 0, 1])}
        write(f"{self.truth}/runs/r_cameras.tum", [f"{i} {p[0]} {p[1]} {p[2]}{POSE}" for i, p in enumerate(self.path)])
        write(f"{self.truth}/panoramas.tum", [f"{k} {p[0]} {p[1]} {p[2]}{POSE}" for k, p in self.stations.items()])

    def tearDown(self):
        self.folder.cleanup()

    def score(self, odom, world, panoramas):
        """odom, world: functions of a true position; panoramas: rows (station, status, place in odom, in the world)."""
        write(f"{self.result}/cameras_odom.tum", ["# c"] + [f"{i} {x} {y} {z}{POSE}" for i, (x, y, z) in enumerate(map(odom, self.path))])
        write(f"{self.result}/cameras.tum", [f"{i} {x} {y} {z}{POSE}" for i, (x, y, z) in enumerate(map(world, self.path))])
        rows = ["# c", "panorama,station,status,x,y,z,sigma_x_m,sigma_y_m,sigma_z_m,odom_x,odom_y,odom_z,odom_qx,odom_qy,odom_qz,odom_qw"]
        for station, status, o, w in panoramas:
            place = [""] * 13 if o is None else [*w, 0.1, 0.1, 0.1, *o, 0, 0, 0, 1]
            rows.append(",".join(map(str, ["p.jpg", f"S{station:03d}", status, *place])))
        # A hand-held set beside station 1 is another place.
        rows.append(",".join(map(str, ["station_001", "station_001", "localized", *[9] * 6, *[9] * 3, 0, 0, 0, 1])))
        write(f"{self.result}/panoramas.csv", rows)
        return score_lot.summarise(score_lot.score_run(self.result, self.truth, "r"))

    def test_perfect(self):
        move = lambda p: p + [5, -3, 2]
        score = self.score(move, lambda p: p, [(k, "localized", move(self.stations[k]), self.stations[k]) for k in (1, 2)])
        self.assertEqual((score["answers"], score["expected"], score["answered"], score["missing"]), (2, 2, 2, []))
        for key in ("pano_max", "pano_rot_deg", "nees", "cam_h", "cam_v", "ate", "ate_sim", "scale_percent", "rpe_m", "rpe_deg"):
            self.assertAlmostEqual(score[key], 0, places=5, msg=key)

    def test_known_errors(self):
        shift = np.array([0.3, 0, 0.4])
        score = self.score(lambda p: 0.99 * p, lambda p: p + [0.3, 0.4, -0.2],
                           [(1, "localized", 0.99 * self.stations[1] + [0, 0, 0.2], self.stations[1] + shift), (2, "rejected", None, None)])
        self.assertEqual((score["answers"], score["expected"], score["missing"]), (1, 2, [2]))
        self.assertAlmostEqual(score["scaled_median"], 0.2 / 0.99, places=6)  # all that is not scale
        self.assertAlmostEqual(score["cam_h"], 0.5)
        self.assertAlmostEqual(score["cam_v"], 0.2)
        self.assertAlmostEqual(score["nees"], (0.3 ** 2 + 0.4 ** 2) / 0.01 / 3)
        self.assertAlmostEqual(score["scale_percent"], -1, places=6)
        self.assertAlmostEqual(score["ate_sim"], 0, places=6)
        self.assertGreater(score["ate"], 0.1)
        self.assertAlmostEqual(score["rpe_m"], 0, places=6)  # the scale is taken out
        # 0.2 m of its own, and of the scale only what is left between the station and the cameras within 15 m.
        self.assertAlmostEqual(score["pano_max"], 0.2, delta=0.1)


if __name__ == "__main__":
    unittest.main()
