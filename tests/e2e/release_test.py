#!/usr/bin/env python3
"""Releases as a user makes, checks and repeats them.

    release_test.py PROGRAM
"""
import csv
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import survey_site

PROGRAM = ""
FOLDER = ""


def trigpoint(*arguments, expect=0):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == expect, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


class Release(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """One computed site, and one release of it, which the tests copy."""
        cls.made = os.path.join(FOLDER, "made")
        survey_site.write_site(cls.made)
        trigpoint("run", cls.made)
        trigpoint("publish", cls.made, "--name", "may")

    def setUp(self):
        self.site = os.path.join(FOLDER, self._testMethodName)
        shutil.copytree(self.made, self.site)
        self.release = f"{self.site}/releases/may"

    def edit(self, path, change):
        os.chmod(path, 0o644)
        text = change(read(path))
        os.remove(path)
        survey_site.write(path, text)

    def one_line(self, *arguments, expect=1):
        err = trigpoint(*arguments, expect=expect).stderr
        self.assertEqual(err.count("\n"), 1, err)
        return err

    def verify(self, expect):
        return json.loads(trigpoint("verify", self.release, "--json", expect=expect).stdout)

    def test_holds_all_that_it_was_computed_from(self):
        record = json.loads(read(f"{self.release}/release.json"))
        for file in ("trigpoint.yaml", "origin.json", "tags.yaml", "control_points.csv", "runs/monday/run.yaml",
                     "runs/monday/detections.csv", "runs/monday/odometry.tum", "runs/monday/camchain.yaml"):
            self.assertTrue(record["inputs"][file]["copied"], file)
            self.assertEqual(read(f"{self.release}/site/{file}"), read(f"{self.site}/{file}"))
        self.assertEqual(record["order"], ["detect/monday", "survey", "reference/monday"])
        for stage in record["order"]:
            self.assertIn("options", record["stages"][stage])
            self.assertTrue(record["stages"][stage]["files"], stage)
        self.assertRegex(record["program"]["trigpoint"], r"\d+\.\d+\.\d+")
        for library in ("Ceres", "Eigen", "OpenCV", "GeographicLib", "SQLite"):
            self.assertTrue(record["program"]["libraries"][library])
        for path, file in record["files"].items():
            self.assertEqual(os.path.getsize(f"{self.release}/{path}"), file["bytes"])

    def test_pictures_by_hash_unless_copied(self):
        # A picture that no stage reads does not belong in; one of a run does.
        survey_site.write(f"{self.site}/runs/monday/board.jpg", "a picture")
        trigpoint("run", self.site)
        by_hash = json.loads(trigpoint("publish", self.site, "--name", "june", "--json").stdout)
        self.assertEqual(by_hash["inputs_by_hash"], 1)
        self.assertFalse(os.path.exists(f"{self.site}/releases/june/site/runs/monday/board.jpg"))
        copied = json.loads(trigpoint("publish", self.site, "--name", "july", "--copy-inputs", "--json").stdout)
        self.assertEqual(copied["inputs_by_hash"], 0)
        self.assertEqual(read(f"{self.site}/releases/july/site/runs/monday/board.jpg"), "a picture")

    def test_refuses_pictures_that_must_not_be_kept(self):
        survey_site.write(f"{self.site}/panoramas/google-a.jpg", "a picture")
        survey_site.write(f"{self.site}/panoramas.csv", "file,latitude_deg,longitude_deg,source,keep_until\npanoramas/google-a.jpg,48.01,7.83,google,2999-01-01T00:00:00Z\n")
        self.assertIn("panoramas/google-a.jpg is from google, whose terms forbid to keep it", trigpoint("publish", self.site, "--name", "june", expect=1).stderr)
        self.assertFalse(os.path.exists(f"{self.site}/releases/june"))

    def test_a_site_of_two_families_and_sizes(self):
        # Tag 5 is one of tag16h5; what is read as tag36h11 with its number, and as tag16h5 with another, is none.
        self.edit(f"{self.site}/tags.yaml", lambda text: text + "families: {5: tag16h5}\nsizes_m: {5: 0.4}\n")
        self.edit(f"{self.site}/runs/monday/detections.csv", lambda text: "\n".join(
            line.replace("tag36h11,5,", "tag16h5,5,") + ("\n" + line + "\n" + line.replace("tag36h11,5,", "tag16h5,3,") if "tag36h11,5," in line else "") for line in text.splitlines()) + "\n")
        done = trigpoint("run", self.site)
        self.assertRegex(done.stdout + done.stderr, r"of \d+ detections are of family (tag36h11|tag16h5), tags.yaml has tag36h11,tag16h5:5; they are left out")
        rows = {row["tag_id"]: row for row in csv.DictReader(line for line in read(f"{self.site}/results/survey/tags.csv").splitlines() if not line.startswith("#"))}
        self.assertEqual({tag: row["family"] for tag, row in rows.items()}, {"0": "tag36h11", "1": "tag36h11", "2": "tag36h11", "3": "tag36h11", "4": "tag36h11", "5": "tag16h5"})
        before = {row["tag_id"]: row for row in csv.DictReader(line for line in read(f"{self.made}/results/survey/tags.csv").splitlines() if not line.startswith("#"))}
        self.assertEqual([rows["5"][k] for k in "xyz"], [before["5"][k] for k in "xyz"])

    def test_refuses_what_is_out_of_date(self):
        def refused(name):
            err = self.one_line("publish", self.site, "--name", "june")
            self.assertIn("up to date", err)
            self.assertIn(name, err)
            self.assertEqual(sorted(os.listdir(f"{self.site}/releases")), ["may"])
        # An input of the first stage, behind the map.
        self.edit(f"{self.site}/runs/monday/detections.csv", lambda t: t + "# new\n")
        refused("detect/monday: out of date")
        trigpoint("run", self.site)
        # An option in trigpoint.yaml.
        self.edit(f"{self.site}/trigpoint.yaml", lambda t: t + "stages: {survey: {tie_points: false}}\n")
        refused("survey: out of date")
        trigpoint("run", self.site)
        # A decision of the review.
        trigpoint("review", self.site, "exclude", "tag:5", "--reason", "moved")
        refused("survey: out of date")
        trigpoint("run", self.site)
        # A result that was edited.
        self.edit(f"{self.site}/results/reference/monday/poses.csv", lambda t: t + "\n")
        refused("reference/monday: out of date")
        trigpoint("run", self.site)
        # Only the report.
        self.edit(f"{self.site}/results/report/report.md", lambda t: t + "\n")
        refused("report: out of date")
        trigpoint("run", self.site)
        trigpoint("publish", self.site, "--name", "june")

    def test_options_of_the_command_line_are_the_results_own(self):
        trigpoint("survey", self.site, "--set", "tie_points=false")
        for behind in ("reference", "report"):
            shutil.rmtree(f"{self.site}/results/{behind}")
        trigpoint("publish", self.site, "--name", "june")
        given = json.loads(read(f"{self.site}/releases/june/release.json"))["stages"]["survey"]["given"]
        self.assertEqual(given, {"survey": {"tie_points": False}})
        # Behind them a change of trigpoint.yaml is seen.
        self.edit(f"{self.site}/trigpoint.yaml", lambda t: t + "stages: {survey: {stations: false}}\n")
        self.assertIn("survey: out of date", self.one_line("publish", self.site, "--name", "july"))

    def test_verify_names_what_differs(self):
        self.assertTrue(self.verify(0)["ok"])
        self.edit(f"{self.release}/map/tags.csv", lambda t: t.replace("10.", "10,", 1))
        self.edit(f"{self.release}/map/tags_cov.csv", lambda t: t + "\n")
        os.remove(f"{self.release}/site/tags.yaml")
        survey_site.write(f"{self.release}/map/extra.csv", "x\n")
        os.symlink("/etc/passwd", f"{self.release}/map/link.csv")
        found = self.verify(1)
        self.assertEqual([text.split(":")[0] for text in found["changed"]], ["map/tags.csv", "map/tags_cov.csv"])
        self.assertEqual(found["missing"], ["site/tags.yaml"])
        self.assertEqual(found["added"], ["map/extra.csv", "map/link.csv"])
        out = trigpoint("verify", self.release, expect=1).stdout
        self.assertIn("Missing   site/tags.yaml", out)
        # Nothing is held against a map that was changed.
        self.assertIn("missing", self.one_line("compare", self.release, self.site))

    def test_verify_notices_an_edited_record(self):
        self.edit(f"{self.release}/release.json", lambda t: t.replace('"six tags"', '"five tags"'))
        found = self.verify(1)
        self.assertTrue(found["record_changed"])
        self.assertEqual(found["changed"], [])

    def test_a_link_or_a_pipe_in_a_files_place_is_no_file(self):
        inside = f"{self.release}/map/tags.csv"
        shutil.copy(inside, f"{self.site}/copy.csv")
        os.remove(inside)
        os.symlink(f"{self.site}/copy.csv", inside)
        self.assertIn("map/tags.csv: expected a file, found a link", self.verify(1)["changed"][0])
        os.remove(inside)
        os.mkfifo(inside)  # opening it would wait for ever
        self.assertIn("map/tags.csv: expected a file", self.verify(1)["changed"][0])
        os.remove(inside)
        shutil.move(f"{self.release}/map", f"{self.site}/map")
        os.symlink(f"{self.site}/map", f"{self.release}/map")
        self.assertTrue(any(text.startswith("map/tags_cov.csv") for text in self.verify(1)["changed"]))

    def test_a_huge_file_is_not_read(self):
        inside = f"{self.release}/map/tags.csv"
        os.chmod(inside, 0o644)
        os.truncate(inside, 1 << 40)  # sparse: it would take hours to hash
        self.assertIn("found 1099511627776", self.verify(1)["changed"][0])

    def test_hostile_records_are_one_message(self):
        path = f"{self.release}/release.json"
        good = json.loads(read(path))
        sha = "0" * 64
        for name, files in {"../../outside.txt": sha, "/etc/passwd": sha, "map/../../x": sha, "a//b": sha, "": sha,
                            "a\u0007b": sha, "x" * 5000: sha}.items():
            self.edit(path, lambda _, n=name, f=files: json.dumps({**good, "files": {n: f}}))
            self.assertIn("leaves the release", self.one_line("verify", self.release))
            self.assertIn("leaves the release", self.one_line("compare", self.release, self.site))
        for text, expected in {"": "expected a JSON object", "{": "expected a JSON object", "[" * 100000: "JSON object",
                               "[]": "expected a JSON object", "{}": "expected schema",
                               '{"schema": "trigpoint release 9"}': "expected schema",
                               json.dumps({**good, "files": []}): "the list 'files'",
                               json.dumps({**good, "files": {"a": 1}}): "expected a SHA-256",
                               json.dumps({**good, "files": {"a": {"sha256": sha, "bytes": -1}}}): "sha256 and bytes",
                               json.dumps({**good, "files": {"a": {"sha256": "z", "bytes": 1}}}): "SHA-256 of 64",
                               json.dumps({**good, "name": 5}): "'name'",
                               json.dumps({**good, "stages": 5}): "'stages'"}.items():
            self.edit(path, lambda _, t=text: t)
            self.assertIn(expected, self.one_line("verify", self.release))
        os.remove(path)
        os.symlink("/etc/passwd", path)
        self.assertIn("found a link", self.one_line("verify", self.release))
        os.remove(path)
        os.mkfifo(path)
        self.assertIn("regular file", self.one_line("verify", self.release))
        os.remove(path)
        survey_site.write(path, "")
        os.truncate(path, 1 << 40)
        self.assertIn("at most", self.one_line("verify", self.release))
        os.remove(path)
        self.assertIn("expected a release", self.one_line("verify", self.release))
        self.assertIn("expected a release", self.one_line("verify", f"{self.site}/nowhere"))

    def test_certificate_states_check_points_and_limits(self):
        trigpoint("publish", self.site, "--name", "june", "--author", "A. Surveyor <ÖbVI>", "--instrument", "TS 1\"")
        release = f"{self.site}/releases/june"
        page = json.loads(read(f"{release}/certificate.json"))
        survey = json.loads(read(f"{release}/map/summary.json"))
        self.assertEqual(page["check_points"]["n"], 2)
        self.assertEqual(page["check_points"]["rmse_3d_m"], survey["check"]["rmse_3d_m"])
        self.assertEqual(page["parties"]["Responsible"], "A. Surveyor <ÖbVI>")
        self.assertEqual(page["parties"]["Dates of the runs"], "2026-05-12")
        self.assertEqual(page["systems"]["Epoch of the control"], "not stated")
        self.assertEqual(page["systems"]["Datum of the map"], "control")
        limits = " ".join(page["limits"])
        self.assertIn("tested at 2 check points only", limits)
        self.assertIn("epoch of the control is not stated", limits)
        html = read(f"{release}/certificate.html")
        self.assertIn("A. Surveyor &lt;ÖbVI&gt;", html)
        self.assertIn(f"in space {survey['check']['rmse_3d_m']:.3f} m", html)
        with open(f"{release}/certificate.pdf", "rb") as pdf:
            self.assertTrue(pdf.read(5) == b"%PDF-")

    @unittest.skipUnless(shutil.which("pdftotext"), "no pdftotext")
    def test_every_number_of_the_pdf_is_in_a_csv(self):
        trigpoint("report", self.site, "--pdf")
        report = f"{self.site}/results/report"
        text = subprocess.run(["pdftotext", "-layout", f"{report}/report.pdf", "-"], capture_output=True, text=True, check=True).stdout
        # The last line of each page has its number.
        paper = "\n".join(page.rstrip().rpartition("\n")[0] for page in text.split("\f"))

        def numbers(words):
            return set(re.findall(r"""(?:(?<=[\s,;:("'>])|^)-?\d+(?:\.\d+)?(?=$|[\s,;:)"'<%]|\.(?:[\s"]|$))""", words))

        def all_of(folder, extension):
            return numbers("\n".join(read(f"{folder}/{name}") for name in os.listdir(folder) if name.endswith(extension)))

        stated, axes = all_of(f"{report}/tables", ".csv"), all_of(f"{report}/figures", ".svg")
        self.assertEqual(numbers(paper) - stated - axes, set())
        self.assertGreater(len(numbers(paper) & stated), 100)

    def test_certificate_states_systems_epochs_and_gates(self):
        header = "tag_id,role,x_m,y_m,z_m,crs,easting_m,northing_m,height_m,latitude_deg,longitude_deg,sigma_h_m,sigma_v_m,epoch"
        rows = [row.split(",") for row in survey_site.control_rows()]
        table = [f"{tag},{role},,,,EPSG:4326,{lon},{lat},{h},,,{sh},{sv},2024.5" for tag, role, lat, lon, h, sh, sv in rows]
        # The first point as it was two years before, 10 cm lower; the second, where it is.
        tag, role, lat, lon, h, sh, sv = rows[0]
        table.append(f"{tag},{role},,,,EPSG:4326,{lon},{lat},{float(h) - 0.1:.4f},,,{sh},{sv},2022-07-01")
        tag, role, lat, lon, h, sh, sv = rows[1]
        table.append(f"{tag},{role},,,,EPSG:4326,{lon},{lat},{h},,,{sh},{sv},2022-07-01")
        self.edit(f"{self.site}/control_points.csv", lambda _: header + "\n" + "\n".join(table) + "\n")
        self.edit(f"{self.site}/trigpoint.yaml",
                  lambda t: t + "gates: {survey: {min_check_points: 3, max_tag_sigma_m: 0.05}}\n")
        done = trigpoint("run", self.site, expect=3)
        self.assertIn("its coordinates of epoch 2022-07-01 are 0.100 m from those of epoch 2024.5", done.stderr)
        survey = json.loads(read(f"{self.site}/results/survey/summary.json"))
        self.assertEqual([(d["point"], d["moved"]) for d in survey["control"]["epoch_differences"]], [("0", True), ("1", False)])
        # The map is as without the earlier rows: nothing is averaged.
        before = json.loads(read(f"{self.release}/map/summary.json"))
        for now, then in zip(survey["points"], before["points"]):
            for a, b in zip(now["map_minus_stated_m"], then["map_minus_stated_m"]):
                self.assertAlmostEqual(a, b, 4)
        trigpoint("publish", self.site, "--name", "june")
        page = json.loads(read(f"{self.site}/releases/june/certificate.json"))
        self.assertIn("EPSG:4326", page["systems"]["System of the control as given"])
        self.assertEqual(page["systems"]["Epoch of the control"], "2022-07-01, 2024.5")
        self.assertIn("largest 0.100 m, 1 beyond", page["systems"]["Epochs compared"])
        self.assertEqual({g["name"]: g["verdict"] for g in page["gates"]["gates"]},
                         {"min_check_points": "failed", "max_tag_sigma_m": "passed"})
        self.assertIn("A quality gate was not passed", " ".join(page["limits"]))
        self.assertIn("Quality gates", read(f"{self.site}/releases/june/certificate.html"))
        trigpoint("verify", f"{self.site}/releases/june")
        trigpoint("rerun", f"{self.site}/releases/june")

    def test_certificate_without_check_points_claims_nothing(self):
        header = read(f"{self.site}/control_points.csv").split("\n")[0]
        rows = survey_site.control_rows(lambda i: "control")
        self.edit(f"{self.site}/control_points.csv", lambda _: header + "\n" + "\n".join(rows) + "\n")
        trigpoint("run", self.site)
        trigpoint("publish", self.site, "--name", "june")
        page = json.loads(read(f"{self.site}/releases/june/certificate.json"))
        self.assertEqual(page["check_points"]["n"], 0)
        self.assertNotIn("rmse_3d_m", page["check_points"])
        self.assertIn("must not be stated as tested", " ".join(page["limits"]))
        html = read(f"{self.site}/releases/june/certificate.html")
        self.assertIn("was not tested", html)
        self.assertNotIn("RMSE", html)

    def ssh_key(self, name):
        key = f"{self.site}/{name}"
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", f"{name}@example.org", "-f", key], check=True)
        return key

    @unittest.skipUnless(shutil.which("ssh-keygen"), "ssh-keygen is not installed")
    def test_signed_with_an_ssh_key(self):
        anna, bert = self.ssh_key("anna"), self.ssh_key("bert")
        trigpoint("publish", self.site, "--name", "june", "--sign", anna)
        self.release = f"{self.site}/releases/june"
        signature = self.verify(0)["signature"]
        self.assertEqual((signature["state"], signature["trusted"]), ("holds", False))
        self.assertIn("SHA256:", signature["key"])
        named = json.loads(trigpoint("verify", self.release, "--json", "--signers", anna + ".pub").stdout)["signature"]
        self.assertEqual((named["signer"], named["trusted"]), ("anna@example.org", True))
        survey_site.write(f"{self.site}/allowed", "office@example.org " + read(anna + ".pub"))
        listed = json.loads(trigpoint("verify", self.release, "--json", "--signers", f"{self.site}/allowed").stdout)
        self.assertEqual(listed["signature"]["signer"], "office@example.org")
        other = json.loads(trigpoint("verify", self.release, "--json", "--signers", bert + ".pub", expect=1).stdout)
        self.assertEqual(other["signature"]["state"], "broken")
        # A record that was written anew, with hashes that fit, is not what was signed.
        record = json.loads(read(f"{self.release}/release.json"))
        record["project"] = "five tags"
        self.edit(f"{self.release}/release.json", lambda _: json.dumps(record))
        self.assertEqual(self.verify(1)["signature"]["state"], "broken")
        # An unsigned release does not pass where a signature is asked for.
        self.assertIn("not signed", trigpoint("verify", f"{self.site}/releases/may").stdout)
        trigpoint("verify", f"{self.site}/releases/may", "--signers", anna + ".pub", expect=1)

    @unittest.skipUnless(shutil.which("ssh-keygen"), "ssh-keygen is not installed")
    def test_a_signature_that_was_taken_away_is_missed(self):
        trigpoint("publish", self.site, "--name", "june", "--sign", self.ssh_key("anna"))
        self.release = f"{self.site}/releases/june"
        os.remove(f"{self.release}/release.json.sig")
        self.assertEqual(self.verify(1)["missing"], ["release.json.sig"])
        survey_site.write(f"{self.release}/release.json.sig", "-----BEGIN SSH SIGNATURE-----\nAAAA\n")
        self.assertEqual(self.verify(1)["signature"]["state"], "broken")

    @unittest.skipUnless(shutil.which("gpg"), "gpg is not installed")
    def test_signed_with_a_gpg_key(self):
        home = f"{FOLDER}/g"  # short: its socket's path has a limit
        os.makedirs(home, mode=0o700)
        self.addCleanup(lambda: subprocess.run(["gpgconf", "--homedir", home, "--kill", "all"], check=False))
        os.environ["GNUPGHOME"] = home
        self.addCleanup(lambda: os.environ.pop("GNUPGHOME"))
        subprocess.run(["gpg", "--batch", "--quiet", "--passphrase", "", "--quick-generate-key", "anna@example.org",
                        "ed25519", "sign"], check=True, capture_output=True)
        trigpoint("publish", self.site, "--name", "june", "--sign", "gpg:anna@example.org")
        self.release = f"{self.site}/releases/june"
        signature = self.verify(0)["signature"]
        self.assertEqual((signature["state"], signature["signer"]), ("holds", "anna@example.org"))
        keys = subprocess.run(["gpg", "--export", "--armor"], check=True, capture_output=True, text=True).stdout
        survey_site.write(f"{self.site}/anna.asc", keys)
        trigpoint("verify", self.release, "--signers", f"{self.site}/anna.asc")
        record = json.loads(read(f"{self.release}/release.json"))
        self.edit(f"{self.release}/release.json", lambda _: json.dumps(record))
        self.assertEqual(self.verify(1)["signature"]["state"], "broken")

    def test_keys_that_are_not_there_publish_nothing(self):
        self.assertIn("no such file", self.one_line("publish", self.site, "--name", "june", "--sign", "nokey", expect=2))
        survey_site.write(f"{self.site}/notes.txt", "no key\n")
        self.assertIn("not signed and not published",
                      self.one_line("publish", self.site, "--name", "june", "--sign", f"{self.site}/notes.txt"))
        self.assertEqual(os.listdir(f"{self.site}/releases"), ["may"])

    def rerun(self, *more, expect=0):
        return json.loads(trigpoint("rerun", self.release, "--json", *more, expect=expect).stdout)

    def test_rerun_gives_the_same_bytes(self):
        survey_site.write(f"{self.site}/runs/monday/board.jpg", "a picture")
        trigpoint("run", self.site)
        trigpoint("publish", self.site, "--name", "june")
        self.release = f"{self.site}/releases/june"
        again = self.rerun("--threads", "2")
        self.assertTrue(again["same_bytes"], again["differences"])
        self.assertEqual(again["results"], ["detect/monday", "survey", "reference/monday"])
        self.assertEqual(again["notes"], [])
        # The project may have gone on, or be somewhere else: the release holds its own.
        self.edit(f"{self.site}/control_points.csv", lambda t: t.replace("48.", "49."))
        self.assertTrue(self.rerun()["same_bytes"])
        # What it has by hash alone must be there, unchanged.
        shutil.move(self.release, f"{self.site}/alone")
        self.release = f"{self.site}/alone"
        self.assertIn("board.jpg is not there", self.one_line("rerun", self.release))
        kept = self.rerun("--inputs", self.site, "--out", f"{self.site}/kept")
        self.assertTrue(kept["same_bytes"])
        self.assertTrue(os.path.exists(f"{self.site}/kept/results/survey/tags.csv"))
        self.assertIn("empty folder", self.one_line("rerun", self.release, "--inputs", self.site, "--out", f"{self.site}/kept"))
        survey_site.write(f"{self.site}/runs/monday/board.jpg", "another picture")
        self.assertIn("board.jpg was changed", self.one_line("rerun", self.release, "--inputs", self.site))

    def forge(self, change):
        """Writes the record anew, with a hash of its own that fits."""
        record = json.loads(read(f"{self.release}/release.json"))
        change(record)
        record.pop("sha256")
        text = json.dumps(record, separators=(",", ":"), sort_keys=True, ensure_ascii=False)
        record["sha256"] = hashlib.sha256(text.encode()).hexdigest()
        self.edit(f"{self.release}/release.json", lambda _: json.dumps(record))

    def test_rerun_of_pictures_gives_the_same_bytes(self):
        """The example site with every third image of one run; its features, reconstruction and answers, in two modes."""
        source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../datasets/parking_lot")
        site = os.path.join(FOLDER, "pictures")
        for path in ("panoramas", "panoramas.csv", "origin.json", "tags.yaml", "control_points.csv", "runs/run1"):
            copy = shutil.copytree if os.path.isdir(f"{source}/{path}") else shutil.copy
            os.makedirs(os.path.dirname(f"{site}/{path}"), exist_ok=True)
            copy(f"{source}/{path}", f"{site}/{path}")
        rows = read(f"{site}/runs/run1/images.txt").splitlines(keepends=True)
        survey_site.write(f"{site}/runs/run1/images.txt", "".join(rows[::3]))
        few = "{images: {max_features: 600}, references: {max_features: 600}, views: {size_px: 512}}"
        survey_site.write(f"{site}/trigpoint.yaml",
                          f"schema: 1\nname: pictures\nstages: {{features: {few}, references: {few}}}\n"
                          "variants: {paper: {}}\n")
        trigpoint("survey", site)
        for more in ([], ["--mode", "paper"]):
            trigpoint("localize", site, *more)
        trigpoint("publish", site, "--name", "may")
        again = json.loads(trigpoint("rerun", f"{site}/releases/may", "--json").stdout)
        self.assertTrue(again["same_bytes"])
        self.assertIn("reconstruct/run1", again["results"])

    def test_rerun_says_by_how_much(self):
        # A map that another machine would have made: one coordinate differs by a millimetre.
        path = f"{self.release}/map/tags.csv"
        self.edit(path, lambda t: t.replace("2.500345", "2.501345"))
        data = read(path)
        def change(record):
            digest = hashlib.sha256(data.encode()).hexdigest()
            record["files"]["map/tags.csv"]["sha256"] = record["stages"]["survey"]["files"]["tags.csv"] = digest
        self.forge(change)
        again = self.rerun(expect=1)
        self.assertEqual([(d["result"], d["file"]) for d in again["differences"]], [("survey", "tags.csv")])
        self.assertAlmostEqual(again["differences"][0]["columns"]["y"], 0.001, places=9)
        self.assertIn("in column y in line 3", again["differences"][0]["text"])
        self.rerun("--tolerance", "0.0011")
        self.rerun("--tolerance", "0.0009", expect=1)

    def test_rerun_of_hostile_records_is_one_message(self):
        for change, expected in (
                (lambda r: r["inputs"].update({"../x": r["inputs"]["tags.yaml"]}), "leaves the project"),
                (lambda r: r["inputs"].update({"x": 5}), "expected sha256, bytes and copied"),
                (lambda r: r["inputs"].update({"x.csv": r["inputs"]["tags.yaml"]}), "is not the input"),
                (lambda r: r["order"].append("nothing"), "names no result"),
                (lambda r: r["stages"]["survey"].update(name="@../../x"), "folder's name"),
                (lambda r: r["stages"]["survey"].update(options={"x": 1}), "'x'"),
                (lambda r: r["stages"]["survey"].update(files=[]), "expected its files"),
                (lambda r: r["stages"]["survey"].update(stage="delete"), "unknown stage 'delete'"),
                (lambda r: r["stages"]["detect/monday"].update(name="../../x"), "no folder's"),
                (lambda r: r.pop("inputs"), "earlier version")):
            shutil.rmtree(self.release)
            shutil.copytree(f"{self.made}/releases/may", self.release)
            self.forge(change)
            done = subprocess.run([PROGRAM, "rerun", self.release], capture_output=True, text=True, check=False)
            self.assertIn(done.returncode, (1, 2))
            self.assertIn(expected, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        shutil.rmtree(self.release)
        shutil.copytree(f"{self.made}/releases/may", self.release)
        self.edit(f"{self.release}/map/tags.csv", lambda t: t + "\n")
        self.assertIn("not as it was published", self.one_line("rerun", self.release))

    def test_names_that_cannot_be_a_releases(self):
        for name in ("", "..", ".x", "a/b", "self", "control", "survey"):
            trigpoint("publish", self.site, "--name", name, expect=2)
        self.assertIn("never overwritten", self.one_line("publish", self.site, "--name", "may"))


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    with tempfile.TemporaryDirectory(prefix="trigpoint_release_") as FOLDER:
        unittest.main(verbosity=1)
