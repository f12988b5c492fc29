#!/usr/bin/env python3
"""How fast bags are imported, and in how much memory.

    bag_speed.py TRIGPOINT MAKE_BAG [--megabytes 2000] [--forms a.bag:none:mono8,...] [--check]

Writes each bag, imports it, and prints megabytes of the file per second of CPU time and the peak of memory. --check
ends with 1 where a form is below 60 MB/s or above 300 MiB.
"""
import argparse
import os
import shutil
import subprocess
import sys
import tempfile

FORMS = ("a.bag:none:mono8,a.bag:lz4:mono8,a.bag:none:rgb8,a.bag:none:bayer_rggb8,a.mcap::mono8,a.mcap:lz4:mono8,"
         "a.mcap:zstd:mono8,a.db3::mono8")


def run(command):
    """CPU seconds and peak memory (MiB) of a command."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {process.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trigpoint")
    parser.add_argument("make_bag")
    parser.add_argument("--megabytes", default="2000")
    parser.add_argument("--forms", default=FORMS)
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    slow = False
    print(f"{'file':7} {'chunks':5} {'pixels':12} {'MB':>7} {'CPU s':>7} {'MB/s':>6} {'MiB':>5}")
    for form in arguments.forms.split(","):
        name, compression, encoding = form.split(":")
        folder = tempfile.mkdtemp(prefix="trigpoint_bag_speed_")
        try:
            bag = os.path.join(folder, name)
            make = [arguments.make_bag, bag, "--encoding", encoding, "--megabytes", arguments.megabytes]
            subprocess.run(make + (["--compression", compression] if compression else []), check=True)
            size = os.path.getsize(bag) / 1e6
            seconds, memory = run([arguments.trigpoint, "import", folder, "--from", bag, "--name", "run"])
            print(f"{name:7} {compression or '-':5} {encoding:12} {size:7.0f} {seconds:7.1f} {size / seconds:6.0f} {memory:5.0f}", flush=True)
            slow = slow or size / seconds < 60 or memory > 300
        finally:
            shutil.rmtree(folder)
    sys.exit(1 if slow and arguments.check else 0)


if __name__ == "__main__":
    main()
