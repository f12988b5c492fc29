"""A small site of six tags with exact geometry: a run that drives towards them, with detections in place of images.

Control 0 to 2, check points 3 and 4, tag 5 free; the noise is drawn from a fixed seed.
"""
import math
import os
import random

import numpy as np

ORIGIN = (48.0125518, 7.8322567, 240.0)
SIZE = 0.4
# East, north, up of the centres, and how far each is turned about its upright axis.
TAGS = {0: (10, 2.5, 0.5, 0.4), 1: (11, -2.5, 1.5, -0.5), 2: (12, 0.3, 2.6, 0.45), 3: (10.5, -1.0, -0.6, -0.4),
        4: (12.5, 1.8, 1.9, 0.5), 5: (11.5, -0.4, 0.7, -0.45)}


def ecef(lat, lon, h):
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    lat, lon = math.radians(lat), math.radians(lon)
    n = a / math.sqrt(1 - e2 * math.sin(lat) ** 2)
    return np.array([(n + h) * math.cos(lat) * math.cos(lon), (n + h) * math.cos(lat) * math.sin(lon),
                     (n * (1 - e2) + h) * math.sin(lat)])


def axes():
    """Rows: east, north, up at the site's origin."""
    la, lo = math.radians(ORIGIN[0]), math.radians(ORIGIN[1])
    return np.array([[-math.sin(lo), math.cos(lo), 0],
                     [-math.sin(la) * math.cos(lo), -math.sin(la) * math.sin(lo), math.cos(la)],
                     [math.cos(la) * math.cos(lo), math.cos(la) * math.sin(lo), math.sin(la)]])


def geodetic(point):
    """Latitude, longitude, height of a point of the site's east-north-up frame."""
    wanted = axes().T @ np.array(point[:3], float) + ecef(*ORIGIN)
    lat, lon, h = ORIGIN
    for _ in range(8):  # Newton's method with numeric derivatives
        at = ecef(lat, lon, h)
        j = np.array([(ecef(lat + 1e-6, lon, h) - at) / 1e-6, (ecef(lat, lon + 1e-6, h) - at) / 1e-6,
                      (ecef(lat, lon, h + 1e-2) - at) / 1e-2]).T
        d = np.linalg.solve(j, wanted - at)
        lat, lon, h = lat + d[0], lon + d[1], h + d[2]
    return lat, lon, h


def control_rows(role=lambda i: "control" if i < 3 else "check"):
    rows = []
    for tag in range(5):
        lat, lon, h = geodetic(TAGS[tag])
        rows.append(f"{tag},{role(tag)},{lat:.10f},{lon:.10f},{h:.4f},0.003,0.003")
    return rows


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as out:
        out.write(text)


def write_run(folder, seed):
    rng = random.Random(seed)
    rows = ["timestamp,image,camera,family,tag_id,hamming,margin,u0,v0,u1,v1,u2,v2,u3,v3,sigma_px"]
    poses = []
    for k in range(21):
        t, x, y = 100 + 0.2 * k, 0.25 * k, 0.4 * math.sin(0.3 * k)
        poses.append(f"{t:.1f} {x:.6f} {y:.6f} 0 0 0 0 1")
        for tag, (e, n, u, turn) in TAGS.items():
            pixels = []
            for sx, sy in ((-1, 1), (1, 1), (1, -1), (-1, -1)):
                right, down = sx * SIZE / 2, sy * SIZE / 2
                # Camera axes: right = -north, down = -up, forward = east.
                cx = -(n - y) + right * math.cos(turn)
                cy = -u + down
                cz = (e - x) + right * math.sin(turn)
                pixels += [500 * cx / cz + 479.5 + rng.gauss(0, 0.1), 500 * cy / cz + 359.5 + rng.gauss(0, 0.1)]
            if all(0 < p < 959 for p in pixels[::2]) and all(0 < p < 719 for p in pixels[1::2]):
                rows.append(f"{t:.1f},,cam0,tag36h11,{tag},0,80," + ",".join(f"{p:.3f}" for p in pixels) + ",0.1")
    write(f"{folder}/detections.csv", "\n".join(rows) + "\n")
    write(f"{folder}/odometry.tum", "\n".join(poses) + "\n")
    write(f"{folder}/run.yaml", "role: survey\ndate: 2026-05-12\n")
    write(f"{folder}/camchain.yaml",
          "cam0:\n  camera_model: pinhole\n  intrinsics: [500, 500, 479.5, 359.5]\n  distortion_model: radtan\n"
          "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [960, 720]\n"
          "  T_cam_imu:\n  - [0, -1, 0, 0]\n  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n")


def write_site(folder):
    write_run(f"{folder}/runs/monday", 1)
    write(f"{folder}/tags.yaml", f"size_m: {SIZE}\n")
    write(f"{folder}/origin.json", '{"lat": %r, "lon": %r, "alt": %r}\n' % ORIGIN)
    write(f"{folder}/control_points.csv",
          "tag_id,role,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\n" + "\n".join(control_rows()) + "\n")

    write(f"{folder}/trigpoint.yaml", "schema: 1\nname: six tags\n")
