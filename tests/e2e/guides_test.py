#!/usr/bin/env python3
"""Runs the commands of the guides as they are written, each guide in an empty folder.

    guides_test.py PROGRAM SOURCE_DIR [GUIDE...] [--show]

A block ```sh is run by bash, a block ```text after it holds lines of its output: numbers may differ, ... stands for
anything. A block "```sh needs ..." wants what is not at hand; that its options exist is tested, as it is for the
examples of the README, the other pages and every command's help. Guides that begin with the example site find it
computed by the first guide, as somebody would who reads them one after the other.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap

FIRST = "own_run"
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")


def blocks(page):
    """(language, needs, text, line) of each fenced block, indented ones too."""
    with open(page, encoding="utf-8") as text:
        content = text.read()
    for match in re.finditer(r"^( *)```(\w*)(?: needs ([^\n]*))?\n(.*?)^\1```", content, re.M | re.S):
        line = content.count("\n", 0, match.start()) + 1
        yield match.group(2), match.group(3), textwrap.dedent(match.group(4)), line


def plain(line):
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip()


def missing_lines(expected, output):
    """Lines of `expected` that the output does not have, in this order."""
    there, missing = [plain(line) for line in output.splitlines()], []
    for line in expected.splitlines():
        pattern = ".*".join(re.escape(plain(part)) for part in line.split("..."))
        at = next((i for i, other in enumerate(there) if re.fullmatch(pattern, other)), None)
        if at is None:
            missing.append(line)
        else:
            there = there[at + 1:]
    return missing


def commands_in(text):
    """The words of each trigpoint command, comments and continued lines aside."""
    joined = re.sub(r"\\\n", " ", text)
    for line in joined.splitlines():
        words = re.sub(r"\s+#.*$", "", line).split()
        if words[:1] == ["trigpoint"]:
            yield words[1:]


class Guides:
    def __init__(self, program, show):
        self.program, self.show, self.problems = program, show, []
        self.help = {}

    def options_of(self, command):
        """The names that begin a line of the help's lists, not those of its examples."""
        if command not in self.help:
            done = subprocess.run([self.program, command, "--help"], capture_output=True, text=True, check=False)
            self.help[command] = done.stdout if done.returncode == 0 else ""
        return set(re.findall(r"(?m)^ +(?:-\w,)?(--[a-z-]+)", self.help[command]))

    def check_options(self, page, text):
        for command, *words in commands_in(text):
            options = self.options_of(command)
            if not options:
                self.problems.append(f"{page}: trigpoint {command} is no command")
            for word in words:
                option = word.strip("`,.;").split("=")[0]
                if options and re.fullmatch(r"--[a-z-]+", option) and option not in options:
                    self.problems.append(f"{page}: trigpoint {command} has no option {option}")

    def check_examples(self, source):
        overview = subprocess.run([self.program, "--help"], capture_output=True, text=True, check=True).stdout
        for command in re.findall(r"(?m)^  ([a-z]+) ", overview[overview.index("Subcommands"):]):
            self.options_of(command)
            self.check_options(f"{command} --help", self.help[command].partition("Example")[2])
        pages = [os.path.join(source, "README.md")]
        pages += [os.path.join(source, "docs", name) for name in os.listdir(os.path.join(source, "docs"))]
        for page in pages:
            if page.endswith(".md"):
                for language, _, text, line in blocks(page):
                    if language == "sh":
                        self.check_options(f"{os.path.basename(page)}:{line}", text)

    def run(self, page, folder):
        name = os.path.basename(page)
        path = os.path.dirname(self.program) + os.pathsep + os.environ["PATH"]
        output, ran = "", 0
        for language, needs, text, line in blocks(page):
            if language == "sh":
                self.check_options(f"{name}:{line}", text)
                output = ""
                if needs:
                    continue
                done = subprocess.run(["bash", "-e", "-c", text], cwd=folder, env={**os.environ, "PATH": path},
                                      stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
                output, ran = done.stdout, ran + 1
                if self.show:
                    print(f"--- {name}:{line}\n{text}\n{output}", flush=True)
                if done.returncode != 0:
                    self.problems.append(f"{name}:{line}: ended with {done.returncode}:\n{text}\n{output}")
                    return
            elif language == "text" and output:
                for lost in missing_lines(text, output):
                    self.problems.append(f"{name}:{line}: not in the output: {lost}\n{output}")
        print(f"{name}: {ran} blocks", flush=True)


def main():
    program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
    wanted = [word for word in sys.argv[3:] if word != "--show"]
    pages = {name[:-3]: os.path.join(source, "docs/guides", name)
             for name in sorted(os.listdir(os.path.join(source, "docs/guides"))) if name.endswith(".md")}
    guides = Guides(program, "--show" in sys.argv)
    guides.check_examples(source)
    with tempfile.TemporaryDirectory(prefix="trigpoint-guides-") as work:
        for name in [FIRST] + [name for name in pages if name != FIRST]:
            if wanted and name not in wanted and name != FIRST:
                continue
            folder = os.path.join(work, name)
            os.makedirs(folder)
            begins_with_example = "trigpoint demo my_site --copy-only" in open(pages[name], encoding="utf-8").read()
            if name != FIRST and begins_with_example:
                shutil.copytree(os.path.join(work, FIRST, "my_site"), os.path.join(folder, "my_site"))
            guides.run(pages[name], folder)
            if name != FIRST:
                shutil.rmtree(folder)
    print("\n".join(guides.problems) or "every guide works as written")
    sys.exit(1 if guides.problems else 0)


if __name__ == "__main__":
    main()
