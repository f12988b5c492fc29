#!/usr/bin/env python3
"""What `trigpoint export` and `import` write, read by the programs it is for: COLMAP, GDAL, sqlite, and arithmetic.

    interchange_test.py PROGRAM

A small made-up result is written by hand, so that every number is known; scenes are those of a run that the program
localizes. Tests of a program that isn't installed are skipped.
"""
import hashlib
import json
import math
import os
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

from survey_site import ORIGIN, axes, ecef, write

PROGRAM = ""
YAW = math.radians(30)
SHIFT = np.array([5.0, -3.0, 1.2])  # world_from_odom
COUNT = 6


def trigpoint(*arguments, expect=0):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == expect, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def tool(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
    assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def rot_z(a):
    return np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])


def quaternion(r):
    w = math.sqrt(max(0, 1 + r[0, 0] + r[1, 1] + r[2, 2])) / 2
    if w > 1e-3:
        return np.array([(r[2, 1] - r[1, 2]) / (4 * w), (r[0, 2] - r[2, 0]) / (4 * w), (r[1, 0] - r[0, 1]) / (4 * w), w])
    x = math.sqrt(max(0, 1 + r[0, 0] - r[1, 1] - r[2, 2])) / 2
    return np.array([x, (r[0, 1] + r[1, 0]) / (4 * x), (r[0, 2] + r[2, 0]) / (4 * x), (r[2, 1] - r[1, 2]) / (4 * x)])


def matrix(q):
    """Of a unit quaternion w, x, y, z."""
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def body_pose(row, scale):
    """4 x 4 of a line of a TUM file."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix(row[[7, 4, 5, 6]]), scale * row[1:4]
    return pose


def enu(lat, lon, h):
    return axes() @ (ecef(lat, lon, h) - ecef(*ORIGIN))


# A camera that looks along +y of odom: columns are the camera's axes.
ODOM_FROM_CAM = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
CENTRES = [np.array([0.8 * i, 0.1 * i * i, 0.02 * i]) for i in range(COUNT)]
POINTS = [np.array([0.7 * k - 2, 8 + 0.3 * k, 0.5 * k - 2]) for k in range(12)]
FOCAL, CX, CY = 500.0, 319.5, 239.5


def pixel(i, p):
    c = ODOM_FROM_CAM.T @ (p - CENTRES[i])
    return FOCAL * c[0] / c[2] + CX, FOCAL * c[1] / c[2] + CY


def make_project(folder):
    write(f"{folder}/origin.json", json.dumps({"lat": ORIGIN[0], "lon": ORIGIN[1], "alt": ORIGIN[2]}))
    run = f"{folder}/runs/run1"
    stamps = [1000.0 + 0.5 * i for i in range(COUNT)]
    write(f"{run}/images.txt", "".join(f"{stamps[i]:.6f} images/{i:03d}.jpg\n" for i in range(COUNT)))
    for i in range(COUNT):
        write(f"{run}/images/{i:03d}.jpg", "picture")
    write(f"{run}/camchain.yaml", f"cam0:\n  camera_model: pinhole\n  intrinsics: [{FOCAL}, {FOCAL}, {CX}, {CY}]\n"
          "  distortion_model: none\n  distortion_coeffs: []\n  resolution: [640, 480]\n  T_cam_imu:\n  - [1, 0, 0, 0]\n"
          "  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n")
    q = quaternion(ODOM_FROM_CAM)
    tum = "".join(f"{stamps[i]:.6f} {' '.join(f'{v:.12f}' for v in [*CENTRES[i], *q])}\n" for i in range(COUNT))
    write(f"{run}/odometry.tum", tum)
    write(f"{run}/run.yaml", "time_zero_utc: 2026-05-12T09:43:20Z\n")
    result = f"{folder}/results/localize/run1"
    write(f"{result}/cameras_odom.tum", tum)
    turn = rot_z(YAW)
    world = [turn @ c + SHIFT for c in CENTRES]
    qw = quaternion(turn @ ODOM_FROM_CAM)
    write(f"{result}/cameras.tum", "".join(f"{stamps[i]:.6f} {' '.join(f'{v:.12f}' for v in [*world[i], *qw])}\n" for i in range(COUNT)))
    rows = ["timestamp,image,camera,x,y,z,qx,qy,qz,qw,latitude_deg,longitude_deg,height_m,sigma_e_m,sigma_n_m,sigma_u_m,heading_deg,"
            "pitch_deg,roll_deg,sigma_heading_deg,sigma_pitch_deg,sigma_roll_deg"]
    for i in range(COUNT):
        rows.append(f"{stamps[i]:.6f},images/{i:03d}.jpg,cam0,{','.join(f'{v:.9f}' for v in [*world[i], *qw])},48,7.8,240,0.1,0.2,0.3,330,0,0,0.1,0.1,0.1")
    write(f"{result}/cameras.csv", "\n".join(rows) + "\n")
    pano = np.array([2.0, 3.0, 1.0])
    pano_odom = turn.T @ (pano - SHIFT)
    write(f"{result}/panoramas.csv",
          "panorama,station,status,reason,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,view_matches,inliers,views,odom_x,odom_y,odom_z,"
          "odom_qx,odom_qy,odom_qz,odom_qw,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,geotag_de_m,geotag_dn_m,"
          "geotag_du_m,geotag_status,odom_sigma_x_m,odom_sigma_y_m,odom_sigma_z_m\n"
          f"panoramas/a & <b>.jpg,S1,localized,,{','.join(f'{v:.9f}' for v in [*pano, *qw])},0.03,0.04,0.05,100,80,5,"
          f"{','.join(f'{v:.9f}' for v in [*pano_odom, *q])},48,7.8,240,330,0,0,0.3,-0.4,0.1,ok,0.01,0.02,0.03\n"
          "panoramas/lost.jpg,S2,unmatched,no image looks like it,,,,,,,,,,,0,0,0,,,,,,,,,,,,,,,,,,,,\n")
    write(f"{result}/manifest.json", json.dumps({"schema": 1, "metrics": {"feature_sigma_px": 0.5}, "options": {}}))
    # The sparse model (COLMAP's text, pixels + 0.5) and its features.
    write(f"{result}/sparse/cameras.txt", f"1 PINHOLE 640 480 {FOCAL} {FOCAL} {CX + 0.5} {CY + 0.5}\n")
    qc = quaternion(ODOM_FROM_CAM.T)
    text = ""
    for i in range(COUNT):
        t = -ODOM_FROM_CAM.T @ CENTRES[i]
        text += f"{i + 1} {qc[3]:.15f} {qc[0]:.15f} {qc[1]:.15f} {qc[2]:.15f} {' '.join(f'{v:.15f}' for v in t)} 1 images/{i:03d}.jpg\n"
        text += " ".join(f"{pixel(i, p)[0] + 0.5:.9f} {pixel(i, p)[1] + 0.5:.9f} {k + 1}" for k, p in enumerate(POINTS)) + "\n"
    write(f"{result}/sparse/images.txt", text)
    write(f"{result}/sparse/points3D.txt", "".join(
        f"{k + 1} {' '.join(f'{v:.15f}' for v in p)} 10 20 30 0.25 {' '.join(f'{i + 1} {k}' for i in range(COUNT))}\n" for k, p in enumerate(POINTS)))
    os.makedirs(f"{folder}/results/features/run1")
    db = sqlite3.connect(f"{folder}/results/features/run1/features.db")
    db.executescript("CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB, prior_focal_length INTEGER);"
                     "CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);"
                     "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                     "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);")
    db.execute("INSERT INTO cameras VALUES (1, 1, 640, 480, ?, 1)", (struct.pack("4d", FOCAL, FOCAL, CX + 0.5, CY + 0.5),))
    for i in range(COUNT):
        db.execute("INSERT INTO images VALUES (?, ?, 1)", (i + 1, f"images/{i:03d}.jpg"))
        # Features of points stand in reverse, after one of nothing.
        keys = [(5.0, 5.0)] + [pixel(i, p) for p in reversed(POINTS)]
        db.execute("INSERT INTO keypoints VALUES (?, ?, 4, ?)", (i + 1, len(keys), b"".join(struct.pack("4f", u + 0.5, v + 0.5, 2, 0) for u, v in keys)))
        db.execute("INSERT INTO descriptors VALUES (?, ?, 128, ?)", (i + 1, len(keys), bytes(128 * len(keys))))
    db.commit()
    return world, pano


class Interchange(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.mkdtemp(prefix="trigpoint interchange ")
        cls.site = os.path.join(cls.temporary, "site")
        cls.world, cls.pano = make_project(cls.site)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.temporary)

    def out(self, name):
        return os.path.join(self.temporary, name)

    def export(self, fmt, name, *more):
        trigpoint("export", self.site, "--to", fmt, "--out", self.out(name), *more)
        return self.out(name)

    def test_geojson_is_rfc_7946_and_right(self):
        with open(self.export("geojson", "site.geojson"), encoding="utf-8") as text:
            document = json.load(text)
        self.assertEqual(document["type"], "FeatureCollection")
        self.assertNotIn("crs", document)
        layers = {}
        for feature in document["features"]:
            layers.setdefault(feature["properties"]["layer"], []).append(feature)
        self.assertEqual(len(layers["cameras"]), COUNT)
        self.assertEqual(len(layers["panoramas"]), 2)
        self.assertIsNone(layers["panoramas"][1]["geometry"])
        for i, feature in enumerate(layers["cameras"]):
            lon, lat, h = feature["geometry"]["coordinates"]
            self.assertLess(np.linalg.norm(enu(lat, lon, h) - self.world[i]), 2e-4)
            self.assertEqual(feature["properties"]["sigma_n_m"], 0.2)
        lon, lat, h = layers["panoramas"][0]["geometry"]["coordinates"]
        self.assertLess(np.linalg.norm(enu(lat, lon, h) - self.pano), 2e-4)
        residual = layers["residuals"][0]["geometry"]["coordinates"]
        difference = enu(residual[1][1], residual[1][0], residual[1][2]) - enu(residual[0][1], residual[0][0], residual[0][2])
        self.assertLess(np.linalg.norm(difference - [0.3, -0.4, 0.1]), 4e-4)
        # The panorama's ellipse: 95 % of 0.03 and 0.04 m, counter-clockwise, closed.
        ellipse = [f for f in layers["ellipses"] if f["properties"]["layer"] == "ellipses" and "a & <b>" in f["properties"]["name"]][0]
        self.assertAlmostEqual(ellipse["properties"]["semi_major_m"], 0.04 * math.sqrt(5.991465), 4)
        ring = [enu(p[1], p[0], p[2]) for p in ellipse["geometry"]["coordinates"][0]]
        self.assertEqual(ellipse["geometry"]["coordinates"][0][0], ellipse["geometry"]["coordinates"][0][-1])
        area = 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, ring[1:]))
        self.assertAlmostEqual(area / (math.pi * 5.991465 * 0.03 * 0.04), 1, 1)
        refused = trigpoint("export", self.site, "--to", "geojson", "--crs", "EPSG:32632", expect=2)
        self.assertIn("RFC 7946", refused.stderr)

    def test_a_file_without_an_ending_gets_one(self):
        for fmt in ["gpkg", "geojson", "kml", "gpx"]:
            said = trigpoint("export", self.site, "--to", fmt, "--out", self.out("plain"))
            self.assertTrue(os.path.isfile(self.out("plain." + fmt)), fmt)
            self.assertIn("plain." + fmt, said.stdout)
        self.assertFalse(os.path.exists(self.out("plain")))
        trigpoint("export", self.site, "--to", "gpkg", "--out", self.out("map.v2"))
        self.assertTrue(os.path.isfile(self.out("map.v2.gpkg")))
        refused = trigpoint("export", self.site, "--to", "gpkg", "--out", self.out("map.KML"), expect=2)
        self.assertIn("expected a file that ends in .gpkg, found .kml", refused.stderr)

    @unittest.skipUnless(shutil.which("ogrinfo"), "gdal-bin is not installed")
    def test_gdal_reads_the_maps(self):
        for fmt, more in (("gpkg", []), ("gpkg", ["--crs", "EPSG:32632"]), ("gpkg", ["--crs", "EPSG:25832"]), ("geojson", []), ("kml", []), ("gpx", [])):
            file = self.export(fmt, "by_gdal." + fmt, *more)
            summary = tool("ogrinfo", "-ro", "-so", "-al", file)
            self.assertNotIn("ERROR", summary)
            if fmt == "gpkg":
                for layer, count in (("cameras", COUNT), ("panoramas", 2), ("trajectories", 1), ("ellipses", COUNT + 1), ("residuals", 1)):
                    block = summary.split(f"Layer name: {layer}\n")[1].split("Layer name:")[0]
                    self.assertIn(f"Feature Count: {count}\n", block)
                    self.assertIn(f'ID["EPSG",{more[1][5:] if more else 4326}]', block)
                    self.assertIn("3D", block)
            os.remove(file)

    @unittest.skipUnless(shutil.which("ogr2ogr") and shutil.which("cs2cs"), "gdal-bin, proj-bin are not installed")
    def test_projected_coordinates_are_those_of_proj(self):
        for code in (32632, 25832, 3857, 2056):
            file = self.export("csv", f"tables{code}", "--crs", f"EPSG:{code}", "--what", "cameras")
            with open(os.path.join(file, "cameras.csv"), encoding="utf-8") as text:
                rows = [line.split(",") for line in text.read().splitlines() if not line.startswith("#")]
            with open(self.export("geojson", "c.geojson", "--what", "cameras"), encoding="utf-8") as text:
                points = [f["geometry"]["coordinates"] for f in json.load(text)["features"]]
            asked = "\n".join(f"{lat} {lon}" for lon, lat, _ in points)
            got = subprocess.run(["cs2cs", "-f", "%.5f", "EPSG:4326", f"EPSG:{code}"], input=asked, capture_output=True, text=True, check=True).stdout
            for row, line in zip(rows[1:], got.splitlines()):
                self.assertAlmostEqual(float(row[1]), float(line.split()[0]), 2)
                self.assertAlmostEqual(float(row[2]), float(line.split()[1]), 2)

    def test_geopackage_is_what_the_standard_asks_for(self):
        db = sqlite3.connect(self.export("gpkg", "std.gpkg"))
        self.assertEqual(db.execute("PRAGMA application_id").fetchone()[0], 0x47504B47)
        self.assertEqual(db.execute("PRAGMA integrity_check").fetchone()[0], "ok")
        self.assertEqual(db.execute("PRAGMA foreign_key_check").fetchall(), [])
        self.assertEqual({r[0] for r in db.execute("SELECT srs_id FROM gpkg_spatial_ref_sys")}, {-1, 0, 4326})
        tables = {r[0] for r in db.execute("SELECT table_name FROM gpkg_contents WHERE data_type = 'features'")}
        self.assertEqual(tables, {r[0] for r in db.execute("SELECT f_table_name FROM layer_styles WHERE useAsDefault = 1")})
        blob, sigma = db.execute("SELECT geom, sigma_e_m FROM cameras ORDER BY fid").fetchone()
        self.assertEqual(blob[:4], b"GP\0\x03")
        x, y, z = struct.unpack("<3d", blob[-24:])
        self.assertLess(np.linalg.norm(enu(y, x, z) - self.world[0]), 1e-6)
        self.assertEqual(sigma, 0.1)

    def test_trajectories(self):
        tum = np.loadtxt(os.path.join(self.export("tum", "tum"), "cameras.tum"))
        self.assertLess(np.abs(tum[:, 1:4] - self.world).max(), 1e-8)
        kitti = np.loadtxt(os.path.join(self.export("kitti", "kitti", "--frame", "odom"), "cameras_odom.txt")).reshape(-1, 3, 4)
        self.assertLess(np.abs(kitti[:, :, 3] - CENTRES).max(), 1e-8)
        self.assertLess(np.abs(kitti[0, :, :3] - ODOM_FROM_CAM).max(), 1e-8)

    @unittest.skipUnless(shutil.which("exiftool"), "libimage-exiftool-perl is not installed")
    def test_exiftool_reads_the_poses_of_panoramas(self):
        picture = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../datasets/parking_lot/panoramas")
        site = self.out("gpano site")
        shutil.copytree(self.site, site)
        os.makedirs(f"{site}/panoramas")
        first = sorted(name for name in os.listdir(picture) if name.endswith(".jpg"))[0]
        shutil.copy(os.path.join(picture, first), f"{site}/panoramas/a & <b>.jpg")
        write(f"{site}/panoramas.csv", "file,station\n\"panoramas/a & <b>.jpg\",S1\n")
        trigpoint("export", site, "--to", "gpano", "--out", self.out("gpano"))
        tags = json.loads(tool("exiftool", "-json", "-n", "-PoseHeadingDegrees", "-GPSLatitude", "-GPSLongitude", "-GPS:GPSAltitude", "-GPS:GPSAltitudeRef", "-GPSHPositioningError",
                               "-ExifVersion", "-GPSVersionID", "-ProjectionType", os.path.join(self.out("gpano"), "a & <b>.jpg")))[0]
        self.assertAlmostEqual(tags["PoseHeadingDegrees"], 330, 3)
        # Above the ellipsoid, which 0 means from EXIF 3.0 on.
        place = enu(tags["GPSLatitude"], tags["GPSLongitude"], tags["GPSAltitude"])
        self.assertLess(np.linalg.norm(place - self.pano), 2e-3)
        self.assertEqual((tags["GPSAltitudeRef"], tags["ExifVersion"], tags["GPSVersionID"]), (0, "0300", "2 4 0 0"))
        self.assertAlmostEqual(tags["GPSHPositioningError"], 0.05, 3)
        self.assertEqual(tags["ProjectionType"], "equirectangular")

    def test_control_points_of_opensfm(self):
        site = self.out("gcp site")
        write(f"{self.temporary}/gcp_list.txt", "WGS84\n7.83 48.01 240.5 100.5 200.5 a.jpg p1\n7.83 48.01 240.5 11 12 b.jpg p1\n7.84 48.02 nan 1 2 a.jpg p2\n")
        trigpoint("import", site, "--from", f"{self.temporary}/gcp_list.txt")
        with open(f"{site}/control_points.csv", encoding="utf-8") as text:
            self.assertIn("p1,control,48.0100000000,7.8300000000,240.5000", text.read())
        with open(f"{site}/control_observations.csv", encoding="utf-8") as text:
            self.assertIn("p1,a.jpg,100.500,200.500", text.read())
        write(f"{self.temporary}/bad.txt", "MARS\n1 2 3 4 5 a.jpg\n")
        self.assertIn("Mars", trigpoint("import", self.out("x"), "--from", f"{self.temporary}/bad.txt", expect=1).stderr)

    def test_no_export_writes_onto_a_file_of_the_user(self):
        site = self.out("kept site")
        shutil.copytree(self.site, site)
        write(f"{site}/panoramas.csv", "file,station\n")
        write(f"{site}/control_points.csv", "tag_id,x_m,y_m,z_m\n1,0,0,0\n")
        write(f"{site}/maps/notes.kml", "mine")

        def files():
            found = {}
            for folder, _, names in os.walk(site):
                for name in names:
                    with open(os.path.join(folder, name), "rb") as data:
                        found[os.path.join(folder, name)] = data.read()
            return found

        before = files()
        for fmt, place, part in (("csv", ".", "reads its input there"), ("kalibr", "runs/run1", "reads its input there"), ("kml", "control_points.csv", "reads its input there"),
                                 ("csv", "maps/..", "reads its input there"), ("colmap", "results/localize/run1/sparse", "belongs to the stages"),
                                 ("geojson", "origin.json", "reads its input there"), ("kml", "maps/notes.kml", "was not written by trigpoint"),
                                 ("tum", "runs/run1", "reads its input there"), ("gpx", "results/site.gpx", "belongs to the stages")):
            for force in ([], ["--force"]):
                refused = trigpoint("export", site, "--to", fmt, "--out", os.path.join(site, place), *force, expect=1)
                self.assertIn(part, refused.stderr)
                if place.startswith("runs"):
                    self.assertIn(f"{place}: project", refused.stderr)
                    self.assertIn("results/export/run1\n", refused.stderr)
        refused = trigpoint("trajectory", f"{site}/runs/run1/odometry.tum", f"{site}/runs/run1/odometry.tum", "--out", f"{site}/runs/run1/run.yaml", expect=1)
        self.assertIn("reads its input there", refused.stderr)
        refused = trigpoint("trajectory", f"{site}/runs/run1/odometry.tum", f"{site}/runs/run1/odometry.tum", "--out", f"{site}/maps/notes.kml", "--force", expect=1)
        self.assertIn("was not written by trigpoint", refused.stderr)
        write(self.out("list.txt"), f'"{site}"\n')
        trigpoint("batch", self.out("list.txt"), "--out", f"{site}/maps", expect=1)
        self.assertEqual(files(), before)
        # Its own output is replaced; one that was edited needs --force.
        for _ in range(2):
            trigpoint("export", site, "--to", "kml", "--out", f"{site}/maps/site.kml")
        write(f"{site}/maps/site.kml", "edited")
        self.assertIn("--force", trigpoint("export", site, "--to", "kml", "--out", f"{site}/maps/site.kml", expect=1).stderr)
        trigpoint("export", site, "--to", "kml", "--out", f"{site}/maps/site.kml", "--force")

    def test_results_that_are_not_as_written_are_not_exported(self):
        site = self.out("changed site")
        shutil.copytree(self.site, site)
        stage, file, result = "localize", "cameras.tum", f"{site}/results/localize/run1"
        for fmt in ("csv", "geojson", "tum"):
            with open(f"{result}/{file}", "rb") as data:
                written = data.read()
            write(f"{result}/manifest.json", json.dumps({"schema": 1, "stage": stage, "status": "done", "files": {file: hashlib.sha256(written).hexdigest()}}))
            trigpoint("export", site, "--to", fmt, "--out", f"{site}/maps/good_{fmt}")
            with open(f"{result}/{file}", "wb") as data:
                data.write(written.replace(b"1", b"5", 1))
            refused = trigpoint("export", site, "--to", fmt, "--out", f"{site}/maps/bad_{fmt}", expect=1)
            self.assertIn(f"{result}/{file}: expected what the stage wrote, found another content", refused.stderr)
            self.assertIn(f"trigpoint localize '{site}' --run run1", refused.stderr)
            self.assertFalse([left for left in os.listdir(f"{site}/maps") if left.startswith("bad")])
            with open(f"{result}/{file}", "wb") as data:
                data.write(written)

    def test_marks_leave_the_other_lines_as_they_are(self):
        site = self.out("marked site")
        shutil.copytree(self.site, site)
        table = f"{site}/control_observations.csv"
        (u0, v0), (u1, v1) = pixel(0, POINTS[0]), pixel(1, POINTS[0])
        comment, header = "# measured by hand\n", "image,point,u,v,note\n"
        first = f'runs/run1/images/000.jpg,P1,{u0:.3f},{v0:.3f},"corner, left"\n'
        write(table, comment + header + first)

        def text():
            with open(table, encoding="utf-8") as rows:
                return rows.read()

        def mark(u):
            said = trigpoint("mark", site, "P1", "--image", "run1/images/001.jpg", "--at", f"{u:.3f},{v1:.3f}").stdout
            line = f"runs/run1/images/001.jpg,P1,{u:.3f},{v1:.3f},"
            self.assertRegex(said, "Added +" + re.escape(line))
            self.assertRegex(said, "Old file .*results/replaced/.*control_observations.csv")
            return line + "\n"

        self.assertEqual(text(), comment + header + first)
        second = mark(u1)
        self.assertEqual(text(), comment + header + first + second)
        kept = os.listdir(f"{site}/results/replaced")
        self.assertEqual(len(kept), 1)
        with open(f"{site}/results/replaced/{kept[0]}", encoding="utf-8") as old:
            self.assertEqual(old.read(), comment + header + first)
        second = mark(u1 + 0.5)
        self.assertEqual(text(), comment + header + first + second)
        trigpoint("mark", site, "P1", "--image", "run1/images/000.jpg", "--remove")
        self.assertEqual(text(), comment + header + second)
        kept = os.listdir(f"{site}/results/replaced")
        self.assertTrue(kept and all(name.endswith("control_observations.csv") for name in kept))

    def test_what_cannot_be_is_said_in_one_line(self):
        for arguments, code, part in ((["--to", "shapefile"], 2, "nearest"), (["--to", "gpkg", "--crs", "EPSG:999999"], 2, "EPSG"),
                                      (["--to", "gpkg", "--crs", "utm32"], 2, "EPSG:N"), (["--to", "gpkg", "--crs", "EPSG:4979"], 2, "two axes"),
                                      (["--to", "gpkg", "--crs", "EPSG:5472"], 2, "no change of datum"),
                                      (["--to", "gpkg", "--heights", "egm2009"], 2, "egm2008"), (["--to", "tum", "--run", "run7"], 1, "run1"),
                                      (["--to", "gpkg", "--what", "tgs"], 2, "tags"), (["--to", "colmap", "--crs", "EPSG:4326"], 2, "--frame"),
                                      (["--to", "tum", "--variant", "none"], 1, "localize")):
            done = trigpoint("export", self.site, *arguments, expect=code)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertIn(part, done.stderr)

    def test_geoid_heights_or_how_to_get_them(self):
        environment = {**os.environ, "GEOGRAPHICLIB_GEOID_PATH": self.out("no geoids")}
        done = subprocess.run([PROGRAM, "export", self.site, "--to", "kml", "--heights", "egm84"], capture_output=True, text=True, check=False, env=environment)
        self.assertEqual(done.returncode, 2)
        self.assertIn("geographiclib-get-geoids egm84-15", done.stderr)


class Scenes(unittest.TestCase):
    """Models, graphs and clouds of a run that the program itself localized, against each other and its input."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.mkdtemp(prefix="trigpoint scenes ")
        cls.addClassCleanup(shutil.rmtree, cls.temporary)
        cls.site = os.path.join(cls.temporary, "site")
        lot = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../datasets/parking_lot")
        shutil.copytree(lot, cls.site, ignore=shutil.ignore_patterns("run1", "photos", "truth", "board"))
        # Coarse views and few images, so that it takes seconds.
        images = f"{cls.site}/runs/run2/images.txt"
        with open(images, encoding="utf-8") as text:
            lines = text.readlines()
        write(images, "".join(lines[:13]))
        write(f"{cls.site}/trigpoint.yaml", "stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n")
        trigpoint("localize", cls.site, "--run", "run2")
        cls.model = cls.export("colmap", "model", "--frame", "odom")
        cls.read_model(os.path.join(cls.model, "text"))
        with open(f"{cls.site}/results/localize/run2/manifest.json", encoding="utf-8") as text:
            metrics = json.load(text)["metrics"]
        cls.sigma_px, cls.scale = metrics["feature_sigma_px"], metrics["odometry_scale"]

    @classmethod
    def export(cls, fmt, name, *more):
        out = os.path.join(cls.temporary, name)
        trigpoint("export", cls.site, "--to", fmt, "--out", out, *more)
        return out

    @classmethod
    def read_model(cls, folder):
        """COLMAP's text, pixels - 0.5: images {id: (name, cam_from_odom, centre, pixels, points)}, points {id: (place, track)}."""
        def rows(file):
            with open(os.path.join(folder, file), encoding="utf-8") as text:
                return [line.split() for line in text.read().splitlines() if not line.startswith("#")]
        camera = rows("cameras.txt")[0]
        assert camera[1] == "OPENCV" and [float(v) for v in camera[8:]] == [0] * 4, camera  # no distortion
        cls.focal, cls.centre = float(camera[4]), np.array(camera[6:8], float) - 0.5
        cls.images, cls.points = {}, {}
        lines = rows("images.txt")
        for head, seen in zip(lines[::2], lines[1::2]):
            turn, t = matrix(np.array(head[1:5], float)), np.array(head[5:8], float)
            table = np.array(seen, float).reshape(-1, 3)
            cls.images[int(head[0])] = (head[9], turn, -turn.T @ t, table[:, :2] - 0.5, table[:, 2].astype(int))
        for f in rows("points3D.txt"):
            cls.points[int(f[0])] = (np.array(f[1:4], float), np.array(f[8:], int).reshape(-1, 2))
        cls.observations = sum(len(track) for _, track in cls.points.values())

    def test_the_model_is_what_was_seen(self):
        self.assertEqual(len(self.images), 12)
        self.assertGreater(len(self.points), 500)
        errors = []
        for k, (place, track) in self.points.items():
            for i, index in track:
                _, turn, centre, pixels, points = self.images[i]
                self.assertEqual(points[index], k)
                p = turn @ (place - centre)
                errors.append(self.focal * p[:2] / p[2] + self.centre - pixels[index])
        self.assertLess(np.sqrt(np.mean(np.square(errors))), 2 * self.sigma_px)

    def test_ply_has_points_and_covariances(self):
        with open(os.path.join(self.export("ply", "ply", "--frame", "odom"), "points.ply"), "rb") as file:
            head, body = file.read().split(b"end_header\n", 1)
        names = re.findall(r"property (\w+) (\w+)", head.decode())
        record = np.dtype([(name, {"double": "<f8", "float": "<f4", "int": "<i4", "uchar": "u1"}[kind]) for kind, name in names])
        cloud = np.frombuffer(body, record)
        self.assertEqual(len(cloud), len(self.points))
        # Covariances by hand, given the cameras.
        for row, (place, track) in list(zip(cloud, self.points.values()))[::50]:
            information = np.zeros((3, 3))
            for i, _ in track:
                _, turn, centre, _, _ = self.images[i]
                p = turn @ (place - centre)
                j = self.focal / p[2] * np.array([[1, 0, -p[0] / p[2]], [0, 1, -p[1] / p[2]]]) @ turn
                information += j.T @ j / self.sigma_px**2
            expected = np.linalg.inv(information)
            self.assertLess(np.abs([row["x"], row["y"], row["z"]] - place).max(), 1e-9)
            self.assertEqual(row["track_length"], len(track))
            self.assertAlmostEqual(row["cov_yy"] / expected[1, 1], 1, 4)
            self.assertAlmostEqual(row["sigma_max"] / math.sqrt(np.linalg.eigvalsh(expected)[-1]), 1, 4)

    def test_g2o(self):
        folder = self.export("g2o", "g2o", "--frame", "odom")
        with open(os.path.join(folder, "pose_graph.g2o"), encoding="utf-8") as text:
            lines = [line.split() for line in text if not line.startswith("#")]
        poses = {int(f[1]): np.array(f[2:], float) for f in lines if f[0] == "VERTEX_SE3:QUAT"}
        edges = [f for f in lines if f[0] == "EDGE_SE3:QUAT"]
        self.assertEqual((sorted(poses), len(edges)), (sorted(self.images), len(self.images) - 1))
        for i, (_, _, centre, _, _) in self.images.items():
            self.assertLess(np.abs(poses[i][:3] - centre).max(), 1e-8)
        # Between two images stands what the odometry measured, as the first one's camera sees it.
        tum = np.loadtxt(f"{self.site}/runs/run2/odometry.tum")[:len(self.images)]
        with open(f"{self.site}/runs/run2/camchain.yaml", encoding="utf-8") as text:
            cam_from_body = np.array(re.findall(r"- \[(.*)\]", text.read())[-4:])
        cam_from_body = np.array([row.split(",") for row in cam_from_body], float)
        for f in edges:
            self.assertEqual(len(f), 3 + 7 + 21)
            a, b = [body_pose(tum[int(i) - 1], self.scale) for i in f[1:3]]
            expected = cam_from_body @ np.linalg.inv(a) @ b @ np.linalg.inv(cam_from_body)
            self.assertLess(np.abs(np.array(f[3:6], float) - expected[:3, 3]).max(), 1e-5)
            self.assertLess(np.abs(matrix(np.array([f[9], *f[6:9]], float)) - expected[:3, :3]).max(), 1e-6)
        with open(os.path.join(folder, "bundle.g2o"), encoding="utf-8") as text:
            lines = [line.split() for line in text if not line.startswith("#")]
        points = [np.array(f[2:], float) for f in lines if f[0] == "VERTEX_XYZ"]
        self.assertLess(np.abs(np.array(points) - [place for place, _ in self.points.values()]).max(), 1e-8)
        focal, cx, cy = [float(v) for v in next(f for f in lines if f[0] == "PARAMS_CAMERAPARAMETERS")[2:5]]
        self.assertLess(np.abs([focal - self.focal, cx - self.centre[0], cy - self.centre[1]]).max(), 1e-6)
        observations = [f for f in lines if f[0] == "EDGE_PROJECT_XYZ2UV:EXPMAP"]
        seen = [(i, self.images[i][3][index]) for _, track in self.points.values() for i, index in track]
        self.assertEqual(len(observations), len(seen))
        for f, (i, at) in zip(observations, seen):
            self.assertEqual(int(f[2]), i)
            self.assertLess(np.abs(np.array(f[4:6], float) - at).max(), 1e-4)
            self.assertAlmostEqual(float(f[6]) * self.sigma_px**2, 1, 3)

    def test_database_has_the_features_and_the_tracks_as_matches(self):
        db = sqlite3.connect(os.path.join(self.model, "database.db"))
        keys = {i: np.frombuffer(data, np.float32).reshape(rows, -1)[:, :2] - 0.5
                for i, rows, data in db.execute("SELECT image_id, rows, data FROM keypoints")}
        self.assertEqual(sorted(keys), sorted(self.images))
        pairs = {}  # the same points in two images
        for place, track in self.points.values():
            for a, index_a in track:
                for b, index_b in track:
                    if a < b:
                        pairs.setdefault(2147483647 * a + b, []).append((self.images[a][3][index_a], self.images[b][3][index_b]))
        found = db.execute("SELECT pair_id, data FROM matches WHERE rows > 0 ORDER BY pair_id").fetchall()
        self.assertEqual([row[0] for row in found], sorted(pairs))
        for pair, data in found:
            a, b = divmod(pair, 2147483647)
            matched = np.frombuffer(data, np.uint32).reshape(-1, 2)
            places = np.hstack([keys[a][matched[:, 0]], keys[b][matched[:, 1]]])
            expected = np.array([np.hstack(p) for p in pairs[pair]])
            self.assertEqual(places.shape, expected.shape)
            # Rows in any order; sorting would exchange those that differ by rounding. Each is there as often.
            count = [(np.abs(places[:, None] - rows[None]).max(axis=2) < 1e-3).sum(axis=1) for rows in (expected, places)]
            self.assertTrue((count[0] == count[1]).all())
        self.assertEqual(db.execute("SELECT count(*) FROM two_view_geometries").fetchone()[0], len(pairs))

    def test_a_result_of_an_earlier_version_is_named_with_what_to_run(self):
        site = os.path.join(self.temporary, "earlier site")
        shutil.copytree(self.site, site)
        result = f"{site}/results/localize/run2"

        def state():
            status = json.loads(trigpoint("status", site, "--json").stdout)
            return next(s["state"] for s in status["stages"] if (s["stage"], s["name"]) == ("localize", "run2"))

        self.assertEqual(state(), "done")
        # As version 13 of the stage left it: its identity counts the version.
        with open(f"{result}/manifest.json", encoding="utf-8") as text:
            manifest = json.load(text)
        del manifest["files"]["solution.db"], manifest["sha256"]
        manifest["schema"], manifest["version"], manifest["identity"] = 1, 13, "0" * 64
        write(f"{result}/manifest.json", json.dumps(manifest))
        os.remove(f"{result}/solution.db")
        missing = "run run2: results/localize/run2 was made by an earlier version and has no solution.db"
        command = f"trigpoint localize '{site}' --run run2"
        for fmt in ("colmap", "ply", "g2o"):
            refused = trigpoint("export", site, "--to", fmt, "--out", os.path.join(self.temporary, "none"), expect=1)
            self.assertIn(f"{missing}; run `{command}`", refused.stderr)
            self.assertEqual(refused.stderr.count("\n"), 1, refused.stderr)
        image = next(iter(self.images.values()))[0]
        shown = trigpoint("inspect", site, "--run", "run2", "--image", image)
        self.assertEqual(shown.stdout.count(missing), 1, shown)
        self.assertIn("Points", shown.stdout)  # of its tables
        self.assertEqual(state(), "out of date")
        # Where nothing was localized yet that is said instead.
        shutil.rmtree(result)
        refused = trigpoint("export", site, "--to", "ply", "--out", os.path.join(self.temporary, "none"), expect=1)
        self.assertIn("not localized yet", refused.stderr)
        self.assertEqual(state(), "missing")

    @unittest.skipUnless(shutil.which("colmap"), "colmap is not installed")
    def test_colmap_reads_model_and_database(self):
        for path in (self.model, os.path.join(self.model, "text")):
            log = tool("colmap", "model_analyzer", "--path", path)
            self.assertRegex(log, rf"Images: {len(self.images)}\b")
            self.assertRegex(log, rf"Points: {len(self.points)}\b")
            self.assertRegex(log, rf"Observations: {self.observations}\b")
        # Both formats hold the same numbers: COLMAP's own comparison finds no difference.
        compared, other, merged = [os.path.join(self.temporary, name) for name in ("compared", "other", "merged.db")]
        os.makedirs(compared)
        tool("colmap", "model_comparer", "--input_path1", self.model, "--input_path2", os.path.join(self.model, "text"), "--output_path", compared)
        with open(os.path.join(compared, "errors.csv"), encoding="utf-8") as text:
            errors = np.array([line.split(",") for line in text.read().splitlines() if line and not line.startswith("#")], float)
        self.assertLess(np.abs(errors).max(), 1e-5)
        os.makedirs(other)
        shutil.copy(os.path.join(self.model, "database.db"), other)
        with sqlite3.connect(os.path.join(other, "database.db")) as db:
            matches = db.execute("SELECT sum(rows) FROM matches").fetchone()[0]
            db.execute("UPDATE images SET name = 'other/' || name")
        db.close()
        tool("colmap", "database_merger", "--database_path1", os.path.join(self.model, "database.db"), "--database_path2",
             os.path.join(other, "database.db"), "--merged_database_path", merged)
        db = sqlite3.connect(merged)
        self.assertEqual(db.execute("SELECT count(*) FROM images").fetchone()[0], 2 * len(self.images))
        self.assertEqual(db.execute("SELECT sum(rows) FROM matches").fetchone()[0], 2 * matches)

    def test_a_model_becomes_a_run_with_its_poses(self):
        site = os.path.join(self.temporary, "imported")
        trigpoint("import", site, "--from", self.model, "--images", f"{self.site}/runs/run2", "--name", "again", "--scale", "2")
        poses = np.loadtxt(os.path.join(site, "runs/again/odometry.tum"))
        self.assertLess(np.abs(poses[:, 1:4] - [2 * centre for _, _, centre, _, _ in self.images.values()]).max(), 1e-8)
        trigpoint("init", site)
        refused = trigpoint("import", site, "--from", self.model, "--images", f"{self.site}/runs/run2", "--name", "again", expect=1)
        self.assertIn("is there already", refused.stderr)
        refused = trigpoint("import", site, "--from", self.model, "--images", self.temporary, "--name", "third", expect=1)
        self.assertIn(f"{len(self.images)} of {len(self.images)} images", refused.stderr)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
