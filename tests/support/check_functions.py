#!/usr/bin/env python3
"""Refuses functions that are not read on one screen.

    check_functions.py ROOT            checks
    check_functions.py ROOT --all N    prints the N longest functions

At most 60 lines, signature and braces included, in calib, datasets, localize, survey and eval; at most 100 anywhere. It
relies on the sources' form, which clang-format fixes: what stands in a namespace begins at column 0, in a class two
further in, and a block ends with a brace at the column where it began.
"""
import os
import re
import sys

LIMITS = {"calib": 60, "datasets": 60, "localize": 60, "survey": 60, "eval": 60, "app": 100, "tests": 100}
TYPE = re.compile(r"^\s*(template <.*> )?(struct|class|union|enum)\b[^()]*\{$")
SCOPE = re.compile(r'^\s*(inline )?(namespace\b[^=]*|extern "C" )\{$')


def blank_raw_strings(text):
    return re.sub(r'R"(\w*)\(.*?\)\1"', lambda m: '""' + "\n" * m.group(0).count("\n"), text, flags=re.S)


def name_of(signature):
    """Bar::Baz of "void Foo<int>::Bar::Baz(int a) const {"; Suite.Name of a test."""
    test = re.match(r"\s*(?:TEST|TEST_F|TEST_P)\((\w+), (\w+)\)", signature)
    if test:
        return ".".join(test.groups())
    found = re.search(r"((?:[\w~]+(?:<[^()]*>)?::)*(?:operator\s*[^\s\w(]+|operator\(\)|operator \w+|~?\w+))\s*\(", signature)
    return re.sub(r"\s", "", found.group(1)) if found else signature.strip()


def functions(text):
    """(name, first line, lines) of each function with a body of several lines."""
    lines = [re.sub(r"\s*//.*$", "", line) for line in blank_raw_strings(text).split("\n")]
    result, classes = [], []  # classes: (indent of the closing brace, name)
    i = 0
    while i < len(lines):
        line = lines[i]
        if not line.strip() or line.lstrip().startswith(("#", "}")) or re.match(r"\s*[A-Z_]+(\(.*\))?$", line):
            while line.lstrip().startswith("#") and line.endswith("\\"):
                i += 1
                line = lines[i]
            if classes and re.match(r" {%d}\}" % classes[-1][0], line):
                classes.pop()
            i += 1
            continue
        indent = len(line) - len(line.lstrip())
        begin, signature = i, line
        while not signature.endswith(("{", ";", "}", ":")) and i + 1 < len(lines):
            i += 1
            signature += " " + lines[i].strip()
        signature = signature.rstrip()
        i += 1
        if not signature.endswith("{") or SCOPE.match(signature):
            continue
        if TYPE.match(signature):
            name = re.search(r"(?:struct|class|union|enum)\s+(?:class\s+)?([\w:]*)", signature).group(1)
            classes.append((indent, name))
            continue
        while i < len(lines) and not re.match(r" {%d}\}" % indent, lines[i]):
            i += 1
        if i < len(lines) and lines[i] == " " * indent + "}" and "(" in signature:
            path = [name for _, name in classes if name]
            result.append(("::".join(path + [name_of(signature)]), begin + 1, i - begin + 1))
        i += 1
    return result


def all_functions(root):
    """{(file, function): lines}; the longest of overloads."""
    found = {}
    for top in LIMITS:
        for folder, _, files in os.walk(os.path.join(root, top)):
            for file in sorted(files):
                if not file.endswith((".h", ".cc")):
                    continue
                path = os.path.join(folder, file)
                with open(path, encoding="utf-8") as text:
                    for name, _, lines in functions(text.read()):
                        key = (os.path.relpath(path, root).replace(os.sep, "/"), name)
                        found[key] = max(found.get(key, 0), lines)
    return found


def limit_of(key):
    return LIMITS[key[0].split("/")[0]]


def check(found):
    """One sentence about each violation."""
    return [f"{key[0]}: {key[1]} has {lines} lines, expected at most {limit_of(key)}: split it"
            for key, lines in sorted(found.items()) if lines > limit_of(key)]


def main():
    found = all_functions(sys.argv[1])
    if "--all" in sys.argv:
        for key, lines in sorted(found.items(), key=lambda row: -row[1])[: int(sys.argv[sys.argv.index("--all") + 1])]:
            print(lines, *key)
        return 0
    problems = check(found)
    print("\n".join(problems) or f"{len(found)} functions, none too long")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
