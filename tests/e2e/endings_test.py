#!/usr/bin/env python3
"""Every command ends with at most 12 lines (demo: 16), and loses neither errors nor warnings.

    endings_test.py PROGRAM SOURCE_DIR
"""
import json
import os
import pty
import re
import select
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
del sys.argv[1:3]
LIMIT, DEMO_LIMIT = 12, 16

# What is run for each command; others are called with the site alone.
COMMANDS = {
    "init": [["SITE"]],
    "run": [["SITE"]],
    "demo": [["SITE"]],
    "status": [["SITE"]],
    "publish": [["SITE", "--name", "first"]],
    "compare": [["SITE", "SITE/releases/first"]],
    "export": [["SITE", "--to", "csv"], ["SITE", "--to", "kml"]],
    "review": [["SITE", "list"], ["SITE", "exclude", "station:S57", "--reason", "test"],
               ["SITE", "undo", "last", "--reason", "test"], ["SITE", "solve"]],
    "inspect": [["SITE", "--run", "run2", "--image", "IMAGE"]],
    "mark": [["SITE", "P1", "--image", "run2/IMAGE", "--at", "100,100"]],
    "manual": [["NEW/manual"]],
    "calibrate": [["NEW", "--from", "SITE/runs/run2/camchain.yaml"]],
    "trajectory": [["SITE/truth/runs/run2_cameras.tum", "SITE/results/localize/run2/cameras.tum"],
                   ["SITE/truth/runs/run2_cameras.tum"] + ["SITE/results/localize/run2/cameras_odom.tum"] * 15],
    "batch": [["LIST", "--out", "NEW/batch"]],
    "verify": [["SITE/releases/first"]],
    "plan": [["SITE"]],
    "import": [["NEW/in", "--from", "SITE/panoramas", "--list"]],
    "doctor": [["SITE"]],
    # These change what the others read.
    "print": [["SITE", "--ids", "200-240", "--size", "100"], ["SITE", "--measured", "99.7", "--nominal", "100"],
              ["SITE", "--what", "board", "--target", "checkerboard:9x6:0.025"]],
}
# COLMAP takes too long.
COMMANDS_THAT_FAIL = {"crosscheck": [["SITE", "--run", "none"]]}


def trigpoint(*arguments, cwd=None):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False, cwd=cwd)


def on_a_terminal(*arguments):
    """What a person sees, with lines that were overwritten left out."""
    leader, follower = pty.openpty()
    child = subprocess.Popen([PROGRAM, *arguments], stdin=follower, stdout=follower, stderr=follower, close_fds=True)
    os.close(follower)
    data = b""
    while True:
        ready, _, _ = select.select([leader], [], [], 1)
        if ready:
            try:
                some = os.read(leader, 65536)
            except OSError:  # the other end is closed
                break
            if not some:
                break
            data += some
        elif child.poll() is not None:
            break
    os.close(leader)
    child.wait()
    lines = data.decode().replace("\r\n", "\n").split("\n")
    return [line.split("\r")[-1].replace("\x1b[K", "") for line in lines if line]


class Endings(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.dir = tempfile.mkdtemp(prefix="trigpoint-endings-")
        cls.addClassCleanup(shutil.rmtree, cls.dir)
        cls.site = os.path.join(cls.dir, "site")
        shutil.copytree(os.path.join(SOURCE, "datasets/parking_lot"), cls.site)
        for part in ("runs/run1", "photos", "board"):
            shutil.rmtree(os.path.join(cls.site, part))
        # Coarse views, so that the whole of it takes seconds.
        with open(os.path.join(cls.site, "trigpoint.yaml"), "w", encoding="utf-8") as file:
            file.write("stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n"
                       "  survey: {tie_points: false}\n")
        done = trigpoint("run", cls.site)
        assert done.returncode == 0, done.stderr
        cls.first = done.stdout
        with open(os.path.join(cls.dir, "list.txt"), "w", encoding="utf-8") as file:
            file.write(cls.site + "\n")

    def words(self, arguments):
        with open(os.path.join(self.site, "runs/run2/images.txt"), encoding="utf-8") as text:
            image = next(line.split()[1] for line in text if line.strip() and not line.startswith("#"))
        replaced = []
        for word in arguments:
            for name, value in (("SITE", self.site), ("NEW", os.path.join(self.dir, "new")), ("IMAGE", image),
                                ("LIST", os.path.join(self.dir, "list.txt"))):
                word = re.sub(rf"\b{name}\b", lambda _, v=value: v, word)
            replaced.append(word)
        return replaced

    def test_every_command_keeps_to_its_lines(self):
        listed = trigpoint("--help").stdout
        commands = re.findall(r"^  ([a-z]+) ", listed[listed.index("Subcommands"):], re.M)
        self.assertGreater(len(commands), 15)
        os.makedirs(os.path.join(self.dir, "new"), exist_ok=True)
        for command in sorted(commands, key=lambda name: list(COMMANDS).index(name) if name in COMMANDS else 99):
            for arguments in COMMANDS.get(command, COMMANDS_THAT_FAIL.get(command, [["SITE"]])):
                with self.subTest(command=command, arguments=arguments):
                    done = trigpoint(command, *self.words(arguments))
                    lines = done.stdout.splitlines()
                    self.assertLessEqual(len(lines), DEMO_LIMIT if command == "demo" else LIMIT, done.stdout)
                    if command in COMMANDS:
                        self.assertEqual(done.returncode, 0, done.stderr)
                        self.assertGreater(len(lines), 0)

    def test_run_says_what_how_good_where_and_what_next(self):
        for part in (r"^Run done in .* 1 run \(run2\), 24 images, 4 panoramas$", r"^Located   \d of 4, 4 panoramas by 1 run",
                     r"^Relative  median \d\.\d+ m, worst \d\.\d+ m   \(\d", r"^Absolute  median ", r"^Report    .*results/report/index\.html$", r"^Next      trigpoint"):
            self.assertRegex(self.first, re.compile(part, re.M))

    def test_the_report_of_a_run_is_of_its_own_results(self):
        with open(os.path.join(self.site, "results/report/index.html"), encoding="utf-8") as file:
            self.assertNotIn("out of date", file.read().partition('id="accuracy"')[0])

    def test_numbers_are_those_of_the_files(self):
        with open(os.path.join(self.site, "results/evaluate/summary.json"), encoding="utf-8") as file:
            groups = json.load(file)["groups"]
        medians = [g["error_3d"]["over_answers"]["median_m"] for g in groups
                   if g["kind"] == "absolute" and g["method"] == "single" and g["error_3d"]["over_answers"].get("median_m")]
        shown = float(re.search(r"^Absolute  median (\d\.\d+) m", self.first, re.M).group(1))
        self.assertTrue(any(abs(shown - median) <= 0.0051 for median in medians), (shown, medians))

    def test_verbose_prints_the_tables_and_quiet_nothing(self):
        verbose = trigpoint("evaluate", self.site, "--verbose").stdout
        self.assertIn("| run ", verbose)
        self.assertGreater(len(verbose.splitlines()), LIMIT)
        for arguments in (["--quiet", "run", self.site], ["run", self.site, "--quiet"]):
            done = trigpoint(*arguments)
            self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))

    def test_distances_between_tags_that_nobody_saw_end_with_one(self):
        site = os.path.join(self.dir, "distances")
        shutil.copytree(self.site, site)
        for rows, code in (("901,902,1.5\n", 1), ("901,902,1.5\n", 0)):
            with open(os.path.join(site, "distances.csv"), "w", encoding="utf-8") as file:
                file.write("from,to,distance_m\n" + rows)
            with open(os.path.join(site, "results/survey/tags.csv"), encoding="utf-8") as file:
                tags = [line.split(",")[0] for line in file if line[0].isdigit()]
            if code == 0:
                with open(os.path.join(site, "distances.csv"), "a", encoding="utf-8") as file:
                    file.write(f"{tags[0]},{tags[1]},1.5\n")
            done = trigpoint("survey", site)
            self.assertEqual(done.returncode, code, done.stdout + done.stderr)
            if code == 1:
                self.assertIn("distances.csv: expected a distance between two tags of the map, found none in 1 row", done.stdout + done.stderr)

    def test_marks_that_fit_nothing_end_with_one(self):
        site = os.path.join(self.dir, "marks")
        shutil.copytree(self.site, site)
        image = self.words(["IMAGE"])[0]
        with open(os.path.join(site, "control_points.csv"), encoding="utf-8") as file:
            rows = [line for line in file if not line.startswith("#")]
        with open(os.path.join(site, "control_points.csv"), "w", encoding="utf-8") as file:
            file.write("point," + rows[0] + "".join("," + row for row in rows[1:]))
            file.write("P1,," + ",".join(rows[-1].split(",")[1:]))
        table = os.path.join(site, "control_observations.csv")
        for rows, expected in (([("P1", "runs/x/images/9.jpg")], "found none in 1 row; the first names the image 'runs/x/images/9.jpg'"),
                               ([("P", image), ("P1", "9.jpg")], "found none in 2 rows; the first names the point 'P' (nearest: 'P1'), which is not in control_points.csv"),
                               ([("P", image), ("P1", image)], ""), ([], "")):
            with open(table, "w", encoding="utf-8") as file:
                file.write("point,image,u,v\n" + "".join(f"{point},{name},10,10\n" for point, name in rows))
            for command in ("survey", "localize"):
                done = trigpoint(command, site)
                self.assertEqual(done.returncode, 1 if expected else 0, done.stdout + done.stderr)
                self.assertIn(expected, " ".join((done.stdout + done.stderr).split()))

    def test_runs_added_by_init_are_shown(self):
        site = os.path.join(self.dir, "more runs")
        shutil.copytree(self.site, site, ignore=shutil.ignore_patterns("results", "releases"))
        before = "runs: [run2]\n"
        with open(os.path.join(site, "trigpoint.yaml"), "w", encoding="utf-8") as file:
            file.write(before)
        shutil.copytree(os.path.join(site, "runs/run2"), os.path.join(site, "runs/run3"))
        said = trigpoint("init", site).stdout
        self.assertRegex(said, re.compile(r"^Added runs to .*trigpoint\.yaml$", re.M))
        self.assertRegex(said, re.compile(r'^Added +runs: \["run2", "run3"\]$', re.M))
        kept = re.search(r"^Old file +(.*)$", said, re.M).group(1)
        with open(os.path.join(site, kept), encoding="utf-8") as file:
            self.assertEqual(file.read(), before)
        self.assertIn("was there and is kept", trigpoint("init", site).stdout)

    def test_warnings_and_errors_are_not_lost(self):
        site = os.path.join(self.dir, "broken")
        shutil.copytree(self.site, site, ignore=shutil.ignore_patterns("results", "releases"))
        with open(os.path.join(site, "panoramas.csv"), encoding="utf-8") as file:
            table = file.read().rstrip("\n").split("\n")
        rows = [f"panoramas/none_{i}.jpg" + table[-1][table[-1].index(","):] for i in range(20)]
        with open(os.path.join(site, "panoramas.csv"), "w", encoding="utf-8") as file:
            file.write("\n".join(table + rows) + "\n")
        shutil.copytree(os.path.join(site, "runs/run2"), os.path.join(site, "runs/run3"))
        with open(os.path.join(site, "runs/run3/detections.csv"), "w", encoding="utf-8") as file:
            file.write("timestamp,tag\n")
        done = trigpoint("detect", site)
        self.assertLessEqual(len(done.stdout.splitlines()), LIMIT)
        self.assertEqual(done.returncode, 1)
        self.assertIn("Error     detect/run3: failed", done.stdout)
        self.assertIn("error: detect/run3: failed", done.stderr)
        warnings = re.findall(r"^warning: (.*)$", done.stderr, re.M)
        self.assertGreaterEqual(len(warnings), 11)
        self.assertIn("Warning   " + warnings[0], done.stdout)
        self.assertRegex(done.stdout, re.compile(r"^And       \d+ more: ", re.M))
        verbose = trigpoint("detect", site, "--verbose").stdout
        for warning in warnings:
            self.assertIn("Warning   " + warning, verbose)
        # On a terminal they are in the ending, not between the progress lines.
        seen = on_a_terminal("detect", site)
        self.assertFalse([line for line in seen if line.startswith("warning: ")])
        self.assertTrue([line for line in seen if line.startswith("Warning   ")])
        self.assertLessEqual(len(seen), LIMIT + 3, "\n".join(seen))
        # A command that fails before its ending shows them too.
        seen = on_a_terminal("localize", site, "--run", "none")
        self.assertEqual(sum(line.startswith("warning: ") for line in seen), len(warnings), "\n".join(seen))


if __name__ == "__main__":
    unittest.main()
