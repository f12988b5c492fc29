#!/usr/bin/env python3
"""Installs the build into a temporary prefix, builds a small project against it with find_package(trigpoint), runs both.

    install_test.py BUILD_DIR SOURCE_DIR
"""
import gzip
import os
import subprocess
import sys
import tempfile


def run(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}\n{done.stderr}")
    return done.stdout


def main():
    build, source = sys.argv[1:3]
    with tempfile.TemporaryDirectory(prefix="trigpoint-install-") as work:
        prefix = os.path.join(work, "prefix")
        run("cmake", "--install", build, "--prefix", prefix)
        run("cmake", "-S", os.path.join(source, "tests/install"), "-B", os.path.join(work, "user"), "-G", "Ninja",
            f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=Release")
        run("cmake", "--build", os.path.join(work, "user"))
        out = run(os.path.join(work, "user/user"), os.path.join(work, "model"))
        assert "works" in out, out
        program = os.path.join(prefix, "bin/trigpoint")
        assert run(program, "--version").strip(), "no version"
        # The program finds its example site beside itself, and its manual is there.
        for part in ("runs", "photos", "board"):
            assert os.path.isdir(os.path.join(prefix, "share/trigpoint/parking_lot", part)), part
        page = os.path.join(prefix, "share/man/man1/trigpoint-export.1.gz")
        with gzip.open(page, "rt", encoding="utf-8") as text:
            assert ".TH" in text.read(), page
        run("bash", "-n", os.path.join(prefix, "share/bash-completion/completions/trigpoint"))
    print("ok")


if __name__ == "__main__":
    main()
