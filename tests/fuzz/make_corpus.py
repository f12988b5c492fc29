#!/usr/bin/env python3
"""Writes the first inputs of the fuzz targets into tests/fuzz/corpus; what fuzzing finds is added by hand.

    make_corpus.py CORPUS
"""
import os
import sqlite3
import struct
import sys


def pack(files):
    return b"".join(name.encode() + b"\0" + struct.pack("<I", len(content)) + content for name, content in files.items())


def write(folder, name, content):
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name), "wb") as out:
        out.write(content)


def main():
    corpus = sys.argv[1]
    cameras = struct.pack("<QIiQQ4d", 1, 1, 1, 640, 480, 500, 500, 320, 240)
    pose = struct.pack("<7d", 1, 0, 0, 0, 0, 0, 0)
    images = struct.pack("<QI", 1, 1) + pose + struct.pack("<I", 1) + b"a.jpg\0" + struct.pack("<Qddq", 1, 10, 20, 1)
    points = struct.pack("<Qq3d3BdQII", 1, 1, 0, 0, 5, 1, 2, 3, 0.5, 1, 1, 0)
    rigs = struct.pack("<QIIiI", 1, 1, 1, 0, 1)
    frames = struct.pack("<QII", 1, 1, 1) + pose + struct.pack("<IiIQ", 1, 0, 1, 1)
    model = {"cameras.bin": cameras, "images.bin": images, "points3D.bin": points}
    folder = os.path.join(corpus, "colmap_model")
    write(folder, "binary", pack(model))
    write(folder, "binary_rigs", pack({**model, "rigs.bin": rigs, "frames.bin": frames}))
    text = {"cameras.txt": b"1 OPENCV 640 480 500 500 320 240 0 0 0 0\n", "images.txt": b"1 1 0 0 0 0 0 0 1 a b.jpg\n1 2 3 4 5 -1\n",
            "points3D.txt": b"3 0 0 5 1 2 3 0.5 1 0\n"}
    write(folder, "text", pack(text))
    write(folder, "text_rigs", pack({**text, "rigs.txt": b"1 1 CAMERA 1\n", "frames.txt": b"1 1 1 0 0 0 0 0 0 1 CAMERA 1 1\n"}))
    write(folder, "huge_count", pack({**model, "images.bin": b"\xff" * 8 + images[8:]}))
    write(folder, "cut", pack({**model, "points3D.bin": points[:40]}))
    file = os.path.join(corpus, "colmap_database", "small.db")
    os.makedirs(os.path.dirname(file), exist_ok=True)
    if os.path.exists(file):
        os.remove(file)
    db = sqlite3.connect(file)
    db.executescript("PRAGMA page_size=512; CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB);"
                     "CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER);"
                     "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                     "CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);")
    db.execute("INSERT INTO cameras VALUES (1, 1, 640, 480, ?)", (struct.pack("4d", 500, 500, 320, 240),))
    db.execute("INSERT INTO images VALUES (1, 'a', 1)")
    db.execute("INSERT INTO keypoints VALUES (1, 1, 4, ?)", (struct.pack("4f", 1, 2, 3, 4),))
    db.execute("INSERT INTO descriptors VALUES (1, 1, 128, ?)", (bytes(128),))
    db.commit()
    tables = {
        "tum": b"\x000.5 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n",
        "camchain": b"\x01cam0:\n  camera_model: pinhole\n  intrinsics: [1, 1, 1, 1]\n  distortion_model: none\n  distortion_coeffs: []\n  resolution: [4, 4]\n",
        "control": b"\x02tag_id,role,latitude_deg,longitude_deg,height_m\n5,check,48,7,240\n",
        "gpx": b"\x03<gpx><trk><trkseg><trkpt lat=\"48\" lon=\"7\"><ele>1</ele><time>2026-05-12T09:43:20Z</time></trkpt></trkseg></trk></gpx>",
        "nmea": b"\x04$GPGGA,120000.00,4800.00,N,00748.00,E,1,08,1.0,240.0,M,48.0,M,,*6E\n",
        "gps": b"\x05timestamp_s,latitude_deg,longitude_deg\n1,48,7\n",
        "gcp_list": b"\x06WGS84\n7 48 240 1 2 a.jpg p\n",
        "gcp_json": b"\x07{\"points\":[{\"id\":\"1\",\"position\":{\"latitude\":48,\"longitude\":7,\"altitude\":1},\"observations\":[]}]}",
        "euroc": b"\x08#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z\n1403638127245096960,1,2,3,1,0,0,0\n1403638127255096960,1,2,3,1,0,0,0\n",
        "distances": b"\x09from,to,distance_m,sigma_m,role\n1,2,3.25,0.003,check\n",
        "marks": b"\x0apoint,image,u,v\nA,x.jpg,1.5,2\n",
        "tags": b"\x0bfamily: tag36h11\nsize_m: 0.5\nsizes_m: {7: 0.2}\n",
        "origin": b"\x0c{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240.0}",
        "run": b"\x0ddate: 2026-05-12\nrole: both\nodometry: {levelled: true, scale_sigma: 0.01}\ngps: {lever_arm_m: [0, 0, 1]}\n",
        "panoramas": b"\x0efile,station,latitude_deg,longitude_deg,height_m,heading_deg,sigma_h_m\na.jpg,S1,48,7.8,240,12,0.3\n",
        "stations": b"\x0fstation,tag_id,east_m,north_m,up_m,sigma_m\nS1,57,0,0,1,0.01\n",
        "photos": b"\x10file,camera,station,latitude_deg,longitude_deg\na.jpg,,S1,48,7.8\n"}
    for name, content in tables.items():
        write(os.path.join(corpus, "tables"), name, content)
    write(os.path.join(corpus, "panorama_json"), "one", b'{"pano_id": "a", "location": {"lat": 48, "lng": 7}, "heading": 12, "date": "2024-06"}')
    write(os.path.join(corpus, "panorama_json"), "many", b'{"panoramas": [{"id": 3, "latitude": "48", "longitude": 7, "tilt": 91}, {"id": "../x"}, null]}')


if __name__ == "__main__":
    main()
