#!/usr/bin/env python3
"""Refuses an include that goes against the architecture.

    check_includes.py ROOT

calib <- datasets <- survey, localize <- eval <- app: a file includes its own level and what is below; survey and
localize never each other. Qt only in app/desktop; VTK only in eval/scene and app/desktop. Own headers are named
from the top of the tree. Tests may include everything.
"""
import os
import re
import sys

LEVEL = {"calib": 0, "datasets": 1, "survey": 2, "localize": 2, "eval": 3, "app": 4}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
QT = re.compile(r"^(Q[A-Z]|Qt[A-Z0-9]|qt[a-z]*/)")
VTK = re.compile(r"^(vtk|QVTK)")


def within(path, folders):
    return any(path.startswith(folder + "/") for folder in folders)


def violation(path, bracket, target):
    """One sentence about an include in `path` (relative to the top), or None."""
    own, other = path.split("/")[0], target.split("/")[0]
    if QT.match(target) and not within(path, ["app/desktop"]):
        return "Qt is for app/desktop only"
    if VTK.match(target) and not within(path, ["eval/scene", "app/desktop"]):
        return "VTK is for eval/scene and app/desktop only"
    if other == "tests":
        return "the product does not include test material"
    if other in LEVEL and "/" in target:
        if LEVEL[other] > LEVEL[own]:
            return f"{own} must not know {other}"
        if LEVEL[other] == LEVEL[own] and other != own:
            return f"{own} and {other} meet in calib and datasets only"
    elif bracket == '"':
        return "own headers are named from the top of the tree, others in angle brackets"
    return None


def check(root):
    problems = []
    for top in LEVEL:
        for folder, _, files in os.walk(os.path.join(root, top)):
            for name in sorted(files):
                if not name.endswith((".h", ".cc")):
                    continue
                file = os.path.join(folder, name)
                path = os.path.relpath(file, root).replace(os.sep, "/")
                with open(file, encoding="utf-8") as lines:
                    for number, line in enumerate(lines, 1):
                        match = INCLUDE.match(line)
                        problem = match and violation(path, *match.groups())
                        if problem:
                            problems.append(f"{path}:{number}: {line.strip()}: {problem}")
    return problems


if __name__ == "__main__":
    found = check(sys.argv[1])
    print("\n".join(found) or "every include keeps to the architecture")
    sys.exit(1 if found else 0)
