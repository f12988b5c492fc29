#!/usr/bin/env python3
"""Cost of a project against its number of panoramas.

    many_references.py PROJECT RUN [--panoramas 10,100,1000,10000] [--work DIR] [--size 512]

Puts PROJECT's panoramas beside so many others of a town 1 to 15 km away: turned copies of SIZE px, upside down. Prints
for each number the cost of the stage `references` with no earlier result, of the same with one panorama more, and of
`localize` for RUN, whose own features and reconstruction are there already. Small pictures have few features: what is
measured is what a project pays for their number. Retrieval among pictures of the usual size: retrieval_distractors.
"""
import argparse
import csv
import json
import os
import shutil
import tempfile

from PIL import Image, ImageChops

from measure import copy_project, program, run


def rows(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


class Town:
    """Adds panoramas to a project's table, one after another."""

    def __init__(self, project, size):
        self.project = project
        table = os.path.join(project, "panoramas.csv")
        own = rows(table)
        self.columns = list(own[0])
        files = [os.path.join(project, row["file"]) for row in own]
        self.small = [Image.open(file).resize((size, size // 2)).rotate(180) for file in files]
        self.first = own[0]
        text = open(table, encoding="utf-8").read()
        os.remove(table)  # may be a hard link to the original
        with open(table, "w", encoding="utf-8") as out:
            out.write(text)
        self.table = table
        self.made = 0
        os.makedirs(os.path.join(project, "town"), exist_ok=True)

    def add(self, count):
        with open(self.table, "a", encoding="utf-8") as out:
            for k in range(self.made, self.made + count):
                file = f"town/{k:05d}.jpg"
                ImageChops.offset(self.small[k % len(self.small)], 37 * k, 0).save(os.path.join(self.project, file), quality=80)
                row = dict(self.first, file=file, station=f"T{k}")
                row["latitude_deg"] = f"{float(self.first['latitude_deg']) + 0.01 + 0.001 * (k // 100):.7f}"
                row["longitude_deg"] = f"{float(self.first['longitude_deg']) + 0.01 + 0.001 * (k % 100):.7f}"
                out.write(",".join(row[c] for c in self.columns) + "\n")
        self.made += count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project")
    parser.add_argument("run")
    parser.add_argument("--panoramas", default="10,100,1000,10000")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--work", help="folder to work in, kept; default: a temporary one")
    args = parser.parse_args()
    work = args.work or tempfile.mkdtemp(prefix="trigpoint-many-")
    project = os.path.join(work, "site")
    copy_project(args.project, project, [args.run])
    town = Town(project, args.size)
    own = len(rows(town.table))
    print("| panoramas | references, CPU s | MiB | one more, CPU s | localize alone, CPU s | MiB | retrieval, s | own localized |")
    print("|---|---|---|---|---|---|---|---|")
    with open(os.path.join(work, "log.txt"), "w", encoding="utf-8") as log:
        run([program(), "reconstruct", project, "--run", args.run], log)
        for wanted in map(int, args.panoramas.split(",")):
            town.add(max(0, wanted - own - town.made))
            for folder in os.listdir(os.path.join(project, "results")):
                if folder.startswith("references"):
                    shutil.rmtree(os.path.join(project, "results", folder))
            first = run([program(), "references", project], log)
            town.add(1)
            more = run([program(), "references", project], log)
            cost = run([program(), "localize", project, "--run", args.run], log)
            result = os.path.join(project, "results", "localize", args.run)
            with open(os.path.join(result, "manifest.json"), encoding="utf-8") as file:
                manifest = json.load(file)
            answers = rows(os.path.join(result, "panoramas.csv"))[:own]
            localized = sum(row["status"] == "localized" for row in answers)
            print(f"| {wanted} | {first['cpu']:.1f} | {first['memory']:.0f} | {more['cpu']:.1f} | {cost['cpu']:.1f} | "
                  f"{cost['memory']:.0f} | {manifest['metrics']['seconds']['retrieval']:.1f} | {localized} of {own} |", flush=True)
    if not args.work:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
