#!/usr/bin/env python3
"""`trigpoint import --from SERVICE` against a server on this machine that answers as the services' documentation says.

    services_test.py PROGRAM SOURCE_DIR

No request leaves this machine: every address is 127.0.0.1.
"""
import csv
import http.server
import io
import json
import os
import re
import resource
import shutil
import signal
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.parse

from PIL import Image, ImageFilter

PROGRAM = ""
SOURCE = ""
TOKEN = "MLY|123|a-secret-that-must-not-show"
KEY = "AIza-a-secret-that-must-not-show"
PATHS = {"panoramax": "/api", "mapillary": "/graph", "kartaview": "/karta", "google": "/google"}
NEAR = (48.0125518, 7.8322567)


class Server(http.server.ThreadingHTTPServer):
    """Counts requests; `faults` maps a path to answers to give before the right one."""

    daemon_threads = True

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server_address[1]}"
        self.files_url = self.url
        self.log, self.faults, self.items, self.pictures = [], {}, [], {}
        self.page_size, self.delay_s, self.token, self.pages = 1000, 0, TOKEN, True
        self.key, self.sessions, self.expiry, self.cache_control, self.tiles = KEY, [], 0, "private, max-age=3600", {}
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()

    def paths(self, part):
        return [path for path, _ in self.log if part in path]


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def send(self, status, body, kind="application/json", headers=(), length=None):
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body) if length is None else length))
        for name, value in headers:
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def do_GET(self):
        try:
            self.answer()
        except BrokenPipeError:
            pass  # of a client that was killed

    def do_POST(self):
        self.body = self.rfile.read(int(self.headers["Content-Length"]))
        self.do_GET()

    def answer(self):
        server = self.server
        url = urllib.parse.urlsplit(self.path)
        query = dict(urllib.parse.parse_qsl(url.query))
        server.log.append((self.path, dict(self.headers)))
        faults = server.faults.get(url.path, [])
        fault = faults.pop(0) if faults else None
        if isinstance(fault, tuple):
            return self.send(fault[0], fault[1], headers=fault[2])
        if url.path == "/api/search":
            return self.search(query)
        if url.path == "/graph/images" or re.fullmatch(r"/graph/\d+", url.path):
            return self.graph(url.path, query)
        if url.path == "/karta/2.0/photo/":
            return self.karta(query)
        if url.path.startswith("/google/"):
            return self.google(url.path[len("/google"):], query)
        if url.path in server.pictures:
            return self.picture(server.pictures[url.path], fault)
        return self.send(404, b"{}")

    def picture(self, body, fault):
        time.sleep(self.server.delay_s)
        if fault == "cut":
            self.send(200, body[:len(body) // 2], "image/jpeg", length=len(body))
            self.close_connection = True
            return
        begin = int(re.match(r"bytes=(\d+)-", self.headers.get("Range", "bytes=0-")).group(1))
        if begin:
            self.send(206, body[begin:], "image/jpeg", [("Content-Range", f"bytes {begin}-{len(body) - 1}/{len(body)}")])
        else:
            self.send(200, body, "image/jpeg")

    def search(self, query):
        west, south, east, north = map(float, query["bbox"].split(","))
        inside = [i for i in self.server.items if west <= i["geometry"]["coordinates"][0] <= east and south <= i["geometry"]["coordinates"][1] <= north]
        page, size = int(query.get("page", 0)), self.server.page_size
        links = [{"rel": "root", "href": self.server.url + "/api/"}]
        if self.server.pages and (page + 1) * size < len(inside):
            links.append({"rel": "next", "href": f"{self.server.url}/api/search?bbox={query['bbox']}&page={page + 1}"})
        answer = {"type": "FeatureCollection", "features": inside[page * size:(page + 1) * size], "links": links}
        self.send(200, json.dumps(answer).encode(), "application/geo+json")

    def karta(self, query):
        north, west, south, east = (float(query[k]) for k in ["nwLat", "nwLng", "seLat", "seLng"])
        inside = [i for i in self.server.items if i["lat"] == "x" or (west <= float(i["lng"]) <= east and south <= float(i["lat"]) <= north)]
        page, size = int(query["page"]) - 1, min(self.server.page_size, int(query["itemsPerPage"]))
        answer = {"status": {"apiCode": 600, "httpCode": 200}, "result": {"data": inside[page * size:(page + 1) * size], "hasMoreData": (page + 1) * size < len(inside)}}
        self.send(200, json.dumps(answer).encode())

    def google(self, path, query):
        """The Map Tiles API: items are metadata by id."""
        server = self.server
        if query.get("key") != server.key:
            return self.send(400, json.dumps({"error": {"code": 400, "message": f"API key not valid: {query.get('key')}", "status": "INVALID_ARGUMENT"}}).encode())
        if path == "/createSession":
            assert self.headers["Content-Type"] == "application/json" and json.loads(self.body)["mapType"] == "streetview"
            server.sessions.append(f"session{len(server.sessions)}")
            return self.send(200, json.dumps({"session": server.sessions[-1], "expiry": str(server.expiry or int(time.time()) + 86400), "tileWidth": 256, "imageFormat": "jpeg"}).encode())
        if query.get("session") != server.sessions[-1]:
            return self.send(403, b'{"error": {"code": 403, "status": "PERMISSION_DENIED"}}')
        if path == "/streetview/panoIds":
            asked = json.loads(self.body)
            assert len(asked["locations"]) <= 100
            return self.send(200, json.dumps({"panoIds": [self.nearest(place, asked["radius"]) for place in asked["locations"]]}).encode())
        found = [i for i in server.items if i["panoId"] == query["panoId"]]
        if path == "/streetview/metadata":
            return self.send(200, json.dumps(found[0]).encode()) if found else self.send(404, b"{}")
        zoom, x, y = map(int, re.fullmatch(r"/streetview/tiles/(\d)/(\d+)/(\d+)", path).groups())
        return self.send(200, server.tiles[zoom][x, y], "image/jpeg", [("Cache-Control", server.cache_control)])

    def nearest(self, place, radius):
        def away(i):
            return max(abs(i["lat"] - place["lat"]) * 111000, abs(i["lng"] - place["lng"]) * 74500)
        listed = [i for i in self.server.items if away(i) <= radius and not i.get("hidden")]
        return min(listed, key=away)["panoId"] if listed else ""

    def graph(self, path, query):
        if self.headers.get("Authorization") != "OAuth " + self.server.token:
            error = {"error": {"message": f"Invalid OAuth 2.0 Access Token {self.headers.get('Authorization')}", "type": "OAuthException", "code": 190}}
            return self.send(401, json.dumps(error).encode())
        if path == "/graph/images" and "within" in self.server.items[0]:
            west, south, east, north = map(float, query["bbox"].split(","))
            inside = [i["graph"] for i in self.server.items if west <= i["within"][0] < east and south <= i["within"][1] < north]
            return self.send(200, json.dumps({"data": inside[:int(query["limit"])]}).encode())
        if path == "/graph/images":
            west, south, east, north = map(float, query["bbox"].split(","))
            assert east - west <= 0.01 + 1e-9 and north - south <= 0.01 + 1e-9, query
            return self.send(200, json.dumps({"data": [i["graph"] for i in self.server.items]}).encode())
        number = path.rsplit("/", 1)[1]
        return self.send(200, json.dumps({"id": number, query["fields"]: f"{self.server.files_url}/signed/{number}.jpg?oh=signature-that-must-not-show"}).encode())


def item(server, number, east_m=0.0, **more):
    """A picture of 360 deg as Panoramax describes it, `east_m` from the middle."""
    name = f"00000000-0000-4000-8000-{number:012d}"
    properties = {"datetime": f"20{20 + number % 5}-05-12T09:43:20+00:00", "license": "CC-BY-SA-4.0", "view:azimuth": 90 + number, "geovisio:producer": "somebody",
                  "pers:interior_orientation": {"field_of_view": 360, "sensor_array_dimensions": [4096, 2048]}}
    properties.update(more.pop("properties", {}))
    result = {"type": "Feature", "stac_version": "1.0.0", "id": name, "collection": "c",
              "geometry": {"type": "Point", "coordinates": [NEAR[1] + east_m / 74500, NEAR[0]]}, "properties": properties,
              "assets": {"hd": {"href": f"{server.url}/files/{number}.jpg", "type": "image/jpeg", "roles": ["data"]}},
              "providers": [{"name": "an instance", "roles": ["host"]}, {"name": "Ann \"the\" Walker", "roles": ["producer"]}], "links": []}
    result.update(more)
    return result


def with_gpano(jpeg, **values):
    tags = " ".join(f'GPano:{k}="{v}"' for k, v in values.items())
    xmp = (b'http://ns.adobe.com/xap/1.0/\0<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
           b'<rdf:Description rdf:about="" xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" ' + tags.encode() + b'/></rdf:RDF></x:xmpmeta>')
    return jpeg[:2] + b"\xff\xe1" + (len(xmp) + 2).to_bytes(2, "big") + xmp + jpeg[2:]


def content(path):
    with open(path, "rb") as file:
        return file.read()


def size_of(path):
    data, at = content(path), 2
    while data[at + 1] not in (0xC0, 0xC1, 0xC2):
        at += 2 + int.from_bytes(data[at + 2:at + 4], "big")
    return int.from_bytes(data[at + 7:at + 9], "big"), int.from_bytes(data[at + 5:at + 7], "big")


class Services(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="trigpoint_services_")
        self.site = os.path.join(self.folder, "site")
        self.server = Server()
        with open(f"{SOURCE}/datasets/parking_lot/panoramas/pano_057.jpg", "rb") as panorama:
            self.panorama = panorama.read()
        with open(f"{SOURCE}/datasets/parking_lot/runs/run1/images/000000.jpg", "rb") as photo:
            self.photo = photo.read()
        self.environment = {k: v for k, v in os.environ.items() if not k.lower().endswith("_proxy") and not k.startswith(("MAPILLARY", "GOOGLE"))}

    def tearDown(self):
        self.server.shutdown()
        self.server.server_close()
        shutil.rmtree(self.folder)

    def command(self, *more, service="panoramax", url=None):
        return [PROGRAM, "import", self.site, "--from", service, "--url", url or self.server.url + PATHS[service], *more]

    def run_import(self, *more, expect=0, near=NEAR, service="panoramax", url=None, **environment):
        where = [] if "--along" in more else ["--near", f"{near[0]},{near[1]}"]
        done = subprocess.run(self.command(*where, *more, service=service, url=url), capture_output=True, text=True, check=False,
                              env={**self.environment, **environment})
        self.assertEqual(done.returncode, expect, done.stdout + done.stderr)
        for secret in [TOKEN, "a-secret", "signature-that-must-not-show"]:
            self.assertNotIn(secret, done.stdout + done.stderr)
        return done

    def table(self):
        with open(f"{self.site}/panoramas.csv", encoding="utf-8") as rows:
            return list(csv.DictReader(line for line in rows if not line.startswith("#")))

    def add(self, count, **more):
        for number in range(count):
            self.server.items.append(item(self.server, number, 3 * number, **more))
            self.server.pictures[f"/files/{number}.jpg"] = self.panorama

    def test_list_takes_nothing(self):
        self.add(5)
        self.server.items.append(item(self.server, 5, 400))  # too far
        self.server.items.append(item(self.server, 6, 1, properties={"pers:interior_orientation": {"field_of_view": 70}}))
        done = self.run_import("--list")
        self.assertIn("5 panoramas: 1 of 2020, 1 of 2021", done.stdout)
        self.assertIn('Ann "the" Walker', done.stdout)
        self.assertFalse(os.path.exists(self.site))
        listed = json.loads(self.run_import("--list", "--json").stdout)["panoramas"]
        self.assertEqual([p["licence"] for p in listed], ["CC-BY-SA-4.0"] * 5)
        self.assertEqual(listed[1]["heading_deg"], 91)
        dated = json.loads(self.run_import("--list", "--json", "--since", "2021-05-12", "--until", "2022").stdout)["panoramas"]
        self.assertEqual(sorted(p["captured_at"][:4] for p in dated), ["2021", "2022"])
        self.assertIn("none of the 5 panoramas there was taken between 2030 and now", self.run_import("--since", "2030", expect=1).stderr)

    def test_what_is_stated_is_in_the_table(self):
        self.add(3)
        self.server.items[0]["properties"].update({"pers:pitch": -2.5, "pers:roll": 1.25, "quality:horizontal_accuracy": 4.8954})
        del self.server.items[1]["properties"]["view:azimuth"]
        self.run_import()
        rows = self.table()
        self.assertEqual(len(rows), 3)
        first = rows[0]
        self.assertEqual(first["file"], f"panoramas/panoramax-{self.server.items[0]['id']}.jpg")
        self.assertAlmostEqual(float(first["latitude_deg"]), NEAR[0], 8)
        self.assertEqual([float(first[c]) for c in ["heading_deg", "pitch_deg", "roll_deg", "sigma_h_m"]], [90, -2.5, 1.25, 2])
        self.assertEqual([first[c] for c in ["source", "captured_at", "licence"]], ["panoramax", "2020-05-12T09:43:20+00:00", "CC-BY-SA-4.0"])
        self.assertEqual(first["attribution"], 'Ann "the" Walker, Panoramax, CC-BY-SA-4.0')
        self.assertEqual([rows[1]["heading_deg"], rows[1]["pitch_deg"], rows[1]["sigma_h_m"]], ["", "", "3.000"])
        with open(f"{self.site}/{first['file']}", "rb") as kept:
            self.assertEqual(kept.read(), self.panorama)  # as it came: it is no wider than asked for
        done = subprocess.run([PROGRAM, "init", self.site], capture_output=True, text=True, check=True)
        self.assertIn("3 panoramas", done.stdout)
        self.assertNotIn("not known", done.stdout + done.stderr)

    def test_pages_and_rates(self):
        self.add(7)
        self.server.page_size = 3
        self.server.faults["/api/search"] = [(429, b"slow down", [("Retry-After", "0.3")]), (503, b"{}", [("Retry-After", "0")])]
        begin = time.time()
        self.run_import("--width", "512")
        self.assertGreater(time.time() - begin, 0.3)
        self.assertEqual(len(self.table()), 7)
        self.assertEqual(len(self.server.paths("/api/search")), 2 + 3)
        self.assertEqual({size_of(f"{self.site}/{row['file']}") for row in self.table()}, {(512, 256)})
        # A server that wants to be left alone is.
        self.server.faults["/api/search"] = [(429, b"", [("Retry-After", "3600")])]
        self.assertIn("refuses more requests for now", self.run_import(expect=1).stderr)

    def test_a_cut_connection_goes_on_where_it_broke(self):
        self.add(1)
        self.server.faults["/files/0.jpg"] = ["cut"]
        self.run_import()
        ranges = [headers.get("Range") for path, headers in self.server.log if path.startswith("/files/")]
        self.assertEqual(ranges, [None, f"bytes={len(self.panorama) // 2}-"])
        with open(f"{self.site}/{self.table()[0]['file']}", "rb") as kept:
            self.assertEqual(kept.read(), self.panorama)

    def test_pictures_that_are_none_are_left_out_and_named(self):
        self.add(7)
        part = {"FullPanoWidthPixels": 1920, "FullPanoHeightPixels": 960, "CroppedAreaImageWidthPixels": 960, "CroppedAreaImageHeightPixels": 600,
                "CroppedAreaLeftPixels": 400, "CroppedAreaTopPixels": 200, "ProjectionType": "equirectangular"}
        self.server.pictures.update({"/files/0.jpg": self.photo, "/files/1.jpg": self.panorama[:50000], "/files/2.jpg": b"<html>sorry</html>",
                                     "/files/3.jpg": with_gpano(self.photo, **part)})
        del self.server.pictures["/files/4.jpg"]
        self.server.faults["/files/5.jpg"] = [(500, b"", [("Retry-After", "0")])] * 5
        done = self.run_import()
        rows = {row["file"][-8:-4]: row for row in self.table()}
        self.assertEqual(sorted(rows), ["0003", "0006"])
        self.assertEqual(size_of(f"{self.site}/{rows['0003']['file']}"), (1920, 960))  # a part, in a sphere
        for number, why in [(0, "960 x 600"), (1, ""), (2, ""), (4, "status 404")]:
            self.assertRegex(done.stderr, rf"panorama 00000000-0000-4000-8000-{number:012d}.*{why}.*the panorama is skipped")
        self.assertIn("fails (status 500)", done.stderr)
        self.assertIn("2 of 7 panoramas", done.stdout)

    def test_hostile_answers(self):
        self.add(1)
        good = self.server.items[0]
        self.server.items += [{**good, "id": "../../etc/passwd"}, {**good, "id": "x" * 500}, {**good, "id": "none", "assets": {"hd": {"href": 7}}}]
        self.server.items.append({**good, "id": "elsewhere", "assets": {"hd": {"href": "file:///etc/passwd"}}})
        self.server.items.append({**good, "id": "plain", "assets": {"hd": {"href": "http://192.0.2.1/a.jpg"}}})
        done = self.run_import()
        self.assertEqual(len(self.table()), 1)
        self.assertIn("expected one that begins with https://", done.stderr)
        self.assertFalse(os.path.exists("/etc/passwd.jpg"))
        for body, why in [(b"[" * 100000, "expected a JSON object"), (b"", "expected a JSON object"), (b'{"features": 3}', 'expected a list "features"'),
                          (b'{"features": [], "links": [{"rel": "next", "href": "http://127.0.0.1:9/x"}]}', "of the same server"),
                          (b'{"features": [null, 3, {"id": 5}], "links": 7}', "no panorama lies within")]:
            self.server.faults["/api/search"] = [(200, body, [])]
            self.assertIn(why, self.run_import(expect=1).stderr)

    def test_entries_are_added_and_the_old_table_is_kept(self):
        self.add(2)
        os.makedirs(f"{self.site}/panoramas")
        own = "# mine\nfile;lat;long;Note\npanoramas/own.jpg;48,5;7,5;\"a, b\"\n"
        with open(f"{self.site}/panoramas.csv", "w", encoding="utf-8") as table:
            table.write(own)
        self.run_import()
        rows = self.table()
        self.assertEqual([row["Note"] for row in rows], ["a, b", "", ""])
        self.assertEqual([rows[0]["latitude_deg"], rows[0]["longitude_deg"], rows[0]["licence"]], ["48.5", "7.5", ""])
        replaced = os.listdir(f"{self.site}/results/replaced")
        self.assertEqual(len(replaced), 1)
        with open(f"{self.site}/results/replaced/{replaced[0]}", encoding="utf-8") as kept:
            self.assertEqual(kept.read(), own)
        # What is there is neither loaded nor written again.
        before, count = content(f"{self.site}/panoramas.csv"), len(self.server.paths("/files/"))
        self.assertIn("2 of them were there already", self.run_import().stdout)
        self.assertEqual(content(f"{self.site}/panoramas.csv"), before)
        self.assertEqual(len(self.server.paths("/files/")), count)

    def test_a_kill_loses_the_picture_in_flight_alone(self):
        self.add(8)
        self.server.delay_s = 0.3
        process = subprocess.Popen(self.command("--near", f"{NEAR[0]},{NEAR[1]}"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=self.environment)
        while len(self.server.paths("/files/")) < 4:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        asked = self.server.paths("/files/")
        self.server.delay_s = 0
        self.run_import()
        self.assertEqual(len(self.table()), 8)
        self.assertTrue(all(row["heading_deg"] for row in self.table()))
        again = self.server.paths("/files/")[len(asked):]
        self.assertLessEqual(len(set(asked) & set(again)), 1)

    def test_a_killed_google_import_leaves_nothing_without_an_end(self):
        self.serve_google(self.google("a", links=[{"panoId": "b"}]), self.google("b", 30, hidden=True, links=[{"panoId": "c"}]), self.google("c", 45, hidden=True))
        stop, asked = threading.Event(), threading.Event()
        real = Handler.google

        def slow(handler, path, query):
            if path.startswith("/streetview/tiles/") and query["panoId"] == "c":
                asked.set()
                stop.wait(30)
            return real(handler, path, query)

        Handler.google = slow
        self.addCleanup(setattr, Handler, "google", real)
        process = subprocess.Popen(self.command("--near", f"{NEAR[0]},{NEAR[1]}", "--permitted", "--width", "1664", "--radius", "60", service="google"), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, env={**self.environment, "GOOGLE_MAPS_API_KEY": KEY, "TMPDIR": self.folder})
        self.assertTrue(asked.wait(30))
        process.send_signal(signal.SIGKILL)
        process.wait()
        stop.set()
        Handler.google = real
        # Every picture has a row with its end.
        self.assertEqual(sorted(os.listdir(f"{self.site}/panoramas")), ["google-a.jpg", "google-b.jpg"])
        self.assertEqual([row["file"] for row in self.table()], ["panoramas/google-a.jpg", "panoramas/google-b.jpg"])
        self.assertTrue(all(row["keep_until"] for row in self.table()))
        self.assertEqual(os.listdir(self.folder), ["site"])  # no tile either
        # What a kill leaves of a picture being written is gone after the next command; a row without picture is finished.
        os.remove(f"{self.site}/panoramas/google-b.jpg")
        unfinished = f"{self.site}/panoramas/.google-b.jpg.123456789-42-7"
        shutil.copy(f"{self.site}/panoramas/google-a.jpg", unfinished)
        os.utime(unfinished, (time.time() - 100,) * 2)
        self.assertIn("3 of 3 panoramas, 1 of them", self.run_google().stdout)
        self.assertEqual(sorted(os.listdir(f"{self.site}/panoramas")), ["google-a.jpg", "google-b.jpg", "google-c.jpg"])
        self.assertEqual([row["file"][-5] for row in self.table()], ["a", "b", "c"])
        with open(f"{self.site}/panoramas.csv", encoding="utf-8") as table:
            text = table.read()
        with open(f"{self.site}/panoramas.csv", "w", encoding="utf-8") as table:
            table.write(re.sub(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", "2024-01-01T00:00:00Z", text))
        # What is over is loaded again.
        self.assertNotIn("there already", self.run_google().stdout)

    def test_rows_are_written_on_the_way(self):
        self.add(3)
        self.server.delay_s = 1.2  # longer than the time between two saves of the table
        process = subprocess.Popen(self.command("--near", f"{NEAR[0]},{NEAR[1]}"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=self.environment)
        deadline = time.time() + 60
        while len(self.server.paths("/files/")) < 3:
            self.assertIsNone(process.poll(), "the import ended before its third picture")
            self.assertLess(time.time(), deadline, "no request for the third picture within 60 s")
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        self.assertEqual([row["heading_deg"] for row in self.table()], ["90.0000", "91.0000"])

    def test_a_larger_width_is_loaded_again(self):
        self.add(3)
        self.run_import("--width", "512")
        rows = self.table()
        files = [f"{self.site}/{row['file']}" for row in rows]
        corrected = content(f"{self.site}/panoramas.csv").replace(b"91.0000", b"123.4000")
        with open(f"{self.site}/panoramas.csv", "wb") as table:
            table.write(corrected)
        # A server error and a picture that is none: the narrower ones stay.
        narrow, whole = [content(file) for file in files], dict(self.server.pictures)
        self.server.faults = {"/files/0.jpg": [(500, b"", [("Retry-After", "0")])] * 5, "/files/2.jpg": ["cut"]}
        self.server.pictures["/files/1.jpg"] = b"<html>sorry</html>"
        done = self.run_import("--width", "1024")
        self.assertEqual(done.stderr.count("; the narrower picture stays"), 2)
        self.assertIn("3 of 3 panoramas, 2 of them were there already, 1 replaced narrower pictures", done.stdout)
        self.assertEqual([content(file) for file in files[:2]], narrow[:2])
        self.server.pictures = whole
        done = self.run_import("--width", "1024")
        self.assertIn("3 of 3 panoramas, 1 of them were there already, 2 replaced narrower pictures", done.stdout)
        self.assertIn("masks and control_observations.csv of the narrower ones no longer fit", done.stderr)
        self.assertEqual([size_of(file) for file in files], [(1024, 512)] * 3)
        self.assertEqual(content(f"{self.site}/panoramas.csv"), corrected)
        # As wide as asked for, or wider: nothing to do. As the source has it: its own bytes, which no width is wider than.
        count = len(self.server.paths("/files/"))
        for width in ["1024", "512"]:
            self.assertIn("3 of them were there already", self.run_import("--width", width).stdout)
        self.assertEqual(len(self.server.paths("/files/")), count)
        self.run_import("--width", "0")
        self.assertEqual([content(file) for file in files], [self.panorama] * 3)
        count = len(self.server.paths("/files/"))
        self.run_import("--width", "8192")
        self.assertEqual(len(self.server.paths("/files/")), count)
        # A kill while wider ones arrive leaves each file whole, of the one width or the other.
        shutil.rmtree(self.site)
        self.run_import("--width", "512")
        self.server.delay_s, before = 0.3, len(self.server.paths("/files/"))
        process = subprocess.Popen(self.command("--near", f"{NEAR[0]},{NEAR[1]}", "--width", "1024"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=self.environment)
        deadline = time.time() + 60
        while len(self.server.paths("/files/")) < before + 2 and time.time() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        self.assertEqual([size_of(file) for file in files], [(1024, 512), (512, 256), (512, 256)])
        self.server.delay_s = 0
        self.assertIn("1 of them were there already, 2 replaced narrower pictures", self.run_import("--width", "1024").stdout)

    def test_google_in_a_larger_width_has_a_new_end(self):
        self.serve_google(self.google("a"))
        self.run_google("--width", "832")
        ends = [self.table()[0]["keep_until"]]
        self.server.cache_control = "private, max-age=7200"
        self.run_google()
        ends.append(self.table()[0]["keep_until"])
        self.assertEqual(size_of(f"{self.site}/panoramas/google-a.jpg"), (1664, 832))
        self.assertLess(ends[0], ends[1])

    def test_options_out_of_range_are_refused_before_any_request(self):
        self.add(1)
        for more, why in [(["--since", "yesterday"], "--since: expected a date as 2024, 2024-05 or 2024-05-12, found 'yesterday'"), (["--until", "2024-02-30"], "--until: expected a date"),
                          (["--since", "2024-13"], "--since: expected a date"), (["--since", "2024/05"], "--since: expected a date"),
                          (["--since", "2024-06", "--until", "2024-05-12"], "--since 2024-06 is later than --until 2024-05-12"), (["--width", "1"], "--width: expected 0 or an even number"),
                          (["--width", "513"], "found 513"), (["--radius", "nan"], "--radius")]:
            self.assertIn(why, self.run_import(*more, expect=2).stderr)
        for near in [(98, 7), (48, 190), ("nan", 7)]:
            self.assertIn("expected a latitude from -90 to 90 and a longitude from -180 to 180", self.run_import(near=near, expect=2).stderr)
        self.assertEqual(self.server.log, [])
        self.server.items[0]["properties"]["datetime"] = ""
        self.assertIn("none of the 1 panoramas", self.run_import("--until", "2030", expect=1).stderr)
        # Since and until of the same month; a service in any case.
        self.server.items[0]["properties"]["datetime"] = "2024-05-12T09:43:20Z"
        listed = subprocess.run([PROGRAM, "import", self.site, "--from", "PanoraMAX", "--url", self.server.url + "/api", "--near", f"{NEAR[0]},{NEAR[1]}", "--list", "--since", "2024-05-12",
                                 "--until", "2024"], capture_output=True, text=True, check=True, env=self.environment)
        self.assertIn("1 panorama:", listed.stdout)

    def test_values_that_cannot_be_are_left_out(self):
        self.add(3)
        self.server.items[0]["properties"].update({"view:azimuth": -30, "pers:pitch": 91, "pers:roll": 1e300, "quality:horizontal_accuracy": -4})
        self.server.items[1]["properties"].update({"view:azimuth": 1e300, "pers:pitch": -90, "pers:roll": 180, "quality:horizontal_accuracy": 1e9})
        done = self.run_import()
        self.assertEqual([[row[c] for c in ["heading_deg", "pitch_deg", "roll_deg", "sigma_h_m"]] for row in self.table()],
                         [["330.0000", "", "", "3.000"], ["", "-90.0000", "180.0000", "3.000"], ["92.0000", "", "", "3.000"]])
        self.assertEqual(done.stderr.count("5 values of heading, pitch, roll, height or accuracy outside the possible range"), 1)

    def test_full_lists_are_divided(self):
        # Panoramax without pages: 1000 an answer.
        self.server.items = [item(self.server, n, 0.09 * n) for n in range(1500)]
        self.server.pages = False
        self.assertIn("1500 panoramas:", self.run_import("--list").stdout)
        # All at one place: no division helps.
        self.server.items = [item(self.server, n) for n in range(1001)]
        done = self.run_import("--list")
        self.assertIn("panoramax: at least 1000 panoramas there", done.stderr)
        self.assertIn("the list is cut; take a smaller --radius", done.stderr)
        for spread, count, cut in [(1e-6, 2100, False), (0, 2001, True)]:
            self.server.items = [{"graph": self.graph(n, geometry={"type": "Point", "coordinates": [NEAR[1] + spread * n / 10, NEAR[0]]}), "within": (NEAR[1] + spread * n / 10, NEAR[0])}
                                 for n in range(count)]
            done = self.run_import("--list", service="mapillary", MAPILLARY_ACCESS_TOKEN=TOKEN)
            self.assertIn("2000 panoramas:" if cut else "2100 panoramas:", done.stdout)
            self.assertEqual("mapillary: at least 2000 panoramas there" in done.stderr, cut)

    def test_no_password_shows(self):
        for url in [self.server.url.replace("//", "//ann:a-secret@") + "/api", "https://ann:a-secret/x@example.org/api?key=a-secret"]:
            self.assertIn("expected an address without user and password", self.run_import(url=url, expect=2).stderr)
        self.add(1)
        self.server.items.append({**self.server.items[0], "id": "other", "assets": {"hd": {"href": self.server.url.replace("//", "//ann:a-secret@") + "/files/0.jpg"}}})
        self.assertIn("127.0.0.1", self.run_import().stderr)

    def test_refusals_are_named(self):
        self.server.items = [{"graph": self.graph(1)}]
        expired = json.dumps({"error": {"message": f"Error validating access token {TOKEN}", "type": "OAuthException", "code": 190}}).encode()
        self.server.faults["/graph/images"] = [(400, expired, [])]
        self.assertIn("refuses the token (status 400, error 190): the token is missing, wrong or expired",
                      self.run_import("--list", service="mapillary", expect=1, MAPILLARY_ACCESS_TOKEN=TOKEN).stderr)
        self.server.faults["/karta/2.0/photo/"] = [(200, b'{"status": {"apiCode": 401, "apiMessage": "You have to be authenticated"}}', [])]
        self.assertIn("answers with apiCode 401: the service gives this list to registered clients only", self.run_import("--list", service="kartaview", expect=1).stderr)
        # Retry-After as a date: soon is waited for, far off is not.
        self.server.items = []
        self.add(1)
        def date(after_s):
            return time.strftime("%a, %d %b %Y %H:%M:%S GMT", time.gmtime(time.time() + after_s))
        self.server.faults["/api/search"] = [(429, b"", [("Retry-After", date(2))])]
        begin = time.time()
        self.run_import("--list")
        self.assertTrue(1 <= time.time() - begin < 6)
        self.server.faults["/api/search"] = [(429, b"", [("Retry-After", date(3600))])]
        self.assertRegex(self.run_import("--list", expect=1).stderr, r"refuses more requests for now \(status 429\); try again in 3[56]\d\d s")

    def test_tiny_and_huge_pictures_are_left_out(self):
        self.add(3)
        tiny = io.BytesIO()
        Image.new("RGB", (64, 32)).save(tiny, "JPEG")
        huge = bytearray(self.panorama)
        at = 2
        while huge[at + 1] not in (0xC0, 0xC2):
            at += 2 + int.from_bytes(huge[at + 2:at + 4], "big")
        huge[at + 5:at + 9] = (32766).to_bytes(2, "big") + (65532).to_bytes(2, "big")
        self.server.pictures.update({"/files/0.jpg": tiny.getvalue(), "/files/1.jpg": bytes(huge)})
        done = self.run_import()
        self.assertIn("expected a picture from 512 to 32768 px wide, found 64 x 32 px", done.stderr)
        self.assertIn("expected a picture from 512 to 32768 px wide, found 65532 x 32766 px", done.stderr)
        self.assertEqual(len(self.table()), 1)

    def import_file(self, *arguments, expect=0):
        done = subprocess.run([PROGRAM, "import", self.site, *arguments], capture_output=True, text=True, check=False, env=self.environment)
        self.assertEqual(done.returncode, expect, done.stdout + done.stderr)
        return done

    def test_a_stac_file(self):
        self.add(1)
        os.makedirs(f"{self.folder}/stac/pictures")
        with open(f"{self.folder}/stac/pictures/two.jpg", "wb") as picture:
            picture.write(self.panorama)
        two = item(self.server, 2, 10, id="two", assets={"visual": {"href": "./pictures/two.jpg", "type": "image/jpeg"}, "thumbnail": {"href": "no.jpg", "type": "image/jpeg", "roles": ["thumbnail"]}})
        del two["properties"]["pers:interior_orientation"]
        part = item(self.server, 3, properties={"pers:interior_orientation": {"field_of_view": 70}})
        hostile = [item(self.server, 4, id="../up"), item(self.server, 5, id="out", assets={"hd": {"href": "../../../../etc/passwd"}}), None, 7,
                   item(self.server, 6, id="gone", assets={"hd": {"href": "gone.jpg"}}), item(self.server, 7, id="plain", assets={"hd": {"href": "http://192.0.2.1/a.jpg"}}),
                   item(self.server, 8, id="linked", assets={"hd": {"href": "linked.jpg"}})]
        path = f"{self.folder}/stac/items.json"
        def write(document):
            with open(path, "w", encoding="utf-8") as file:
                file.write(document if isinstance(document, str) else json.dumps(document))
        write({"type": "FeatureCollection", "features": [*self.server.items, two, part, *hostile]})
        os.symlink("/etc/hostname", f"{self.folder}/stac/linked.jpg")
        self.assertIn("6 panoramas:", self.import_file("--from", path, "--list").stdout)
        self.assertFalse(os.path.exists(self.site))
        done = self.import_file("--from", "stac", "--url", path)
        for why in ["panorama out", "linked.jpg: expected a file in", "gone.jpg", "expected one that begins with https://", "1 panorama without a usable id"]:
            self.assertIn(why, done.stderr)
        rows = self.table()
        self.assertEqual([row["file"] for row in rows], [f"panoramas/stac-{self.server.items[0]['id']}.jpg", "panoramas/stac-two.jpg"])
        self.assertEqual([rows[1][c] for c in ["heading_deg", "source", "licence", "attribution"]], ["92.0000", "stac", "CC-BY-SA-4.0", 'Ann "the" Walker, CC-BY-SA-4.0'])
        self.assertEqual(content(f"{self.site}/panoramas/stac-two.jpg"), self.panorama)
        write(two)  # one item
        self.assertIn("1 panorama:", self.import_file("--from", path, "--near", f"{NEAR[0]},{NEAR[1]}", "--list").stdout)
        for document, why in [("[" * 100000, "expected a JSON object"), ({"type": "FeatureCollection", "features": 3}, "expected a STAC Item"), ({"type": "Topology"}, "found 'Topology'")]:
            write(document)
            self.assertIn(why, self.import_file("--from", path, "--as", "stac", expect=1).stderr)
        self.assertIn("--from stac: expected a STAC file", self.import_file("--from", "stac", expect=2).stderr)

    def test_a_server_that_cannot_be_reached_is_one_clear_message(self):
        for url, why in [("http://127.0.0.1:9/api", "cannot be reached"), ("ftp://127.0.0.1/api", "expected an address that begins with https://"),
                         ("http://192.0.2.1/api", "expected an address that begins with https://")]:
            done = self.run_import(url=url, expect=2 if "expected" in why else 1)
            self.assertIn(why, done.stderr)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1)
        self.assertFalse(os.path.exists(self.site))

    def test_through_a_proxy(self):
        self.add(1)
        self.run_import("--list", url="http://127.0.0.1:9/api", http_proxy=self.server.url)
        self.assertTrue(self.server.log[0][0].startswith("http://127.0.0.1:9/api/search?bbox="))

    @unittest.skipUnless(shutil.which("openssl"), "openssl makes the certificate")
    def test_a_certificate_that_nobody_vouches_for_is_refused(self):
        pem = os.path.join(self.folder, "server.pem")
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", pem, "-out", pem + ".crt", "-days", "1", "-subj", "/CN=127.0.0.1"],
                       capture_output=True, check=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(pem + ".crt", pem)
        self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        done = self.run_import("--list", url=self.server.url.replace("http:", "https:") + "/api", expect=1)
        self.assertRegex(done.stderr, "certificate")
        self.assertEqual(self.server.log, [])

    def test_along_a_run(self):
        self.add(1)
        self.server.items += [item(self.server, 1, 200), item(self.server, 2, 200, geometry={"type": "Point", "coordinates": [NEAR[1] + 200 / 74500, NEAR[0] + 100 / 111000]})]
        self.server.pictures.update({"/files/1.jpg": self.panorama, "/files/2.jpg": self.panorama})
        run = f"{self.site}/runs/walk"
        os.makedirs(f"{run}/images")
        for number in range(3):
            shutil.copy(f"{SOURCE}/datasets/parking_lot/runs/run1/images/000000.jpg", f"{run}/images/{number:06d}.jpg")
        shutil.copy(f"{SOURCE}/datasets/parking_lot/runs/run1/camchain.yaml", run)
        with open(f"{run}/gps.csv", "w", encoding="utf-8") as gps:
            gps.write("timestamp_s,latitude_deg,longitude_deg,sigma_h_m\n" + "".join(f"{i},{NEAR[0]},{NEAR[1] + i / 74500},2\n" for i in range(0, 201, 5)))
        listed = json.loads(self.run_import("--along", "walk", "--radius", "20", "--list", "--json").stdout)["panoramas"]
        self.assertEqual([p["id"][-1] for p in listed], ["0", "1"])

    def graph(self, number, **more):
        return {"id": str(number), "captured_at": 1_700_000_000_000, "is_pano": True, "camera_type": "spherical", "width": 4096, "height": 2048, "compass_angle": 10.5,
                "creator": {"username": "mappy", "id": "1"}, "geometry": {"type": "Point", "coordinates": [NEAR[1], NEAR[0]]}, **more}

    # World (east, north, up) to camera (right, down, forward): heading 200.25, pitch 2, roll -1.5 deg.
    TURN = [0.327714996, 1.984940459, -2.045878282]

    def test_mapillary(self):
        self.server.items = [{"graph": g} for g in [
            self.graph(1, computed_geometry={"type": "Point", "coordinates": [NEAR[1] + 1e-5, NEAR[0]]}, computed_compass_angle=200.25, computed_rotation=self.TURN), self.graph(2),
            self.graph(3, is_pano=False), self.graph(4, compass_angle=-1),
            self.graph(5, computed_geometry={"type": "Point", "coordinates": [NEAR[1], NEAR[0]]}, computed_compass_angle=150, computed_rotation=self.TURN)]]
        store = Server()
        self.addCleanup(store.server_close)
        self.addCleanup(store.shutdown)
        store.pictures = {f"/signed/{n}.jpg": self.panorama for n in range(6)}
        self.server.files_url = store.url
        self.assertIn("needs a token: set MAPILLARY_ACCESS_TOKEN", self.run_import(service="mapillary", expect=1).stderr)
        self.run_import(service="mapillary", MAPILLARY_ACCESS_TOKEN=TOKEN)
        rows = self.table()
        self.assertEqual([row["file"] for row in rows], [f"panoramas/mapillary-{n}.jpg" for n in (1, 2, 4, 5)])
        self.assertEqual([row["heading_deg"] for row in rows], ["200.2500", "10.5000", "", "150.0000"])
        # A tilt whose heading is not the computed one has other axes.
        self.assertEqual([(row["pitch_deg"], row["roll_deg"]) for row in rows], [("2.0000", "-1.5000"), ("", ""), ("", ""), ("", "")])
        self.assertAlmostEqual(float(rows[0]["longitude_deg"]), NEAR[1] + 1e-5, 8)
        self.assertEqual(rows[0]["captured_at"], "2023-11-14T22:13:20Z")
        self.assertEqual(rows[0]["attribution"], "mappy, Mapillary, CC-BY-SA-4.0")
        # The token goes to the service, and to nobody else.
        self.assertTrue(all("Authorization" in headers for path, headers in self.server.log[1:]))
        self.assertEqual(len(store.log), 4)
        self.assertFalse(any("Authorization" in headers or TOKEN in path for path, headers in store.log))
        for folder, _, files in os.walk(self.site):
            for name in files:
                with open(os.path.join(folder, name), "rb") as content:
                    self.assertNotIn(b"a-secret", content.read())
        # An expired one is refused in words that do not show it.
        self.server.token = "another"
        self.assertIn("the token is missing, wrong or expired", self.run_import("--list", service="mapillary", expect=1, MAPILLARY_ACCESS_TOKEN=TOKEN).stderr)

    def test_kartaview(self):
        def photo(number, **more):
            return {"id": str(number), "lat": str(NEAR[0]), "lng": str(NEAR[1] + number / 74500), "heading": "33.5", "shotDate": "2021-06-07 12:34:56", "projection": "SPHERE",
                    "width": "5760", "height": "2880", "fileurl": f"{self.server.url}/store/{{{{sizeprefix}}}}/{number}.jpg", **more}
        self.server.items = [photo(1), photo(2, heading="-1", fileurlProc=f"{self.server.url}/store/blurred/2.jpg"), photo(3, projection="PLANE"), photo(4, lat="x"), photo(5)]
        self.server.pictures = {"/store/proc/1.jpg": self.panorama, "/store/blurred/2.jpg": self.panorama, "/store/proc/5.jpg": self.panorama}
        self.server.page_size = 2
        done = self.run_import(service="kartaview")
        self.assertIn("1 panorama without a usable id, position or file", done.stderr)
        rows = self.table()
        self.assertEqual([row["file"] for row in rows], [f"panoramas/kartaview-{n}.jpg" for n in (1, 2, 5)])
        self.assertEqual([rows[0][c] for c in ["heading_deg", "captured_at", "sigma_h_m", "licence"]], ["33.5000", "2021-06-07T12:34:56", "5.000", "CC-BY-SA-4.0"])
        self.assertEqual([rows[1]["heading_deg"], rows[1]["attribution"]], ["", "(c) Grab and KartaView Contributors, CC-BY-SA-4.0"])
        self.assertEqual(len(self.server.paths("/karta/")), 3)
        # A place without pictures is not an error.
        self.server.faults["/karta/2.0/photo/"] = [(200, json.dumps({"status": {"apiCode": "601", "apiMessage": "The request has an empty response"}}).encode(), [])]
        self.assertIn("no panorama lies within", self.run_import("--list", service="kartaview", expect=1).stderr)
        for answer in [{"result": {}}, {"data": []}, {"result": []}]:
            self.server.faults["/karta/2.0/photo/"] = [(200, json.dumps(answer).encode(), [])]
            self.assertIn('expected a list "data"', self.run_import("--list", service="kartaview", expect=1).stderr)

    def google(self, name, east_m=0.0, **more):
        return {"panoId": name, "lat": NEAR[0], "lng": NEAR[1] + east_m / 74500, "imageWidth": 3328, "imageHeight": 1664, "tileWidth": 512, "tileHeight": 512, "heading": 94.5, "tilt": 88.5,
                "roll": 0.25, "date": "2023-06", "copyright": "\u00a9 2023 Google", "imageryType": "outdoor", "links": [], **more}

    def serve_google(self, *items):
        """Each level is half as wide as the next; the last column is filled up with black."""
        self.server.items = list(items)
        self.sphere = Image.open(io.BytesIO(self.panorama)).convert("RGB")
        for zoom in range(3, 6):
            width = -(-3328 // 2 ** (5 - zoom))
            level, self.server.tiles[zoom] = self.sphere.resize((width, width // 2)), {}
            for x in range(-(-width // 512)):
                for y in range(-(-width // 1024)):
                    data = io.BytesIO()
                    level.crop((512 * x, 512 * y, 512 * x + 512, 512 * y + 512)).save(data, "JPEG", quality=95)
                    self.server.tiles[zoom][x, y] = data.getvalue()

    def run_google(self, *more, **options):
        return self.run_import("--permitted", *([] if "--width" in more else ["--width", "1664"]), "--radius", "60", *more, service="google", GOOGLE_MAPS_API_KEY=KEY, **options)

    def assert_no_secret(self, *texts):
        for text in texts:
            self.assertNotIn("a-secret", text)
        for folder, _, files in os.walk(self.site):
            for name in files:
                self.assertNotIn(b"a-secret", content(os.path.join(folder, name)))

    def test_google_needs_a_key_and_a_permission(self):
        self.serve_google(self.google("-A_1"))
        self.assertIn("needs a token: set GOOGLE_MAPS_API_KEY", self.run_import("--permitted", service="google", expect=1).stderr)
        refused = self.run_import(service="google", GOOGLE_MAPS_API_KEY=KEY, expect=2).stderr
        self.assertIn("forbid image analysis and machine interpretation", refused)
        self.assertEqual(self.server.log, [])
        listed = json.loads(self.run_import("--list", "--json", service="google", GOOGLE_MAPS_API_KEY=KEY).stdout)["panoramas"]
        self.assertEqual([(p["id"], p["captured_at"], p["attribution"]) for p in listed], [("-A_1", "2023-06", "\u00a9 2023 Google, Google Maps")])
        self.assertFalse(os.path.exists(self.site))
        wrong = self.run_import("--list", service="google", GOOGLE_MAPS_API_KEY="AIza-other", expect=1).stderr
        self.assertRegex(wrong, "createSession answers with status 400; is the key valid")
        self.assert_no_secret(refused, wrong)
        self.assertNotIn("AIza-other", wrong)

    def test_google_is_kept_for_the_session_only(self):
        # b is the nearest of no place that is asked for: it is found as a neighbour. c is a part, d is gone.
        self.serve_google(self.google("a", links=[{"panoId": "b"}, {"panoId": "d"}, {"panoId": 7}]), self.google("b", 30, hidden=True, heading=None, date="2019-01"),
                          self.google("c", 55, imageHeight=1200))
        begin = time.time()
        done = self.run_google()
        rows = self.table()
        self.assertEqual([row["file"] for row in rows], ["panoramas/google-a.jpg", "panoramas/google-b.jpg"])
        self.assertEqual([rows[0][c] for c in ["heading_deg", "pitch_deg", "roll_deg", "sigma_h_m", "captured_at"]], ["94.5000", "-1.5000", "0.2500", "2.000", "2023-06"])
        self.assertEqual(rows[1]["heading_deg"], "")
        self.assertIn("2 panoramas without a usable id, position or file", done.stderr)
        self.assertIn("its terms forbid to keep pictures and positions", done.stderr)
        picture = Image.open(f"{self.site}/panoramas/google-a.jpg")
        self.assertEqual(picture.size, (1664, 832))
        apart = [abs(a - b) for a, b in zip(picture.resize((104, 52)).convert("L").getdata(), self.sphere.resize((104, 52)).convert("L").getdata())]
        self.assertLess(sum(apart) / len(apart), 3)
        self.assertFalse(any("/tiles/5/" in path for path, _ in self.server.log))  # no level is wider than needed
        until = time.mktime(time.strptime(rows[0]["keep_until"], "%Y-%m-%dT%H:%M:%SZ")) - time.timezone
        self.assertAlmostEqual(until - begin, 3600, delta=60)
        self.assert_no_secret(done.stdout, done.stderr)
        # After its end the next command forgets it, the old tables too.
        shutil.copy(f"{SOURCE}/datasets/parking_lot/panoramas/pano_057.jpg", f"{self.site}/panoramas/own.jpg")
        with open(f"{self.site}/panoramas.csv", encoding="utf-8") as table:
            text = table.read()
        with open(f"{self.site}/panoramas.csv", "w", encoding="utf-8") as table:
            table.write(re.sub(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", "2024-01-01T00:00:00Z", text) + "panoramas/own.jpg" + "," * (len(text.splitlines()[1].split(",")) - 1) + "\n")
        os.makedirs(f"{self.site}/results/replaced", exist_ok=True)
        shutil.copy(f"{self.site}/panoramas.csv", f"{self.site}/results/replaced/2024-panoramas.csv")
        before = content(f"{self.site}/panoramas.csv")
        done = subprocess.run([PROGRAM, "status", self.site], capture_output=True, text=True, check=False)
        self.assertIn("its source allows to keep it until", done.stdout + done.stderr)
        self.assertEqual(content(f"{self.site}/panoramas.csv"), before)
        self.assertTrue(os.path.exists(f"{self.site}/panoramas/google-a.jpg"))
        done = subprocess.run([PROGRAM, "run", self.site], capture_output=True, text=True, check=False)
        self.assertIn("2 panoramas were deleted: their source forbids to keep them longer", done.stdout + done.stderr)
        self.assertEqual([row["file"] for row in self.table()], ["panoramas/own.jpg"])
        self.assertEqual(sorted(os.listdir(f"{self.site}/panoramas")), ["own.jpg"])
        self.assertNotIn(b"google", content(f"{self.site}/results/replaced/2024-panoramas.csv"))

    def test_google_ends_sessions_and_forbids_to_store(self):
        self.serve_google(self.google("a"))
        self.server.faults = {"/google/streetview/metadata": [(401, b"{}", [])], "/google/streetview/tiles/4/1/0": [(403, b"{}", [])]}
        self.run_google()
        self.assertEqual(len(self.server.sessions), 3)
        self.assertEqual(len(self.table()), 1)
        shutil.rmtree(self.site)
        self.server.cache_control = "no-store"
        self.assertIn("the service forbids to store it", self.run_google(expect=1).stderr)
        self.server.cache_control = "private, max-age=3600"
        self.server.tiles[4][1, 0] = self.photo
        self.assertIn("tile 4/1/0 of panorama a: expected 512 x 512 px, found 960 x 600 px", self.run_google(expect=1).stderr)
        self.assertFalse(os.path.exists(f"{self.site}/panoramas/google-a.jpg"))

    def serve_two(self, service):
        """Two panoramas, 1 and 2; returns the path of a listing and that of the first one's picture."""
        at = {"type": "Point", "coordinates": [NEAR[1], NEAR[0]]}
        self.server.items, self.server.pictures = [], {f"/files/{n}.jpg": self.panorama for n in (1, 2)}
        if service == "panoramax":
            self.server.items = [item(self.server, n) for n in (1, 2)]
            return "/api/search", "/files/1.jpg"
        if service == "mapillary":
            self.server.items = [{"graph": self.graph(n, geometry=at)} for n in (1, 2)]
            self.server.pictures = {f"/signed/{n}.jpg": self.panorama for n in (1, 2)}
            return "/graph/images", "/signed/1.jpg"
        if service == "kartaview":
            self.server.items = [{"id": str(n), "lat": str(NEAR[0]), "lng": str(NEAR[1]), "projection": "SPHERE", "fileurlProc": f"{self.server.url}/files/{n}.jpg"} for n in (1, 2)]
            return "/karta/2.0/photo/", "/files/1.jpg"
        self.serve_google(self.google("1"), self.google("2", 30))
        return "/google/streetview/panoIds", "/google/streetview/tiles/4/0/0"

    def run_any(self, service, *more, **options):
        keys = {"mapillary": {"MAPILLARY_ACCESS_TOKEN": TOKEN}, "google": {"GOOGLE_MAPS_API_KEY": KEY}}.get(service, {})
        permitted = ["--permitted", "--width", "1664"] if service == "google" else []
        return self.run_import("--radius", "60", *permitted, *more, service=service, **keys, **options)

    def test_every_service_rides_out_what_servers_do(self):
        for service in PATHS:
            with self.subTest(service):
                listing, picture = self.serve_two(service)
                self.server.faults = {listing: [(429, b"", [("Retry-After", "0.1")]), (502, b"", [("Retry-After", "0")])], picture: [(503, b"", [("Retry-After", "0")])]}
                if service != "google":
                    self.server.faults[picture].append("cut")
                self.run_any(service)
                self.assertEqual(len(self.table()), 2)
                self.assertEqual(self.server.faults, {listing: [], picture: []})
                shutil.rmtree(self.site)

    def test_every_service_refuses_in_one_message(self):
        for service in PATHS:
            with self.subTest(service):
                listing, picture = self.serve_two(service)
                self.server.faults[listing] = [(500, b"", [("Retry-After", "0")])] * 5
                self.assertRegex(self.run_any(service, expect=1).stderr, r"^[^\n]*fails \(status 500\); try again later[^\n]*\n$")
                self.assertRegex(self.run_any(service, url="http://127.0.0.1:9" + PATHS[service], expect=1).stderr, r"^[^\n]*cannot be reached[^\n]*\n$")
                # A picture of another shape is left out, and named.
                self.server.faults, self.server.pictures[picture] = {}, self.photo
                if service == "google":
                    self.server.items[0]["tileWidth"] = self.server.items[0]["tileHeight"] = 256
                done = self.run_any(service)
                self.assertRegex(done.stderr, "found (960 x 600|512 x 512)")
                self.assertEqual(len(self.table()), 1)
                shutil.rmtree(self.site)

    def test_blurred_pictures_are_kept_as_they_came(self):
        self.add(1)
        blurred = io.BytesIO()
        Image.open(io.BytesIO(self.panorama)).filter(ImageFilter.GaussianBlur(12)).save(blurred, "JPEG")
        self.server.pictures["/files/0.jpg"] = blurred.getvalue()
        self.run_import()
        self.assertEqual(content(f"{self.site}/{self.table()[0]['file']}"), blurred.getvalue())

    def test_some_by_their_ids(self):
        self.add(3)
        ids = [i["id"] for i in self.server.items]
        self.run_import("--id", ids[2], "--id", ids[0])
        self.assertEqual([row["station"] for row in self.table()], [ids[0], ids[2]])
        self.assertIn("panorama nothing is not among the 3 that were found", self.run_import("--id", "nothing", expect=1).stderr)

    def test_the_season_of_the_run_is_preferred(self):
        run = f"{self.site}/runs/walk"
        os.makedirs(f"{run}/images")
        shutil.copy(f"{SOURCE}/datasets/parking_lot/runs/run1/images/000000.jpg", f"{run}/images/0.jpg")
        shutil.copy(f"{SOURCE}/datasets/parking_lot/runs/run1/camchain.yaml", run)
        for name, text in [("gps.csv", f"timestamp_s,latitude_deg,longitude_deg,sigma_h_m\n0,{NEAR[0]},{NEAR[1]},2\n"), ("run.yaml", "date: 2026-05-12\n")]:
            with open(f"{run}/{name}", "w", encoding="utf-8") as file:
                file.write(text)
        # The nearest of January, of May eight years ago, of last June; one of last May that is farther away than positions are known.
        for number, (east_m, date) in enumerate([(0.5, "2026-01-20"), (2, "2018-05-10"), (3, "2025-05-20"), (25, "2026-05-11")]):
            self.server.items.append(item(self.server, number, east_m, properties={"datetime": date + "T10:00:00Z"}))
            self.server.pictures[f"/files/{number}.jpg"] = self.panorama
        self.run_import("--along", "walk", "--limit", "2", "--radius", "60")
        self.assertEqual(sorted(row["captured_at"][:10] for row in self.table()), ["2018-05-10", "2025-05-20"])

    def test_two_thousand_are_listed_and_two_hundred_loaded_in_a_minute_of_cpu(self):
        large = io.BytesIO()
        Image.open(io.BytesIO(self.panorama)).resize((4096, 2048)).save(large, "JPEG", quality=92)
        for number in range(2000):
            self.server.items.append(item(self.server, number, 0.05 * number))
        self.server.pictures = {f"/files/{number}.jpg": large.getvalue() for number in range(2000)}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.assertIn("2000 panoramas:", self.run_import("--list").stdout)
        self.assertIn("200 of 200 panoramas", self.run_import("--limit", "200", "--width", "4096").stdout)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        print(f"2,000 listed, 200 of {len(large.getvalue()) / 1e6:.1f} MB loaded: {cpu_s:.1f} s of CPU", file=sys.stderr)
        self.assertLess(cpu_s, 60)

    def test_a_token_file_is_for_its_owner_alone(self):
        self.server.items = [{"graph": self.graph(1)}]
        path = os.path.join(self.folder, "token")
        with open(path, "w", encoding="utf-8") as token:
            token.write(TOKEN + "\n")
        os.chmod(path, 0o644)
        self.assertIn("chmod 600", self.run_import("--list", "--token-file", path, service="mapillary", expect=1).stderr)
        os.chmod(path, 0o600)
        self.run_import("--list", "--token-file", path, service="mapillary")


if __name__ == "__main__":
    PROGRAM, SOURCE = os.path.abspath(sys.argv.pop(1)), os.path.abspath(sys.argv.pop(1))
    unittest.main()
