#!/usr/bin/env python3
"""Copies a site with panoramas whose parts are turned, as imperfect stitching turns them.

  turn_panoramas.py SITE OUT SIGMA_DEG [SEED]

Each panorama is cut into five sectors (lenses), the first at a heading drawn at random. Each sector is turned by
angles about three axes that are drawn with SIGMA_DEG, 1 sigma, and blended into the next over 6 % of its width.
Ground truth stays as it is. Needs numpy and OpenCV for Python; the same arguments give the same pictures.
"""

import pathlib
import shutil
import sys

import cv2
import numpy as np

LENSES = 5
BLEND = 0.06


def rays(width, height):
    """Of the pixels of a panorama: right, down, forward."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    heading = (u + 0.5) / width * 2 * np.pi - np.pi
    up = np.pi / 2 - (v + 0.5) / height * np.pi
    right, forward = np.cos(up) * np.sin(heading), np.cos(up) * np.cos(heading)
    return heading, np.stack([right, -np.sin(up), forward], -1)


def turned(picture, sigma_deg, generator):
    height, width = picture.shape[:2]
    heading, ray = rays(width, height)
    first = generator.uniform(0, 2 * np.pi)
    turns = generator.normal(0, np.radians(sigma_deg), (LENSES, 3))
    place = (heading - first) % (2 * np.pi) / (2 * np.pi / LENSES)
    lens = np.floor(place).astype(int) % LENSES
    share = np.clip((place - np.floor(place) - (1 - BLEND)) / BLEND, 0, 1)[..., None]
    turn = turns[lens] * (1 - share) + turns[(lens + 1) % LENSES] * share
    ray = ray + np.cross(turn, ray)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    u = ((np.arctan2(ray[..., 0], ray[..., 2]) + np.pi) / (2 * np.pi) * width - 0.5).astype(np.float32)
    v = ((np.pi / 2 - np.arcsin(-ray[..., 1])) / np.pi * height - 0.5).astype(np.float32)
    return cv2.remap(picture, u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)


def main():
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    site, out, sigma_deg = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), float(sys.argv[3])
    generator = np.random.default_rng(int(sys.argv[4]) if len(sys.argv) == 5 else 1)
    shutil.copytree(site, out, ignore=shutil.ignore_patterns("results"))
    for path in sorted((out / "panoramas").iterdir()):
        picture = cv2.imread(str(path))
        if picture is None:
            sys.exit(f"{path}: expected a picture")
        cv2.imwrite(str(path), turned(picture, sigma_deg, generator), [cv2.IMWRITE_JPEG_QUALITY, 95])


if __name__ == "__main__":
    main()
