#!/usr/bin/env python3
"""`trigpoint crosscheck` beside a COLMAP that is missing, fails, splits the run into several models, or never ends.

    crosscheck_test.py PROGRAM

The COLMAP of these tests is a script that answers with our own poses, twice as large; the site is heidelberg of the shared
data (TRIGPOINT_SHARED_DATA, or ../shared/data beside the sources), without which they are skipped.
"""
import csv
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = ""
SHARED = os.environ.get("TRIGPOINT_SHARED_DATA") or os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../shared/data")
FAKE = r'''#!/usr/bin/env python3
import os, sys, time
mode, model = os.environ.get("FAKE_MODE", ""), os.environ.get("FAKE_MODEL", "")
if sys.argv[1] == "help":
    print("COLMAP 3.8 -- Structure-from-Motion and Multi-View Stereo")
elif sys.argv[1] == "feature_extractor":
    open(sys.argv[sys.argv.index("--database_path") + 1], "a").close()
elif sys.argv[1] in ("image_registrator", "bundle_adjuster"):
    source, out = (sys.argv[sys.argv.index(f"--{side}_path") + 1] for side in ("input", "output"))
    for file in ("images.txt", "cameras.txt", "points3D.txt"):
        text = open(f"{source}/{file}").read()
        if sys.argv[1] == "image_registrator":
            text += open(f"{model}/panoramas/{file}").read()
        open(f"{out}/{file}", "w").write(text)
elif sys.argv[1] == "mapper":
    if mode == "fail":
        print("ERROR: out of luck\n*** Check failure stack trace: ***\n    @     0x564724b203a1  _start")
        sys.exit(3)
    if mode == "sleep":
        print("sleeping", flush=True)
        open(os.environ["FAKE_PID"], "w").write(str(os.getpid()))
        time.sleep(300)
    out = sys.argv[sys.argv.index("--output_path") + 1]
    lines = [line for line in open(model + "/images.txt") if not line.startswith("#")]
    images = []
    for i, (head, pixels) in enumerate(sorted(zip(lines[::2], lines[1::2]), key=lambda pair: pair[0].split()[9])):
        f = head.split()
        f[5:8] = [repr(2 * float(v)) for v in f[5:8]]
        f[9] = f"run/cam0_{i:06d}.jpg"
        images.append(" ".join(f) + "\n\n")
    for name, part in (("0", images[:2]), ("1", images[2:])) if mode == "split" else (("0", images),):
        os.makedirs(f"{out}/{name}")
        open(f"{out}/{name}/images.txt", "w").writelines(part)
        open(f"{out}/{name}/cameras.txt", "w").write(open(model + "/cameras.txt").read())
        open(f"{out}/{name}/points3D.txt", "w").write("")
'''


class Rotation:
    """A unit quaternion."""

    def __init__(self, w, x, y, z):
        self.w, self.x, self.y, self.z = w, x, y, z

    def __mul__(self, o):
        return Rotation(self.w * o.w - self.x * o.x - self.y * o.y - self.z * o.z,
                        self.w * o.x + self.x * o.w + self.y * o.z - self.z * o.y,
                        self.w * o.y - self.x * o.z + self.y * o.w + self.z * o.x,
                        self.w * o.z + self.x * o.y - self.y * o.x + self.z * o.w)

    def inverse(self):
        return Rotation(self.w, -self.x, -self.y, -self.z)

    def turned(self, v):
        r = self * Rotation(0, *v) * self.inverse()
        return [r.x, r.y, r.z]


@unittest.skipUnless(os.path.isdir(os.path.join(SHARED, "heidelberg")), "no shared data")
class Crosscheck(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.mkdtemp(prefix="trigpoint crosscheck ")
        cls.site = os.path.join(cls.temporary, "site")
        shutil.copytree(os.path.join(SHARED, "heidelberg"), cls.site, ignore=shutil.ignore_patterns("original", "back"))
        cls.run_program("init", cls.site)
        cls.run_program("localize", cls.site, "--run", "front", "--quiet")
        cls.run_program("export", cls.site, "--to", "colmap", "--run", "front", "--frame", "odom", "--out", f"{cls.temporary}/model")
        os.makedirs(f"{cls.temporary}/bin")
        with open(f"{cls.temporary}/bin/colmap", "w", encoding="utf-8") as script:
            script.write(FAKE)
        os.chmod(f"{cls.temporary}/bin/colmap", 0o755)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.temporary)

    @classmethod
    def run_program(cls, *arguments, environment=None):
        done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False, env=environment)
        assert done.returncode == 0, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done

    def environment(self, mode):
        return {**os.environ, "PATH": f"{self.temporary}/bin:/usr/bin:/bin", "FAKE_MODE": mode, "FAKE_MODEL": f"{self.temporary}/model/text",
                "FAKE_PID": f"{self.temporary}/pid"}

    def crosscheck(self, mode):
        """A new result each time: the tests' COLMAP is no input that the stage could see change."""
        shutil.rmtree(f"{self.site}/results/crosscheck", ignore_errors=True)
        done = self.run_program("crosscheck", self.site, "--run", "front", "--set", "features=false", "--set", "panoramas=false",
                                environment=self.environment(mode))
        with open(f"{self.site}/results/crosscheck/front/comparison.csv", encoding="utf-8") as text:
            return done, list(csv.DictReader(line for line in text if not line.startswith("#")))

    def test_the_same_poses_agree(self):
        _, rows = self.crosscheck("")
        row = next(r for r in rows if r["alignment"] == "sim3")
        self.assertEqual((row["status"], row["models"], row["registered"]), ("done", "1", row["images"]))
        self.assertLess(float(row["rmse_m"]), 1e-6)
        self.assertAlmostEqual(float(row["scale"]), 0.5, 5)
        self.assertLess(float(row["normalised_p95"]), 0.01)

    def test_several_models_are_said(self):
        done, rows = self.crosscheck("split")
        self.assertIn("split the run into 2 models", done.stderr)
        self.assertEqual(rows[0]["models"], "2")
        self.assertIn("the largest one, with ", rows[0]["reason"])
        self.assertEqual(int(rows[0]["registered"]), int(rows[0]["images"]) - 2)

    def write_panoramas(self, answers):
        """Two views of each panorama for COLMAP's model, at our own answers, which are right; twice as large as ours."""
        folder = f"{self.temporary}/model/text/panoramas"
        os.makedirs(folder, exist_ok=True)
        images, points = [], []
        for number, row in enumerate(answers):
            turn = Rotation(*(float(row[f"odom_{axis}"]) for axis in ("qw", "qx", "qy", "qz")))
            centre = [2 * float(row[f"odom_{axis}"]) for axis in "xyz"]
            for view, angle in enumerate((0, math.pi / 4)):
                # View k looks 45 deg * k to the right of the panorama's centre.
                q = (turn * Rotation(math.cos(angle / 2), 0, math.sin(angle / 2), 0)).inverse()
                t = [-c for c in q.turned(centre)]
                identity = 900 + 2 * number + view
                seen = [f"{10 + k} 20 {1000 * identity + k}" for k in range(40)]
                points += [f"{1000 * identity + k} 0 0 0 0 0 0 0.5 {identity} {k}\n" for k in range(40)]
                images.append(f"{identity} {q.w} {q.x} {q.y} {q.z} {t[0]} {t[1]} {t[2]} 1 view{view}/{number:04d}.jpg\n{' '.join(seen)}\n")
        for file, text in (("images.txt", "".join(images)), ("points3D.txt", "".join(points)), ("cameras.txt", "")):
            with open(f"{folder}/{file}", "w", encoding="utf-8") as out:
                out.write(text)

    def verdicts(self):
        shutil.rmtree(f"{self.site}/results/crosscheck", ignore_errors=True)
        done = self.run_program("crosscheck", self.site, "--run", "front", "--set", "features=false", "--set", "rig=false",
                                environment=self.environment(""))
        with open(f"{self.site}/results/crosscheck/front/panoramas.csv", encoding="utf-8") as text:
            return done.stderr, {r["panorama"]: r for r in csv.DictReader(line for line in text if not line.startswith("#"))}

    def test_panoramas_are_looked_for_and_agree(self):
        table = f"{self.site}/results/localize/front/panoramas.csv"
        with open(table, encoding="utf-8") as text:
            lines = text.read().splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        self.assertEqual({r["status"] for r in rows}, {"localized"})
        self.write_panoramas(rows)
        _, found = self.verdicts()
        self.assertEqual({r["verdict"] for r in found.values()}, {"agrees"})

    def test_a_planted_answer_is_found(self):
        """Each panorama in turn is moved in the table of results, by four of its sigmas and by metres: the program says that
        the table is not what was computed, and computes it again."""
        table = f"{self.site}/results/localize/front/panoramas.csv"
        with open(table, encoding="utf-8") as text:
            right = text.read()
        lines = right.splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        self.write_panoramas(rows)
        header = next(line for line in lines if not line.startswith("#"))
        try:
            for planted in rows:
                for shift in (4 * float(planted["odom_sigma_x_m"]), 3.0):
                    with open(table, "w", encoding="utf-8", newline="") as out:
                        out.write("".join(line + "\n" for line in lines if line.startswith("#")) + header + "\n")
                        writer = csv.DictWriter(out, header.split(","), lineterminator="\n")
                        for row in rows:
                            moved = {**row, "odom_x": float(row["odom_x"]) + shift} if row is planted else row
                            writer.writerow(moved)
                    said, found = self.verdicts()
                    name = planted["panorama"]
                    self.assertIn("results/localize/front/panoramas.csv is not what was written there any more", said)
                    self.assertEqual(found[name]["verdict"], "agrees")
                    with open(table, encoding="utf-8") as text:
                        self.assertEqual(text.read(), right)
        finally:
            with open(table, "w", encoding="utf-8") as out:
                out.write(right)

    def test_answers_elsewhere_than_theirs_contradict(self):
        """Their view of each panorama says that our answer is wrong: ten planted differences, each is found, none of the
        other answers is blamed."""
        with open(f"{self.site}/results/localize/front/panoramas.csv", encoding="utf-8") as text:
            rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
        planted = [(k % len(rows), axis, off_m) for k, (axis, off_m) in enumerate(
            (axis, off_m) for off_m in (1.0, -1.0, 3.0, -3.0, 10.0) for axis in "xy")]
        self.assertEqual(len(planted), 10)
        for which, axis, off_m in planted:
            moved = [dict(row) for row in rows]
            moved[which][f"odom_{axis}"] = float(rows[which][f"odom_{axis}"]) + off_m
            self.write_panoramas(moved)
            _, found = self.verdicts()
            for k, row in enumerate(rows):
                self.assertEqual(found[row["panorama"]]["verdict"], "contradicts" if k == which else "agrees",
                                 f"{row['panorama']}: {rows[which]['panorama']} moved by {off_m} m in {axis}")

    def test_a_failure_is_said_and_the_rest_goes_on(self):
        shutil.copytree(f"{self.temporary}/model/text", f"{self.site}/models/mine")
        try:
            done, rows = self.crosscheck("fail")
        finally:
            shutil.rmtree(f"{self.site}/models")
        self.assertIn("COLMAP's mapper ended with code 3: ERROR: out of luck", done.stderr)
        self.assertEqual([r["status"] for r in rows if r["system"] == "colmap b"], ["failed"])
        mine = next(r for r in rows if r["system"] == "model:mine" and r["alignment"] == "none")
        self.assertLess(float(mine["rmse_m"]), 1e-6)

    def test_without_colmap_the_rest_goes_on(self):
        done = subprocess.run([PROGRAM, "crosscheck", self.site, "--run", "front"], capture_output=True, text=True, check=False,
                              env={**os.environ, "PATH": "/nowhere"})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("COLMAP is not installed", done.stderr)
        with open(f"{self.site}/results/crosscheck/front/manifest.json", encoding="utf-8") as text:
            self.assertIn('"not installed"', text.read())

    def test_colmap_ends_with_us(self):
        for how, code in ((signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)):
            shutil.rmtree(f"{self.site}/results/crosscheck", ignore_errors=True)
            if os.path.exists(f"{self.temporary}/pid"):
                os.remove(f"{self.temporary}/pid")
            program = subprocess.Popen([PROGRAM, "crosscheck", self.site, "--run", "front", "--set", "features=false", "--quiet"],
                                       env=self.environment("sleep"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for _ in range(600):
                if os.path.exists(f"{self.temporary}/pid") and os.path.getsize(f"{self.temporary}/pid") > 0:
                    break
                time.sleep(0.1)
            with open(f"{self.temporary}/pid", encoding="utf-8") as text:
                child = int(text.read())
            program.send_signal(how)
            self.assertEqual(program.wait(20), code)
            for _ in range(100):
                if not os.path.exists(f"/proc/{child}") or self.is_zombie(child):
                    break
                time.sleep(0.1)
            else:
                self.fail(f"COLMAP lives on after {how}")

    @staticmethod
    def is_zombie(process):
        try:
            with open(f"/proc/{process}/stat", encoding="utf-8") as text:
                return text.read().rsplit(")", 1)[1].split()[0] == "Z"
        except FileNotFoundError:
            return True


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
