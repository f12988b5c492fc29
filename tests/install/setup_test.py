#!/usr/bin/env python3
"""setup.sh says its steps, keeps what they print in its log, and shows the log's end when one fails.

    setup_test.py SETUP_SH

Runs it in a folder of its own where apt-get, cmake, ctest and the program are stand-ins that write down their calls.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SETUP = os.path.abspath(sys.argv.pop(1))
NOISE = "\n".join(f"noise {i}" for i in range(100))


class Setup(unittest.TestCase):
    def setUp(self):
        self.dir = tempfile.mkdtemp(prefix="trigpoint-setup-")
        self.addCleanup(shutil.rmtree, self.dir)
        shutil.copy(SETUP, os.path.join(self.dir, "setup.sh"))
        with open(SETUP, encoding="utf-8") as script:
            block = re.search(r"^packages=\((.*?)^\)", script.read(), re.M | re.S).group(1)
        installed = block.split() + ["clang-14", "libclang-rt-14-dev", "slurm-wlm", "munge"]
        self.stand_in("bin/dpkg-query", "echo '" + " ".join(f"installed {name}" for name in installed) + "'")
        for name in ("apt-get", "cmake"):
            self.stand_in(f"bin/{name}", f"echo '{NOISE}'")
        self.stand_in("bin/ctest", f"echo '{NOISE}'; echo '100% tests passed, 0 tests failed out of 7'")
        self.stand_in("build/release/bin/trigpoint", "echo table of the example site")
        for name in ("one", "two"):
            os.makedirs(os.path.join(self.dir, "tests/fuzz/corpus", name))
            self.stand_in(f"build/fuzz/bin/fuzz_{name}", f"echo '{NOISE}'")

    def stand_in(self, path, text):
        file = os.path.join(self.dir, path)
        os.makedirs(os.path.dirname(file), exist_ok=True)
        with open(file, "w", encoding="utf-8") as script:
            script.write(f'#!/bin/bash\necho "{os.path.basename(path)} $*" >>"{self.dir}/calls"\n{text}\n')
        os.chmod(file, 0o755)

    def run_setup(self, *arguments):
        path = os.path.join(self.dir, "bin") + ":" + os.environ["PATH"]
        return subprocess.run(["./setup.sh", *arguments], cwd=self.dir, env={**os.environ, "PATH": path},
                              capture_output=True, text=True, check=False)

    def read(self, name):
        with open(os.path.join(self.dir, name), encoding="utf-8") as text:
            return text.read()

    def test_says_steps_and_logs_the_rest(self):
        for arguments in (), ("demo",), ("test",), ("nightly",):
            done = self.run_setup(*arguments)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertNotIn("noise", done.stdout + done.stderr)
            self.assertLessEqual(len(done.stdout.splitlines()), 20, done.stdout)
            self.assertIn("noise 99", self.read("build/setup.log"))

    def test_shows_what_the_user_asked_for(self):
        self.assertIn("table of the example site", self.run_setup("demo").stdout)
        self.assertIn("100% tests passed", self.run_setup("test").stdout)

    def test_shows_the_end_of_the_log_when_a_step_fails(self):
        self.stand_in("bin/cmake", f"echo '{NOISE}'; echo the reason >&2; exit 3")
        done = self.run_setup("demo")
        self.assertEqual(done.returncode, 1)
        self.assertIn("the reason", done.stderr)
        self.assertIn("noise 99", done.stderr)
        self.assertNotIn("noise 9\n", done.stderr)
        self.assertIn("build/setup.log", done.stderr)
        self.assertNotIn("trigpoint demo", self.read("calls"))

    def test_everyday_tests_leave_out_what_is_long(self):
        self.run_setup("test")
        self.assertRegex(self.read("calls"), r"ctest .*-LE lint\|nightly")
        self.run_setup("nightly")
        calls = self.read("calls")
        self.assertRegex(calls, r"ctest --test-dir build/asan .*-LE lint\n")
        self.assertIn("fuzz_one -max_total_time=600", calls)
        self.assertIn("fuzz_two -max_total_time=600", calls)

    def test_nightly_fails_with_the_example_site(self):
        self.stand_in("build/release/bin/trigpoint", "echo no site >&2; exit 1")
        done = self.run_setup("nightly")
        self.assertEqual(done.returncode, 1)
        self.assertIn("no site", done.stderr)

    def test_installs_what_is_missing(self):
        self.stand_in("bin/dpkg-query", "echo 'installed cmake '")
        self.stand_in("bin/sudo", 'exec "$@"')
        self.run_setup()
        self.assertRegex(self.read("calls"), r"apt-get install .* libeigen3-dev")
        self.assertNotRegex(self.read("calls"), r"apt-get install .* cmake ")


if __name__ == "__main__":
    unittest.main()
