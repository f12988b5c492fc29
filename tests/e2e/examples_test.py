#!/usr/bin/env python3
"""Runs every command that the help, the README and the pages of docs/ show, in a folder that has what they name.

    examples_test.py PROGRAM SOURCE_DIR [--show] [PLACE...]

The guides are run as wholes by guides_test.py. Here the commands of one help text, block or line run one after the
other in their own copy of a small site with results; each must end with 0. What takes too long, needs a network or files of
other programs is an exception (ONLY_PARSED): it runs where it finds nothing, and must get through the program's parser:
the exit code is not that of a wrong command line (2).
"""
import glob
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
import guides_test

USAGE = 2
PARSED_S = 2  # by then the command line is read
# What begins an example, and why it is only parsed.
NO_FILE = "a file of another program or device is not at hand"
LONG = "takes minutes"
NETWORK = "asks a service"
ONLY_PARSED = [
    (r"import my_site --from (panoramax|mapillary|kartaview|google)", NETWORK),
    (r"import my_site --from (drive.bag|iphone|street_view|sparse/0|field.fmap|MH_01_easy|ground_control_points.json)", NO_FILE),
    (r"calibrate my_site (--images 'cam0=|--from camera_info.yaml)", NO_FILE),
    (r"calibrate my_site --hand-eye", "needs a run that shows a board"),
    (r"stitch my_site --set panorama", LONG),
    (r"demo( /tmp/lot --units ft)?$", LONG),
    (r"crosscheck", "needs COLMAP, takes minutes"),
    (r"batch sites.txt --engine slurm", "needs Slurm"),
    (r'batch "/data/sites/\*"', "names folders of somebody's own"),
    (r"check my_site --watch", "has no end of its own"),
    (r"rerun ", "computes everything again; release_test does"),
]
# Commands whose exit code says something of the site, not of the command line.
NOT_PASSED, FAILED = 3, 1
OTHER_CODES = [(r"(plan|evaluate) my_site .*(--gates|--max-median)", NOT_PASSED), (r"check my_site$", NOT_PASSED),
               (r"calibrate .* --set model=rational", NOT_PASSED),  # the board's pictures are too few for that model
               (r"mark my_site P1$", FAILED)]  # it asks for a second mark
# What somebody has done before who types the examples of a help text.
BEFORE = {"verify": ["trigpoint publish my_site --name 2026-05 --sign ~/.ssh/id_ed25519"],
          "compare": ["trigpoint publish my_site --name 2026-05", "trigpoint publish my_site --name 2026-06",
                      "trigpoint evaluate my_site --variant paper"]}
COARSE = """  features: {images: {max_features: 500}}
  references: {views: {size_px: 360}, references: {max_features: 500}}
  survey: {tie_points: false, repeatability: false, stations: false}
  localize: {retrieval: {words: 1000, training_descriptors: 10000}}
"""


def commands_of(text):
    """Each trigpoint command of a text, continued lines joined, comments taken off."""
    for line in re.sub(r"\\\n\s*", " ", text).splitlines():
        line = re.sub(r"\s+#.*$", "", line).strip()
        if line.startswith("trigpoint "):
            yield line


def examples(program, source):
    """(place, commands in their order) of each help text, block, and line of a page"""
    found = []
    overview = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    for command in re.findall(r"(?m)^  ([a-z]+) ", overview[overview.index("Subcommands"):]):
        text = subprocess.run([program, command, "--help"], capture_output=True, text=True, check=True).stdout
        found.append((f"{command} --help", list(commands_of(text.partition("Example")[2]))))
    for page in [f"{source}/README.md", *sorted(glob.glob(f"{source}/docs/*.md"))]:
        name = os.path.relpath(page, source)
        for language, _, text, line in guides_test.blocks(page):
            if language == "sh":
                found.append((f"{name}:{line}", list(commands_of(text))))
        with open(page, encoding="utf-8") as text:
            for line, content in enumerate(text, 1):
                shown = [c for c in re.findall(r"`(trigpoint [^`]+)`", content) if is_example(c)]
                found.append((f"{name}:{line}", shown))
    return [(place, commands) for place, commands in found if commands]


def is_example(shown):
    """Of code in a sentence or a table: a command with its arguments, no placeholders among them."""
    plain = re.sub(r'"[^"]*"|EPSG:', "", shown)
    return re.match(r"trigpoint [a-z]+ [^-]", shown) and not re.search(r"[<>\[\]|]|\.\.\.|\b[A-Z]+\b", plain) and "trigpoint brightness" not in shown


def cut_run(run, images):
    """The first so many images of a run."""
    with open(f"{run}/images.txt", encoding="utf-8") as text:
        lines = text.readlines()
    kept = [line for line in lines if not line.startswith("#")][:images]
    for line in lines:
        if not line.startswith("#") and line not in kept:
            os.remove(f"{run}/{line.split()[1]}")
    with open(f"{run}/images.txt", "w", encoding="utf-8") as text:
        text.writelines(kept)


class Examples:
    def __init__(self, program, source, work, show):
        self.program, self.source, self.work, self.show = program, source, work, show
        self.problems = []
        self.base = f"{work}/base"
        self.home = f"{work}/home"

    def call(self, command, folder, parse_only=False):
        """Exit code and output; a command that is only parsed has no network, no programs, and little time."""
        command = command.replace("/tmp/", f"{self.work}/tmp/")
        environment = {**os.environ, "HOME": self.home, "PATH": f"{os.path.dirname(self.program)}:{os.environ['PATH']}"}
        if parse_only:
            environment.update(PATH=os.path.dirname(self.program), http_proxy="http://127.0.0.1:9", https_proxy="http://127.0.0.1:9")
        try:
            done = subprocess.run(["/bin/bash", "-c", f"exec {command}"], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  text=True, check=False, timeout=PARSED_S if parse_only else 600)
        except subprocess.TimeoutExpired:
            return (0, "") if parse_only else (None, "no end")
        return done.returncode, done.stdout

    def prepare(self):
        """A site of two short runs with its results, and what the examples name beside it."""
        site = f"{self.base}/my_site"
        for folder in (self.base, f"{self.work}/tmp", f"{self.home}/.ssh"):
            os.makedirs(folder)
        shutil.copytree(f"{self.source}/datasets/parking_lot", site, ignore=shutil.ignore_patterns("truth", "make.py"))
        for run in ("run1", "run2"):
            cut_run(f"{site}/runs/{run}", 20)
        os.rename(f"{site}/photos/station_110", f"{site}/photos/corner")
        shutil.copytree(f"{site}/photos/corner", f"{self.base}/my_photos")
        # Coarse, so that the whole of it takes seconds.
        stitch = "stages:\n  stitch: {rig: {max_features: 600, feature_size_px: 640}, panorama: {width: 512, seam_width: 512, parallax: false}}\n"
        for folder, more in (("my_photos", ""), ("my_site", COARSE)):
            with open(f"{self.base}/{folder}/trigpoint.yaml", "w", encoding="utf-8") as file:
                file.write(stitch + more)
        truth = f"{self.source}/datasets/parking_lot/truth/runs"
        for name in ("truth", "slam", "a", "b"):
            shutil.copy(f"{truth}/run1_cameras.tum", f"{self.base}/{name}.tum")
        with open(f"{self.base}/sites.txt", "w", encoding="utf-8") as file:
            file.write("my_site\n")
        key = f"{self.home}/.ssh/id_ed25519"
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", key], check=True)
        for name in ("colleague.pub", "surveyor.pub"):
            shutil.copy(key + ".pub", f"{self.base}/{name}")
        # In this order nothing is out of date at the end: a variant uses the photo set and the results without one, the report has it.
        for command in ("stitch my_site", "evaluate my_site", "evaluate my_site --variant trial", "run my_site"):
            self.do(f"trigpoint {command}", self.base)

    def do(self, command, folder):
        code, said = self.call(command, folder)
        if code != 0:
            sys.exit(f"{command} ended with {code}:\n{said}")

    def run(self, place, commands):
        folder = f"{self.work}/{re.sub(r'[^a-z0-9]+', '_', place.lower())}"
        empty = folder + "_empty"
        shutil.copytree(self.base, folder, symlinks=True)
        os.makedirs(empty)
        if any("monday" in command for command in commands):
            shutil.copytree(f"{folder}/my_site/runs/run1", f"{folder}/my_site/runs/monday")
            cut_run(f"{folder}/my_site/runs/monday", 8)
        for command in BEFORE.get(place.split()[0], []):
            self.do(command, folder)
        for command in commands:
            words = command[len("trigpoint "):]
            reason = next((why for pattern, why in ONLY_PARSED if re.match(pattern, words)), None)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            code, said = self.call(command, empty if reason else folder, reason is not None)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            print(f"{spent:6.1f} s  {place}: {command}" + (f"   (parsed only: {reason})" if reason else ""), flush=True)
            if self.show:
                print(said, flush=True)
            good = {0, *(its for pattern, its in OTHER_CODES if re.match(pattern, words))}
            if code == USAGE if reason else code not in good:
                self.problems.append(f"{place}: {command}: ended with {code}:\n{said}")
            if "InitGoogleLogging" in said:
                self.problems.append(f"{place}: {command}: a library speaks to its developers:\n{said[:400]}")
        shutil.rmtree(folder)
        shutil.rmtree(empty)


def main():
    program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
    wanted = [word for word in sys.argv[3:] if word != "--show"]
    found = examples(program, source)
    unused = [pattern for pattern, _ in ONLY_PARSED + OTHER_CODES
              if not any(re.match(pattern, c[len("trigpoint "):]) for _, commands in found for c in commands)]
    with tempfile.TemporaryDirectory(prefix="trigpoint-examples-") as work:
        test = Examples(program, source, work, "--show" in sys.argv)
        test.problems += [f"no example is '{pattern}' any more: take the exception out" for pattern in unused]
        test.prepare()
        seen = set()  # what has run already runs no second time in another place
        for place, commands in found:
            if not seen.issuperset(commands) and (not wanted or any(place.startswith(word) for word in wanted)):
                test.run(place, commands)
            seen.update(commands)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{sum(len(commands) for _, commands in found)} examples, {spent.ru_utime + spent.ru_stime:.0f} s of CPU")
    print("\n".join(test.problems) or "every example works as written")
    sys.exit(1 if test.problems else 0)


if __name__ == "__main__":
    main()
