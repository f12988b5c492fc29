#!/usr/bin/env python3
"""Links of the documentation: files and headings exist, and commands and formats that pages name are built.

    check_docs.py SOURCE_DIR [PROGRAM]
"""
import os
import re
import subprocess
import sys


def anchors(text):
    found = set()
    for heading in re.findall(r"^#+\s+(.*)$", text, re.M):
        plain = re.sub(r"[`*_]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)).strip().lower()
        found.add(re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", plain)))
    return found


def main():
    source = os.path.abspath(sys.argv[1])
    pages = [os.path.join(source, "README.md")]
    for folder, _, files in os.walk(os.path.join(source, "docs")):
        pages += [os.path.join(folder, name) for name in files if name.endswith(".md")]
    problems, links = [], 0
    reached = set()
    for page in sorted(pages):
        with open(page, encoding="utf-8") as text:
            content = re.sub(r"```.*?```", "", text.read(), flags=re.S)
        for target in re.findall(r"!?\[[^\]]*\]\(([^)\s]+)\)", content):
            links += 1
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
            reached.add(file)
            if not os.path.exists(file):
                problems.append(f"{os.path.relpath(page, source)}: {target} does not exist")
            elif anchor and file.endswith(".md"):
                with open(file, encoding="utf-8") as other:
                    if anchor not in anchors(other.read()):
                        problems.append(f"{os.path.relpath(page, source)}: {target} names no heading")
    for page in pages:
        if page not in reached and os.path.basename(page) != "README.md":
            problems.append(f"{os.path.relpath(page, source)} is linked from nowhere")
    if len(sys.argv) > 2:
        text = subprocess.run([sys.argv[2], "--help"], capture_output=True, text=True, check=True).stdout
        commands = set(re.findall(r"^  ([a-z]+) ", text, re.M))
        for page in pages:
            with open(page, encoding="utf-8") as content:
                for block in re.findall(r"```(?:sh)?\n(.*?)```", content.read(), re.S):
                    for command in re.findall(r"^(?:\$ )?trigpoint ([a-z]+)", block, re.M):
                        if command not in commands:
                            problems.append(f"{os.path.relpath(page, source)}: trigpoint {command} is no command")
    print("\n".join(problems) or f"{links} links of {len(pages)} pages are good")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
