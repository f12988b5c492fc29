#!/usr/bin/env python3
"""Checks the sources' form (clang-format) and runs clang-tidy over the product's translation units.

    lint.py format ROOT
    lint.py tidy ROOT BUILD [--jobs N]

clang-tidy needs seconds a file, so a file that passed is left alone until it, a header of ours that it includes
(as Ninja recorded them), its compile command or .clang-tidy changes: BUILD/lint holds a stamp for each.
Sources that CMake compiles together (unity builds) are checked together, too; one that nothing compiles is a finding.
Compiler warnings are the build's business.
"""
import concurrent.futures
import hashlib
import json
import os
import shlex
import subprocess
import sys

PRODUCT = ("app", "calib", "datasets", "eval", "localize", "survey")


def sources(root, tops, suffixes):
    for top in tops:
        for folder, _, files in os.walk(os.path.join(root, top)):
            for name in files:
                if name.endswith(suffixes):
                    yield os.path.join(folder, name)


def run_format(root):
    files = sorted(sources(root, PRODUCT + ("tests",), (".h", ".cc")))
    return subprocess.run(["clang-format-14", "--dry-run", "--Werror", *files], check=False).returncode


def headers_of_objects(root, build):
    """Object file -> files of ours it was made from."""
    result, current = {}, None
    for line in subprocess.run(["ninja", "-C", build, "-t", "deps"], check=True, capture_output=True, text=True).stdout.splitlines():
        if line and not line.startswith(" "):
            current = result.setdefault(line.split(":")[0], [])
        elif line.strip():
            file = os.path.normpath(os.path.join(build, line.strip()))
            if file.startswith(root + os.sep) and not file.startswith(build + os.sep):
                current.append(file)
    return result


def run_tidy(root, build, jobs):
    stamps = os.path.join(build, "lint")
    os.makedirs(stamps, exist_ok=True)
    digests = {}

    def digest(file):
        if file not in digests:
            with open(file, "rb") as content:
                digests[file] = hashlib.sha256(content.read()).hexdigest()
        return digests[file]

    headers = headers_of_objects(root, build)
    todo = []
    unseen = set(sources(root, PRODUCT, ".cc"))
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as commands:
        for entry in json.load(commands):
            path = os.path.relpath(entry["file"], root)
            unity = os.path.basename(path).startswith("unity_")
            if os.path.relpath(entry["file"], build if unity else root).split(os.sep)[0] not in PRODUCT:
                continue
            words = shlex.split(entry["command"])
            included = sorted(headers[words[words.index("-o") + 1]])  # of its object
            unseen -= {entry["file"], *included}
            parts = [entry["command"], digest(os.path.join(root, ".clang-tidy")), digest(entry["file"])]
            parts += [digest(file) for file in included]
            stamp = os.path.join(stamps, hashlib.sha256("\n".join(parts).encode()).hexdigest())
            if not os.path.exists(stamp):
                # A unity file is nothing but includes of sources.
                todo.append((path, entry["file"], stamp, ["--checks=-bugprone-suspicious-include"] if unity else []))

    def tidy(task):
        path, file, stamp, more = task
        command = ["clang-tidy-14", "-quiet", "-p", build, "--extra-arg=-w", *more, file]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        if done.returncode == 0:
            open(stamp, "w", encoding="utf-8").close()
        return path, done

    failed = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for path, done in pool.map(tidy, todo):
            if done.returncode != 0:
                failed += 1
                print(f"{path}:\n{done.stdout}{done.stderr}")
    for file in sorted(unseen):
        print(f"{os.path.relpath(file, root)}: no target compiles it, so clang-tidy can't check it")
    print(f"clang-tidy: {len(todo)} files checked, {failed} with findings")
    return 1 if failed or unseen else 0


if __name__ == "__main__":
    mode, top = sys.argv[1], os.path.realpath(sys.argv[2])
    if mode == "format":
        sys.exit(run_format(top))
    count = int(sys.argv[sys.argv.index("--jobs") + 1]) if "--jobs" in sys.argv else os.cpu_count()
    sys.exit(run_tidy(top, os.path.realpath(sys.argv[3]), count))
