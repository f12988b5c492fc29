#!/usr/bin/env python3
"""Refuses a type that two files of the product define under the same name in the same namespace.

    check_types.py ROOT

C++'s one-definition rule: no compiler or linker need report it, and the program then runs with one of the two. Types in
an anonymous namespace belong to their file alone, those in a function to the function: neither counts.
"""
import os
import re
import sys

FOLDERS = ("app", "calib", "datasets", "eval", "localize", "survey")
# Comments, strings, characters (not the ' of 1'000), and lines of the preprocessor: replaced by what has no braces.
IGNORED = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\''
                     r"|^[ \t]*#(?:\\\n|[^\n])*", re.S | re.M)
NAMESPACE = re.compile(r"\bnamespace\b\s*([\w:]*)\s*$")
TYPE = re.compile(r"(?<![\w<,])\s*\b(?:struct|class|union|enum(?:\s+(?:class|struct))?)\s+(?:alignas\s*\([^)]*\)\s*)?"
                  r"([A-Za-z_][\w:]*(?:<[^;{}]*>)?)\s*(?:final\s*)?(?::(?!:)[^;{}()=]*)?$")


def types(text):
    """Qualified names of the types that a source defines for others to see."""
    text = IGNORED.sub(lambda m: "0" if m.group(0)[0] in "\"'R" else "", text)
    scopes, found, begin = [], [], 0  # a scope: its name, or None where nothing counts
    for at in re.finditer(r"[{};]", text):
        head, begin = text[begin:at.start()].strip(), at.end()
        if at.group(0) == "}":
            if scopes:
                scopes.pop()
        elif at.group(0) == "{":
            namespace, kind = NAMESPACE.search(head), TYPE.search(head)
            if namespace:
                scopes.append(namespace.group(1) or None)
            elif head in ("extern 0", 'extern "C"'):
                scopes.append("")
            elif kind:
                name = re.sub(r"\s+", " ", kind.group(1))
                scopes.append(name)
                if None not in scopes:
                    found.append("::".join(filter(None, scopes)))
            else:
                scopes.append(None)
    return found


def all_types(root):
    """{type: files that define it}."""
    found = {}
    for top in FOLDERS:
        for folder, _, files in sorted(os.walk(os.path.join(root, top))):
            for file in sorted(files):
                if file.endswith((".h", ".cc")):
                    path = os.path.join(folder, file)
                    with open(path, encoding="utf-8") as text:
                        for name in set(types(text.read())):
                            found.setdefault(name, []).append(os.path.relpath(path, root).replace(os.sep, "/"))
    return found


def main():
    found = all_types(sys.argv[1])
    problems = [f"{name} is defined in {' and in '.join(files)}: rename one, or put both into anonymous namespaces"
                for name, files in sorted(found.items()) if len(files) > 1]
    print("\n".join(problems) or f"{len(found)} types, each defined once")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
