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

from expected_ate import Solution, ate
from score_lot import rotation

DRAWS = 20


def poses_of(file):
    rows = [line.split() for line in open(file, encoding="utf-8") if line.strip() and line[0] != "#"]
    return {round(float(row[0]) * 1e6): np.array(row[1:8], float) for row in rows}


class AtTruth(Solution):
    """The solution's tracks of its own images, at the true poses; world_from_cam becomes rig_from_world."""

    def __init__(self, file, truth):
        super().__init__(file)
        self.before = ate(self.centres(np.zeros((len(self.rotation), 6))), self.true_centres(file, truth))
        threshold = float(self.db(file).execute("select loss from run").fetchone()[0].split()[1])
        squares = (self.residuals() ** 2).sum(1)
        kernel = np.minimum(1, (2 * threshold / (threshold + squares)) ** 2)  # Dynamic Covariance Scaling
        self.weight = self.weight * np.sqrt(kernel)[:, None, None]
        self.move_to(self.true_rotation, self.true_translation)
        own = self.pose < self.bodies
        seen = np.bincount(self.point[own], minlength=len(self.points))
        self.keep(own & (seen[self.point] >= 2))
        self.triangulate()

    @staticmethod
    def db(file):
        return sqlite3.connect(f"file:{file}?mode=ro", uri=True)

    def true_centres(self, file, truth):
        """Of the first view of every body pose; keeps the true poses."""
        self.true_rotation, self.true_translation = self.rotation.copy(), self.translation.copy()
        for stamp, camera, pose in self.db(file).execute("select stamp_ns, camera, pose from images"):
            nearest = min(truth, key=lambda t: abs(t - stamp / 1000))
            if abs(nearest - stamp / 1000) > 1000:
                raise SystemExit(f"no true pose within 1 ms of {stamp} ns")
            turn = rotation(truth[nearest][3:7]).T
            rig_from_view = self.view_rotation[camera].T
            self.true_rotation[pose] = rig_from_view @ turn
            self.true_translation[pose] = rig_from_view @ (-turn @ truth[nearest][:3] - self.view_translation[camera])
        view, shift = self.view_rotation[0], self.view_translation[0]
        own = slice(0, self.bodies)
        return -np.einsum("nji,nj->ni", view @ self.true_rotation[own], self.true_translation[own] @ view.T + shift)

    def move_to(self, rotations_, translations):
        """Points go along by the similarity that takes the solution's centres to the true ones."""
        old = -np.einsum("nji,nj->ni", self.rotation, self.translation)[:self.bodies]
        new = -np.einsum("nji,nj->ni", rotations_, translations)[:self.bodies]
        a, b = old - old.mean(0), new - new.mean(0)
        u, _, v = np.linalg.svd(b.T @ a)
        turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
        scale = (b * (a @ turn.T)).sum() / (a * a).sum()
        self.points = scale * (self.points - old.mean(0)) @ turn.T + new.mean(0)
        self.rotation, self.translation = rotations_, translations

    def keep(self, which):
        self.point, self.pose, self.view = self.point[which], self.pose[which], self.view[which]
        self.weight = self.weight[which]

    def residuals(self):
        turned = np.einsum("nij,nj->ni", self.rotation[self.pose], self.points[self.point])
        in_view = np.einsum("nij,nj->ni", self.view_rotation[self.view], turned + self.translation[self.pose])
        in_view += self.view_translation[self.view]
        return np.einsum("nij,nj->ni", self.weight, in_view / np.linalg.norm(in_view, axis=1)[:, None])

    def triangulate(self):
        for _ in range(10):
            _, of_point = self.jacobians()
            n = len(self.points)
            normal, right = np.zeros((n, 3, 3)), np.zeros((n, 3))
            np.add.at(normal, self.point, np.einsum("nij,nil->njl", of_point, of_point))
            np.add.at(right, self.point, np.einsum("nij,ni->nj", of_point, self.residuals()))
            normal += 1e-9 * np.eye(3)
            self.points -= np.linalg.solve(normal, right[:, :, None])[:, :, 0]

    def gradient(self):
        """A function of residuals: what they ask of the poses once points have followed."""
        of_pose, of_point = self.jacobians()
        n = len(self.points)
        normal = np.zeros((n, 3, 3))
        np.add.at(normal, self.point, np.einsum("nij,nil->njl", of_point, of_point))
        inverse = np.linalg.inv(normal + 1e-9 * np.eye(3))

        def ask(residuals):
            right = np.zeros((n, 3))
            np.add.at(right, self.point, np.einsum("nij,ni->nj", of_point, residuals))
            moved = np.einsum("nij,nj->ni", inverse, right)[self.point]
            rest = residuals - np.einsum("nij,nj->ni", of_point, moved)
            out = np.zeros((len(self.rotation), 6))
            np.add.at(out, self.pose, np.einsum("nij,ni->nj", of_pose, rest))
            return out.ravel()

        return ask


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    at_truth = AtTruth(sys.argv[1], poses_of(sys.argv[2]))
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
