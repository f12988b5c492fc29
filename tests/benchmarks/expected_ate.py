#!/usr/bin/env python3
"""What ATE (after a similarity fit) the noise of the matches and of odometry leaves possible: the information limit.

  expected_ate.py SOLUTION.db...

Reads solutions of `reconstruct` or `localize`. The normal equations of poses and points are formed at the solution, with
the weights that it states; poses are drawn from their joint covariance 300 times and compared with the solution as an
ATE compares a trajectory with the truth. Prints the mean and the 5 and 95 % quantiles in metres. Errors that matches
share, of the lens or of the truth, are not in it: a measured ATE above the 95 % quantile has another cause than noise.
"""
import sqlite3
import sys

import numpy as np

from score_lot import rigid_fit, rms, rotation

DRAWS = 300


def rotations(rows):
    return np.array([rotation(q) for q in rows])


def skew(v):
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.moveaxis(np.array([[o, -z, y], [z, o, -x], [-y, x, o]]), (0, 1), (-2, -1))


class Solution:
    """Poses rig_from_odom with left tangents [rotation (rad), translation (m)], as file_formats.md describes."""

    def __init__(self, file):
        db = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        poses = np.array(list(db.execute("select * from poses")), float)
        self.rotation, self.translation, self.held = rotations(poses[:, :4]), poses[:, 4:7], poses[:, 7] > 0
        views = np.array(list(db.execute("select * from views")), float)
        self.view_rotation, self.view_translation = rotations(views[:, :4]), views[:, 4:7]
        self.bodies = db.execute("select count(*) from body_poses").fetchone()[0]
        self.points = np.array(list(db.execute("select x, y, z from points")), float)
        rows = [r for r in db.execute("select point, pose, view, w from observations where active order by point")
                if np.isfinite(self.points[r[0]]).all()]
        self.point, self.pose, self.view = np.array([r[:3] for r in rows]).T
        self.weight = np.array([np.frombuffer(r[3], "<f4") for r in rows], float).reshape(-1, 3, 2).transpose(0, 2, 1)
        self.odometry = list(db.execute("select a, b, measured_tx, measured_ty, measured_tz, sqrt_info from factors "
                                        "where kind = 'between' and a < b"))

    def jacobians(self):
        """Of the whitened observations by their pose (n x 2 x 6) and their point (n x 2 x 3)."""
        turned = np.einsum("nij,nj->ni", self.rotation[self.pose], self.points[self.point])
        in_view = np.einsum("nij,nj->ni", self.view_rotation[self.view], turned + self.translation[self.pose])
        in_view += self.view_translation[self.view]
        depth = np.linalg.norm(in_view, axis=1)[:, None, None]
        ray = in_view[:, :, None] / depth
        across = self.weight @ (np.eye(3) - ray @ ray.transpose(0, 2, 1)) / depth @ self.view_rotation[self.view]
        return np.concatenate([-across @ skew(turned), across], axis=2), across @ self.rotation[self.pose]

    def information(self):
        """Of all poses together, points and odometry's noise taken into account."""
        n = len(self.rotation)
        blocks = np.zeros((n, n, 6, 6))
        of_pose, of_point = self.jacobians()
        begins = np.flatnonzero(np.r_[True, np.diff(self.point) > 0])
        lengths = np.diff(np.r_[begins, len(self.point)])
        for length in np.unique(lengths):  # tracks of one length together
            index = begins[lengths == length][:, None] + np.arange(length)
            poses, a, x = self.pose[index], of_pose[index], of_point[index]
            at_point = np.linalg.inv(np.einsum("mkij,mkil->mjl", x, x) + 1e-9 * np.eye(3))
            cross = np.einsum("mkij,mkil->mkjl", a, x)
            np.add.at(blocks, (poses, poses), np.einsum("mkij,mkil->mkjl", a, a))
            for i in range(length):
                left = cross[:, i] @ at_point
                for j in range(length):
                    np.subtract.at(blocks, (poses[:, i], poses[:, j]), left @ cross[:, j].transpose(0, 2, 1))
        for a, b, x, y, z, root in self.odometry:
            root = np.frombuffer(root, "<f8").reshape(6, 6).T
            candidates = []
            for i, j in ((a, b), (b, a)):  # which of both ways was measured
                between = self.rotation[j] @ self.rotation[i].T
                moved = between @ self.translation[i]
                candidates.append((np.linalg.norm(self.translation[j] - moved - (x, y, z)), i, j, between, moved))
            _, i, j, between, moved = min(candidates, key=lambda c: c[0])
            lever, o = skew(moved), np.zeros((3, 3))
            of_j = root @ np.block([[np.eye(3), o], [lever, np.eye(3)]])
            of_i = root @ np.block([[-between, o], [-lever @ between, -between]])
            for p, jp in ((i, of_i), (j, of_j)):
                for q, jq in ((i, of_i), (j, of_j)):
                    blocks[p, q] += jp.T @ jq
        return blocks.transpose(0, 2, 1, 3).reshape(6 * n, 6 * n)

    def centres(self, step):
        """Of the first view of every body pose, odom, after a step of all poses (n x 6)."""
        angle = np.maximum(np.linalg.norm(step[:, :3], axis=1), 1e-12)[:, None, None]
        k = skew(step[:, :3])
        turn = np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k
        turned = self.view_rotation[0] @ (turn @ self.rotation)
        translation = (self.translation + step[:, 3:]) @ self.view_rotation[0].T + self.view_translation[0]
        return -np.einsum("nji,nj->ni", turned, translation)[:self.bodies]


def similarity(source, target):
    """A function that takes positions by the similarity that brings source to target, least squares (Umeyama)."""
    turn, _ = rigid_fit(source, target)
    a, b = (source - source.mean(0)) @ turn.T, target - target.mean(0)
    scale = (a * b).sum() / (a * a).sum()
    return lambda positions: scale * (positions - source.mean(0)) @ turn.T + target.mean(0)


def ate(estimate, truth):
    return rms(similarity(estimate, truth)(estimate) - truth)


def expected(file):
    solution = Solution(file)
    free = np.flatnonzero(np.repeat(~solution.held, 6))
    information = solution.information()[np.ix_(free, free)]
    root = np.linalg.cholesky(0.5 * (information + information.T))
    generator = np.random.default_rng(1)
    at = solution.centres(np.zeros((len(solution.rotation), 6)))
    values = []
    for _ in range(DRAWS):
        step = np.zeros(6 * len(solution.rotation))
        step[free] = np.linalg.solve(root.T, generator.normal(size=len(free)))
        values.append(ate(solution.centres(step.reshape(-1, 6)), at))
    return np.mean(values), *np.quantile(values, [0.05, 0.95])


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    for file in sys.argv[1:]:
        print("{}: {:.4f} m, 90 % within {:.4f} to {:.4f} m".format(file, *expected(file)))


if __name__ == "__main__":
    main()
