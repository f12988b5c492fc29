#!/usr/bin/env python3
"""The README's and the guides' commands, typed as they stand there, in a folder that has what they name.

    guides_test.py PROGRAM SOURCE_DIR

Every line of a ```sh block is run by a shell. A block without a language that follows one shows what it prints: it is
compared with numbers, times and paths left out. Lines that cannot be run here are listed with their reason.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
del sys.argv[1:3]

NOT_HERE = {
    "./setup.sh": "installs packages and builds",
    "export PATH": "the test sets it",
    "trigpoint-desktop": "needs a screen",
    "colmap gui": "needs a screen",
    "trigpoint crosscheck": "takes COLMAP and hours; tests/e2e/crosscheck_test.py",
    "trigpoint calibrate": "needs pictures of a board; tests/e2e/calibrate_test.cc",
    "--near": "needs a service's panoramas; tests/e2e/interchange_test.py",
    "slurm": "needs a cluster; tests/e2e/slurm_test.py",
}


def blocks(page):
    """(language, lines) of every fenced block."""
    with open(os.path.join(SOURCE, page), encoding="utf-8") as text:
        for match in re.finditer(r"^( *)```(\w*)\n(.*?)^\1```", text.read(), re.M | re.S):
            indent = len(match.group(1))
            yield match.group(2), [line[indent:] for line in match.group(3).split("\n")[:-1]]


def plain(text):
    """What stays the same from run to run."""
    text = re.sub(r"\d+ min \d+ s", "T", text)
    text = re.sub(r"\d+(\.\d+)? s\b", "T", text)
    return re.sub(r"-?\d+(\.\d+)?", "N", text)


class Guides(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.dir = tempfile.mkdtemp(prefix="trigpoint-guides-")
        cls.addClassCleanup(shutil.rmtree, cls.dir)
        bin_dir = os.path.join(cls.dir, "bin")
        os.makedirs(bin_dir)
        os.symlink(PROGRAM, os.path.join(bin_dir, "trigpoint"))
        cls.environment = {**os.environ, "PATH": bin_dir + ":" + os.environ["PATH"]}
        # The example site under the names that the pages use; computed by the first page that runs it.
        site = os.path.join(cls.dir, "site")
        shutil.copytree(os.path.join(SOURCE, "datasets/parking_lot"), site)
        os.rename(os.path.join(site, "runs/run2"), os.path.join(site, "runs/monday"))
        shutil.rmtree(os.path.join(site, "runs/run1"))
        shutil.rmtree(os.path.join(site, "truth"))
        cls.site = site

    def folder(self, name, results):
        folder = os.path.join(self.dir, name)
        os.makedirs(folder)
        site = os.path.join(folder, "my_site")
        shutil.copytree(self.site, site)
        if results:
            self.run_line("trigpoint run my_site --quiet", folder)
        return folder

    def run_line(self, line, folder):
        done = subprocess.run(["bash", "-c", line], cwd=folder, env=self.environment, capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 0, f"{line}\n{done.stdout}\n{done.stderr}")
        return done.stdout

    def page(self, page, folder, more=()):
        printed, ran = "", 0
        for language, lines in blocks(page):
            if language == "sh":
                text = re.sub(r"\\\n\s*", "", "\n".join(lines))
                printed = ""
                for line in text.split("\n"):
                    line = line.split(" # ")[0].strip().removeprefix("$ ")
                    if not line or any(part in line for part in (*NOT_HERE, *more)):
                        continue
                    with self.subTest(page=page, line=line):
                        printed += self.run_line(line, folder)
                        ran += 1
            elif language == "" and printed:
                with self.subTest(page=page, printed=lines[0]):
                    self.assertEqual(plain("\n".join(lines)).split("\n"), plain(printed).rstrip("\n").split("\n"))
        return ran

    def test_0_own_run(self):
        folder = self.folder("own_run", False)
        self.assertGreater(self.page("docs/guides/own_run.md", folder), 3)
        type(self).site = os.path.join(folder, "my_site")  # with its results

    def test_readme(self):
        folder = self.folder("readme", True)
        self.assertGreater(self.page("README.md", folder), 1)

    def test_surveyor(self):
        folder = self.folder("surveyor", True)
        self.assertGreater(self.page("docs/guides/surveyor.md", folder, ["trigpoint import"]), 4)

    def test_researcher(self):
        folder = self.folder("researcher", True)
        localized = os.path.join(folder, "my_site/results/localize/monday")
        for name in ("truth.tum", "mine.tum", "other.tum"):
            shutil.copy(os.path.join(localized, "cameras.tum"), os.path.join(folder, name))
        self.assertGreater(self.page("docs/guides/researcher.md", folder), 0)

    def test_gis(self):
        folder = self.folder("gis", True)
        self.assertGreater(self.page("docs/guides/gis.md", folder), 0)
        self.assertTrue(os.path.exists(os.path.join(folder, "my_site/results/export/site.gpkg")))

    def test_colmap(self):
        folder = self.folder("colmap", True)
        self.run_line("trigpoint export my_site --to colmap --run monday --out model", folder)
        os.makedirs(os.path.join(folder, "sparse"))
        shutil.copytree(os.path.join(folder, "model"), os.path.join(folder, "sparse/0"))
        shutil.copytree(os.path.join(self.site, "runs/monday/images"), os.path.join(folder, "images"))
        shutil.rmtree(os.path.join(folder, "my_site"))
        self.assertGreater(self.page("docs/guides/colmap.md", folder, ["colmap model", "--to colmap"]), 2)


if __name__ == "__main__":
    unittest.main()
