"""What the benchmarks share: running a command and copying a project without its results."""
import os
import shutil
import subprocess
import sys
import time


def program(name="trigpoint"):
    """A program of the Release build."""
    top = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    path = os.path.join(top, "build", "release", "bin", name)
    if not os.path.exists(path):
        sys.exit(f"{path} is not there: run ./setup.sh test first")
    return path


def high_water_mib(pid):
    """Peak resident memory of a running process since it was last set back; 0 if it has ended."""
    try:
        with open(f"/proc/{pid}/status", encoding="ascii") as status:
            return next((int(line.split()[1]) / 1024 for line in status if line.startswith("VmHWM:")), 0.0)
    except OSError:
        return 0.0


def run(command, log, check=True):
    """Runs a command, its output into the open file `log`. Wall and CPU seconds, peak resident memory in MiB, exit code; with
    `check` anything but 0 ends the program."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
    # The kernel's high-water mark alone is that of the last stage: each stage of a project sets it back to state its own.
    peak = 0.0
    waited = 0
    while not waited:
        peak = max(peak, high_water_mib(process.pid))
        time.sleep(0.02)
        waited, status, usage = os.wait4(process.pid, os.WNOHANG)
    process.returncode = os.waitstatus_to_exitcode(status)
    if check and process.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {process.returncode}, see {log.name}")
    return {"wall": time.monotonic() - start, "cpu": usage.ru_utime + usage.ru_stime, "memory": max(peak, usage.ru_maxrss / 1024), "code": process.returncode}


def link(source, target):
    """A hard link where the file system allows it, else a copy."""
    os.makedirs(os.path.dirname(target), exist_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
    return target


def copy_project(source, target, runs):
    """The inputs of a project with some of its runs; results and trigpoint.yaml stay behind."""
    def ignore(folder, names):
        if os.path.samefile(folder, source):
            return {"results", "trigpoint.yaml", "truth"} & set(names)
        if os.path.samefile(folder, os.path.join(source, "runs")):
            return set(names) - set(runs)
        return set()
    shutil.copytree(source, target, ignore=ignore, copy_function=link)


def read_rows(path):
    """Comment lines, and the other lines split at blanks."""
    with open(path, encoding="utf-8") as text:
        lines = [line.rstrip("\n") for line in text if line.strip()]
    return [line for line in lines if line.startswith("#")], [line.split() for line in lines if not line.startswith("#")]
