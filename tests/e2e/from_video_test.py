#!/usr/bin/env python3
"""From an empty folder with one video and its GPX track to localized panoramas, by three commands.

    from_video_test.py PROGRAM SOURCE_DIR

The panoramas come from services_test.py's server on this machine.
"""
import csv
import datetime
import json
import os
import struct
import subprocess
import sys
import unittest

import services_test

RATE = 2  # frames a second
BEGIN = datetime.datetime(2026, 5, 12, 9, 43, 20, tzinfo=datetime.timezone.utc)


def box(kind, content):
    return struct.pack(">I", len(content) + 8) + kind + content


def mp4(frames, width, height):
    """An MP4 of JPEG frames (ISO/IEC 14496-12) that says when it was made."""
    zero = b"\0" * 4
    matrix = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
    head = box(b"ftyp", b"isom\0\0\2\0isomiso2mp41")
    offsets, at = [], len(head) + 8
    for frame in frames:
        offsets.append(at)
        at += len(frame)
    made, count, delta = int(BEGIN.timestamp()) + 2082844800, len(frames), 1000 // RATE
    movie = box(b"mvhd", zero + struct.pack(">IIIIIH", made, made, 1000, count * delta, 0x10000, 0x100) + b"\0" * 10 + matrix + b"\0" * 24 + struct.pack(">I", 2))
    track = box(b"tkhd", struct.pack(">IIIIII", 7, made, made, 1, 0, count * delta) + b"\0" * 16 + matrix + struct.pack(">II", width << 16, height << 16))
    media = box(b"mdhd", zero + struct.pack(">IIIIHH", made, made, 1000, count * delta, 0x55C4, 0)) + box(b"hdlr", zero + zero + b"vide" + b"\0" * 14)
    entry = box(b"jpeg", b"\0" * 6 + struct.pack(">H", 1) + b"\0" * 16 + struct.pack(">HHIIIH", width, height, 0x480000, 0x480000, 0, 1) + b"\0" * 32 + struct.pack(">Hh", 24, -1))
    table = (box(b"stsd", zero + struct.pack(">I", 1) + entry) + box(b"stts", zero + struct.pack(">III", 1, count, delta)) + box(b"stsc", zero + struct.pack(">IIII", 1, 1, 1, 1)) +
             box(b"stsz", zero + struct.pack(f">II{count}I", 0, count, *map(len, frames))) + box(b"stco", zero + struct.pack(f">I{count}I", count, *offsets)))
    links = box(b"vmhd", b"\0\0\0\1" + b"\0" * 8) + box(b"dinf", box(b"dref", zero + struct.pack(">I", 1) + box(b"url ", b"\0\0\0\1")))
    return head + box(b"mdat", b"".join(frames)) + box(b"moov", movie + box(b"trak", track + box(b"mdia", media + box(b"minf", links + box(b"stbl", table)))))


def rows_of(path):
    with open(path, encoding="utf-8") as rows:
        return list(csv.DictReader(line for line in rows if not line.startswith("#")))


class FromVideo(services_test.Services):
    def test_three_commands(self):
        run = f"{services_test.SOURCE}/datasets/parking_lot/runs/run1"
        frames = [services_test.content(f"{run}/images/{name}") for name in sorted(os.listdir(f"{run}/images"))]
        with open(f"{self.folder}/drive.mp4", "wb") as video:
            video.write(mp4(frames, 960, 600))
        points = ""
        for row in rows_of(f"{run}/gps.csv"):
            time = BEGIN + datetime.timedelta(seconds=float(row["timestamp_s"]) - 1000)
            points += f'<trkpt lat="{row["latitude_deg"]}" lon="{row["longitude_deg"]}"><ele>{row["height_m"]}</ele><time>{time.isoformat()[:19]}Z</time></trkpt>\n'
        with open(f"{self.folder}/drive.gpx", "w", encoding="utf-8") as track:
            track.write(f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>')
        for number, row in enumerate(rows_of(f"{services_test.SOURCE}/datasets/parking_lot/panoramas.csv")):
            picture = services_test.item(self.server, number, properties={"view:azimuth": float(row["heading_deg"])})
            picture["geometry"]["coordinates"] = [float(row["longitude_deg"]), float(row["latitude_deg"])]
            self.server.items.append(picture)
            self.server.pictures[f"/files/{number}.jpg"] = services_test.content(f"{services_test.SOURCE}/datasets/parking_lot/{row['file']}")
        for command in [["import", self.site, "--from", f"{self.folder}/drive.mp4", "--name", "drive", "--cameras", f"{run}/camchain.yaml"],
                        ["import", self.site, "--from", "panoramax", "--url", self.server.url + "/api", "--along", "drive", "--radius", "30"],
                        ["run", self.site]]:
            done = subprocess.run([services_test.PROGRAM, *command], capture_output=True, text=True, check=False, env=self.environment)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        panoramas = rows_of(f"{self.site}/results/localize/drive/panoramas.csv")
        localized = [row for row in panoramas if row["status"] == "localized"]
        print(f"{len(localized)} of {len(panoramas)} panoramas are localized", file=sys.stderr)
        self.assertEqual(len(panoramas), 4)
        self.assertGreaterEqual(len(localized), 3)
        source = json.loads(services_test.content(f"{self.site}/results/localize/drive/manifest.json"))["metrics"]["sources"]["panoramax"]
        self.assertEqual((source["positions"], source["stated_sigma_m"], source["estimated_sigma_m"]), (len(localized), 3, 0))


if __name__ == "__main__":
    services_test.PROGRAM, services_test.SOURCE = os.path.abspath(sys.argv.pop(1)), os.path.abspath(sys.argv.pop(1))
    unittest.main(defaultTest="FromVideo.test_three_commands")
