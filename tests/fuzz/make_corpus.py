#!/usr/bin/env python3
"""Writes the first inputs of the fuzz targets into tests/fuzz/corpus; what fuzzing finds is added by hand.

    make_corpus.py CORPUS
"""
import hashlib
import json
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


def big(value, size=4):
    return value.to_bytes(size, "big")


def box(kind, *parts):
    content = b"".join(parts)
    return big(len(content) + 8) + kind + content


def klv(key, kind, size, value):
    return key + kind + big(size, 1) + big(len(value) // size if size else 0, 2) + value + bytes(-len(value) % 4)


def gopro_video():
    """An MP4 with one payload of one GPS5 fix."""
    scale = klv(b"SCAL", b"l", 4, b"".join(big(v) for v in (10000000, 10000000, 1000, 1000, 100)))
    stream = (klv(b"GPSF", b"L", 4, big(3)) + klv(b"GPSU", b"U", 16, b"260512094320.000") +
              klv(b"GPSP", b"S", 2, big(150, 2)) + scale + klv(b"GPS5", b"l", 20, b"".join(big(v) for v in (480000000, 78000000, 240000, 1000, 100))))
    payload = klv(b"DEVC", b"\0", 4, klv(b"DVNM", b"c", 1, b"Camera") + klv(b"STRM", b"\0", 4, stream))
    head = box(b"ftyp", b"mp42")
    zero, one = bytes(4), big(1)
    stbl = box(b"stbl", box(b"stsd", zero, one, box(b"gpmd", bytes(8))), box(b"stts", zero, one, one, big(1000)),
               box(b"stsz", zero, zero, one, big(len(payload))), box(b"stsc", zero, one, one, one, one),
               box(b"stco", zero, one, big(len(head) + 8)))
    mdia = box(b"mdia", box(b"mdhd", zero * 3, big(1000), big(1000), zero), box(b"minf", stbl))
    return head + box(b"mdat", payload) + box(b"moov", box(b"mvhd", bytes(100)), box(b"trak", mdia))


def files():
    """The first inputs of fuzz_files but a solution and a picture, which were added by hand, as the bags were."""
    matrix = "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [500., 0., 320., 0., 500., 240., 0., 0., 1.]\n"
    return {
        "opencv": b"\x00%YAML:1.0\nimage_width: 640\nimage_height: 480\n" + matrix.encode() +
                  b"distortion_coefficients: [0.1, 0, 0, 0]\n",
        "agisoft": b"\x01<calibration><projection>frame</projection><width>640</width><height>480</height><f>500</f><cx>1</cx>"
                   b"<cy>2</cy><b1>0.5</b1><k1>0.1</k1><p1>0.001</p1></calibration>",
        "photonvision": b'\x02{"resolution":{"width":640,"height":480},"cameraIntrinsics":{"rows":3,"cols":3,"data":[500,0,320,0,500,'
                        b'240,0,0,1]},"distCoeffs":{"rows":1,"cols":5,"data":[0.1,0,0,0,0]}}',
        "aprilgrid": b"\x03target_type: aprilgrid\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n",
        "wpilib": b'\x04{"tags":[{"ID":1,"pose":{"translation":{"x":1,"y":2,"z":3},"rotation":{"quaternion":{"W":1,"X":0,"Y":0,"Z":0}}}}],'
                  b'"field":{"length":16,"width":8}}',
        "fmap": b'\x04{"type":"frc","fiducials":[{"family":"apriltag3_36h11_classic","id":1,"size":165.1,"transform":[1,0,0,1,0,1,0,2,0,0,1,3,'
                b'0,0,0,1],"unique":true}]}',
        "images": b"\x050.5 a.jpg\n1 b.jpg cam0\n",
        "detections": b"\x06timestamp,image,camera,family,tag_id,hamming,margin,u0,v0,u1,v1,u2,v2,u3,v3,sigma_px\n"
                      b"1,a.jpg,cam0,tag36h11,7,0,60,1,1,9,1,9,9,1,9,0.3\n",
        "gopro": b"\x08" + gopro_video(),
        "rig": b"\x0aphoto,tx,ty,tz,qx,qy,qz,qw,focal_px\na.jpg,0,0,0,0,0,0,1,500\nb.jpg,0,0,0,0,1,0,0,500\n",
        "rig_lens": b"\x0b" + json.dumps({"photos": [{"photo": name, "lens": 0, "width_px": 640, "height_px": 480,
                                                     "covariance_rotation_rad_translation_m": [[0] * 6] * 6} for name in ("a.jpg", "b.jpg")],
                                          "lenses": [{"model": "radtan", "k1": 0.1, "k2": 0, "p1": 0, "p2": 0}],
                                          "circle": {"radius_m": 0.1, "log_sigma": 0.1}}).encode(),
        "words": b"\x0c" + struct.pack("<16s4I3Q2QI", b"trigpoint words", 1, 1, 1, 0, 1, 0, 2, 0, 1, 1) + b"a\0",
        "codebook": b"\x0d" + struct.pack("<20s2I9i", b"trigpoint codebook", 1, 3, 1, 2, -1, -1, 0, 0, -1, 0, 1) + bytes(3 * 256)}


def project():
    """The first inputs of fuzz_project: trigpoint.yaml, the review, a manifest, a sketch, readings, a release, tables."""
    digest = hashlib.sha256(b"").hexdigest()
    manifest = {"schema": 2, "stage": "survey", "name": "", "version": 3, "identity": digest, "options": {"loss": "huber"}, "values": {"review": None},
                "inputs": {"control_points.csv": digest}, "seed": 1, "threads": 2, "metrics": {"tags": 4}, "warnings": ["a"], "files": {"tags.csv": digest},
                "status": "done", "error": None, "end": "2026-05-12T09:43:20Z"}
    release = {"schema": "trigpoint release 2", "name": "r1", "files": {"map/tags.csv": {"sha256": digest, "bytes": 0}}}
    cell = {"type": "Feature", "geometry": {"type": "Point", "coordinates": [7.8, 48, 240]}, "properties": {"kind": "tag", "name": "5", "size_m": 0.3, "heading_deg": 90}}
    path = {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[7.8, 48], [7.8001, 48]]}, "properties": {"kind": "path", "name": "a"}}
    entry = {"schema": 1, "entry": 1, "time": "2026-05-12T09:43:20Z", "user": "a", "action": "exclude", "object": "tag:5", "reason": "moved"}
    undo = {**entry, "entry": 2, "action": "undo", "undoes": 1}
    covariance = ",".join(f"c{a}{b}" for a in range(6) for b in range(6))
    return {
        "yaml": b"\x00schema: 1\nname: lot\norigin: {latitude_deg: 48, longitude_deg: 7.8, height_m: 240}\ncrs: EPSG:32632\nruns: []\nroles: {}\n"
                b"gates: {survey: {max_tag_sigma_m: 0.02}}\nvariants: {v: {localize: {mode: paper}}}\nstages: {survey: {loss: huber}}\n",
        "review": b"\x01" + "".join(json.dumps(e) + "\n" for e in (entry, undo)).encode(),
        "manifest": b"\x02" + json.dumps(manifest).encode(),
        "sketch": b"\x03" + json.dumps({"type": "FeatureCollection", "features": [cell, path]}).encode(),
        "total_station": b"\x04setup,target,direction_deg,zenith_gon,slope_distance_m,target_height_m\nP1,tag:57/2,12.5,99.9,14.2,1.5\nP1,P2,190,,20,\n",
        "release": b"\x05" + json.dumps(release).encode(),
        "hashes": b"\x06" + json.dumps({"schema": 1, "files": {"control_points.csv": [10, 5, digest]}}).encode(),
        "poses": f"\x07timestamp,image,camera,status,x,y,z,qx,qy,qz,qw,{covariance}\n1,a.jpg,cam0,ok,1,2,3,0,0,0,1,{','.join(['1e-4'] * 36)}\n".encode(),
        "tags": b"\x08# trigpoint tags 1; frame=enu; datum=control; sigma=1\ntag_id,family,size_m,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,role,status\n"
                b"5,tag36h11,0.3,1,2,3,0,0,0,1,0.01,0.01,0.01,free,ok\n",
        "covariances": f"\x09tag_a,tag_b,{covariance}\n5,5,{','.join(['1e-4'] * 36)}\n".encode(),
        "errors": b"\x0arun,variant,method,station,panorama,tag_id,reference,kind,status,reason,error_3d_m,error_h_m,error_v_m,de_m,dn_m,du_m,error_rot_deg,"
                  b"sigma_e_m,sigma_n_m,sigma_u_m,nees,dof\nrun1,,g2,S1,a.jpg,5,self,relative,ok,,0.3,0.2,0.1,0.1,0.1,0.1,,0.1,0.1,0.1,1,3\n",
        "system": b"\x0bpoint: camera\nlever_arm_m: [0, 0, 1]\ntime_offset_s: 0.1\nalignment: se3\n",
        "estimate": b"\x0c0.5 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n"}


def services():
    """The first inputs of fuzz_services: answers of Panoramax, Mapillary, KartaView and Google, and a STAC file."""
    item = {"type": "Feature", "id": "a-1", "geometry": {"type": "Point", "coordinates": [7, 48]},
            "properties": {"datetime": "2024-05-12T09:43:20Z", "license": "CC-BY-SA-4.0", "view:azimuth": 90, "pers:pitch": 1, "quality:horizontal_accuracy": 2,
                           "pers:interior_orientation": {"field_of_view": 360, "sensor_array_dimensions": [4096, 2048]}},
            "assets": {"hd": {"href": "a.jpg", "type": "image/jpeg", "roles": ["data"]}}, "providers": [{"name": "Ann", "roles": ["producer"]}]}
    mapillary = {"id": "1", "captured_at": 1715506000000, "geometry": {"type": "Point", "coordinates": [7, 48]}, "computed_geometry": {"coordinates": [7, 48]},
                 "compass_angle": 90, "computed_compass_angle": 90, "computed_rotation": [1.2, -1.2, 1.2], "is_pano": True, "camera_type": "spherical",
                 "width": 4096, "creator": {"username": "ann"}}
    kartaview = {"id": "1", "projection": "SPHERE", "lat": "48", "lng": "7", "heading": "90", "shotDate": "2024-05-12 09:43:20", "width": "4096",
                 "fileurl": "https://localhost/{{sizeprefix}}/a.jpg"}
    google = [{"session": "s", "expiry": "9999999999"}, {"panoIds": ["a"]},
              {"panoId": "a", "lat": 48, "lng": 7, "heading": 90, "tilt": 90, "roll": 0, "date": "2024-05", "copyright": "Google", "imageWidth": 4096,
               "imageHeight": 2048, "tileWidth": 512, "tileHeight": 512, "links": [{"panoId": "b", "heading": 10}]}]
    page = {"type": "FeatureCollection", "features": [item], "links": [{"rel": "next", "href": "SERVER/search?page=2"}]}
    return {"panoramax": b"\x00" + json.dumps(page).encode(), "mapillary": b"\x01" + json.dumps({"data": [mapillary]}).encode(),
            "kartaview": b"\x02" + b"\0".join(json.dumps({"status": {"apiCode": 600}, "result": {"data": [kartaview], "hasMoreData": more}}).encode()
                                         for more in (True, False)),
            "google": b"\x03" + b"\0".join(json.dumps(answer).encode() for answer in google), "stac": b"\x04" + json.dumps(page).encode()}


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
    for name, content in files().items():
        write(os.path.join(corpus, "files"), name, content)
    for folder, inputs in (("project", project()), ("services", services())):
        for name, content in inputs.items():
            write(os.path.join(corpus, folder), name, content)
    write(os.path.join(corpus, "panorama_json"), "one", b'{"pano_id": "a", "location": {"lat": 48, "lng": 7}, "heading": 12, "date": "2024-06"}')
    write(os.path.join(corpus, "panorama_json"), "many", b'{"panoramas": [{"id": 3, "latitude": "48", "longitude": 7, "tilt": 91}, {"id": "../x"}, null]}')


if __name__ == "__main__":
    main()
