#!/usr/bin/env python3
"""Do the errors of a solution come from single tracks, or do tracks share them?

  shared_errors.py SOLUTION.db CAMERAS.tum

Triangulates the solution's tracks from the true poses (world_from_cam) and solves the normal equations there, once, with
the weights of the solution: the ATE that the matches' residuals cause, odometry free of error. Then the residuals change
their sign at random: of whole tracks, and of single observations. Tracks whose errors are independent cause the same ATE
with any signs. Where the ATE falls when tracks change their signs, tracks share errors: of the lens, of the ground truth,
of the way in which features follow the viewpoint. Where it falls only when observations do, errors stay the same along a
track. Means over 20 draws, m.
"""
import sqlite3
import sys

import numpy as np

from expected_ate import Solution, ate, similarity
from score_lot import nearest, rotation, tum

DRAWS = 20


class AtTruth(Solution):
    """The solution's tracks of its own images, at the true poses; world_from_cam becomes rig_from_world."""

    def __init__(self, file, truth):
        super().__init__(file)
        db = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        threshold = float(db.execute("select loss from run").fetchone()[0].split()[1])
        squares = (self.residuals() ** 2).sum(1)
        kernel = np.minimum(1, (2 * threshold / (threshold + squares)) ** 2)  # Dynamic Covariance Scaling
        self.weight = self.weight * np.sqrt(kernel)[:, None, None]
        still = np.zeros((len(self.rotation), 6))
        before = self.centres(still)
        self.take_true_poses(db, truth)
        self.before = ate(before, self.centres(still))
        self.points = similarity(before, self.centres(still))(self.points)
        own = self.pose < self.bodies
        seen = np.bincount(self.point[own], minlength=len(self.points))
        self.keep(own & (seen[self.point] >= 2))
        self.triangulate()

    def take_true_poses(self, db, truth):
        for stamp, camera, pose in db.execute("select stamp_ns, camera, pose from images"):
            time = nearest(stamp / 1e9, truth)
            if abs(time - stamp / 1e9) > 1e-3:
                raise SystemExit(f"no true pose within 1 ms of {stamp} ns")
            turn, centre = rotation(truth[time][3:]).T, truth[time][:3]
            rig_from_view = self.view_rotation[camera].T
            self.rotation[pose] = rig_from_view @ turn
            self.translation[pose] = rig_from_view @ (-turn @ centre - self.view_translation[camera])

    def keep(self, which):
        self.point, self.pose, self.view = self.point[which], self.pose[which], self.view[which]
        self.weight = self.weight[which]

    def residuals(self):
        turned = np.einsum("nij,nj->ni", self.rotation[self.pose], self.points[self.point])
        in_view = np.einsum("nij,nj->ni", self.view_rotation[self.view], turned + self.translation[self.pose])
        in_view += self.view_translation[self.view]
        return np.einsum("nij,nj->ni", self.weight, in_view / np.linalg.norm(in_view, axis=1)[:, None])

    def point_steps(self, of_point):
        """A function of residuals: the steps of the points that reduce them most."""
        normal = np.tile(1e-9 * np.eye(3), (len(self.points), 1, 1))
        np.add.at(normal, self.point, np.einsum("nij,nil->njl", of_point, of_point))
        inverse = np.linalg.inv(normal)

        def steps(residuals):
            right = np.zeros((len(self.points), 3))
            np.add.at(right, self.point, np.einsum("nij,ni->nj", of_point, residuals))
            return -np.einsum("nij,nj->ni", inverse, right)

        return steps

    def triangulate(self):
        for _ in range(10):
            self.points += self.point_steps(self.jacobians()[1])(self.residuals())

    def gradient(self):
        """A function of residuals: what they ask of the poses once points have followed."""
        of_pose, of_point = self.jacobians()
        steps = self.point_steps(of_point)

        def ask(residuals):
            rest = residuals + np.einsum("nij,nj->ni", of_point, steps(residuals)[self.point])
            out = np.zeros((len(self.rotation), 6))
            np.add.at(out, self.pose, np.einsum("nij,ni->nj", of_pose, rest))
            return out.ravel()

        return ask


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    at_truth = AtTruth(sys.argv[1], tum(sys.argv[2]))
    free = np.arange(6, 6 * at_truth.bodies)  # the first pose is held
    information = at_truth.information()[np.ix_(free, free)]
    inverse, ask = np.linalg.inv(information), at_truth.gradient()
    size = np.zeros((len(at_truth.rotation), 6))
    true = at_truth.centres(size)

    def caused(residuals):
        step = np.zeros(size.size)
        step[free] = -inverse @ ask(residuals)[free]
        return ate(at_truth.centres(step.reshape(-1, 6)), true)

    residuals = at_truth.residuals()
    residuals[np.abs(residuals).max(1) > 10] = 0  # wrong matches
    generator = np.random.default_rng(1)
    signs = generator.choice([-1, 1], size=(DRAWS, len(at_truth.points)))
    tracks = np.mean([caused(residuals * s[at_truth.point][:, None]) for s in signs])
    single = np.mean([caused(residuals * generator.choice([-1, 1], size=(len(residuals), 1))) for _ in range(DRAWS)])
    print(f"ATE of the solution {at_truth.before:.4f}, of its matches' residuals {caused(residuals):.4f}, signs of tracks "
          f"at random {tracks:.4f}, of observations {single:.4f}")


if __name__ == "__main__":
    main()
