#!/usr/bin/env python3
"""Refuses a translation that lacks a text of the window.

    check_translations.py ROOT LUPDATE
"""
import glob
import html
import os
import re
import shutil
import subprocess
import sys
import tempfile


def missing(root, lupdate, catalogue):
    """The texts of the window that `catalogue` does not translate."""
    desktop = os.path.join(root, "app", "desktop")
    with tempfile.TemporaryDirectory() as scratch:
        renewed = os.path.join(scratch, os.path.basename(catalogue))
        shutil.copy(catalogue, renewed)
        subprocess.run([lupdate, "-silent", "-I", root, "-locations", "none", desktop, "-ts", renewed], check=True)
        with open(renewed, encoding="utf8") as file:
            messages = re.findall(r"<message.*?</message>", file.read(), flags=re.S)
    return [html.unescape(re.search(r"<source>(.*?)</source>", message, flags=re.S).group(1))
            for message in messages if 'type="unfinished"' in message]


def main():
    root, lupdate = sys.argv[1:3]
    catalogues = glob.glob(os.path.join(root, "app", "desktop", "translations", "*.ts"))
    if not catalogues:
        sys.exit(f"{root}: no translations found")
    failed = False
    for catalogue in catalogues:
        for text in missing(root, lupdate, catalogue):
            print(f"{os.path.relpath(catalogue, root)}: not translated: {text!r}; "
                  "gather texts with the target `translations`, then translate with linguist")
            failed = True
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
