#!/usr/bin/python3
"""Lays sets of tag detections out as projects and scores `trigpoint survey` on them.

  survey_sets.py TAGS_DIR OUT_DIR TRIGPOINT [building_227|aviary|triangle|field_2024]...

TAGS_DIR holds the sets as TagSLAM's test data has them (detections.csv, cameras.yaml, camera_poses.yaml, odometry.tum,
surveyed_tags.csv, tagslam.yaml) and the photographs of a competition field with its layout. One JSON object a set.
"""
import csv, json, pathlib, shutil, subprocess, sys
import numpy as np
import yaml


def rotation(w):
    a = np.linalg.norm(w)
    if a < 1e-12:
        return np.eye(3)
    k = np.array(w) / a
    x = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(a) * x + (1 - np.cos(a)) * x @ x


def pose(entry):
    t = np.eye(4)
    t[:3, :3] = rotation([entry["rotation"][k] for k in "xyz"])
    t[:3, 3] = [entry["position"][k] for k in "xyz"]
    return t


def rows(path):
    return list(csv.DictReader(l for l in open(path) if not l.startswith("#")))


def write_camchain(path, cameras):
    """cameras: name -> (entry of cameras.yaml, camera from body)"""
    chain = {}
    for name, (c, cam_from_body) in cameras.items():
        coefficients = list(c["distortion_coeffs"])
        chain[name] = {
            "camera_model": c["camera_model"],
            "intrinsics": list(map(float, c["intrinsics"])),
            "distortion_model": "radtan" if c["distortion_model"] == "plumb_bob" else c["distortion_model"],
            "distortion_coeffs": coefficients,
            "resolution": list(c["resolution"]),
            "T_cam_imu": [[float(v) for v in row] for row in cam_from_body],
        }
    path.write_text(yaml.safe_dump(chain, default_flow_style=None, sort_keys=False))


def write_detections(path, source):
    """Pixel centres of the detector lie at 0.5."""
    with open(path, "w") as f:
        f.write("timestamp,camera,tag_id,hamming,u0,v0,u1,v1,u2,v2,u3,v3,sigma_px\n")
        for r in rows(source):
            corners = ",".join("%.3f" % (float(r[k + str(i)]) - 0.5) for i in range(4) for k in "xy")
            f.write("%s,%s,%s,%s,%s,0.4\n" % (r["stamp"], r["cam"], r["id"], r["hamming"], corners))


def tagslam(source, out, control=()):
    """A project of one of TagSLAM's sets. Its body is what odometry moves, else the first camera."""
    shutil.rmtree(out, ignore_errors=True)
    run = out / "runs" / "run1"
    run.mkdir(parents=True)
    cameras = yaml.safe_load(open(source / "cameras.yaml"))
    poses = yaml.safe_load(open(source / "camera_poses.yaml"))
    settings = yaml.safe_load(open(source / "tagslam.yaml"))
    bodies = {k: v for b in settings["bodies"] for k, v in b.items()}
    rig_from_body = np.eye(4)
    moving = [b for b in bodies.values() if not b.get("is_static", True)]
    if moving and "T_body_odom" in moving[0]:
        rig_from_body = pose(moving[0]["T_body_odom"])
    chain = {}
    for name, c in cameras.items():
        chain[name] = (c, np.linalg.inv(pose(poses[name]["pose"])) @ rig_from_body)
    write_camchain(run / "camchain.yaml", chain)
    write_detections(run / "detections.csv", source / "detections.csv")
    if (source / "odometry.tum").exists():
        shutil.copy(source / "odometry.tum", run / "odometry.tum")
    sizes = [b["default_tag_size"] for b in bodies.values() if "default_tag_size" in b]
    (out / "tags.yaml").write_text("family: tag36h11\nsize_m: %g\n" % sizes[0])
    surveyed = rows(source / "surveyed_tags.csv")
    if len(surveyed) >= 3:
        with open(out / "control_points.csv", "w") as f:
            f.write("tag_id,x_m,y_m,z_m,sigma_h_m,sigma_v_m,role\n")
            for r in surveyed:
                role = "control" if int(r["id"]) in control else "check"
                f.write("%s,%s,%s,%s,0.02,0.02,%s\n" % (r["id"], r["x"], r["y"], r["z"], role))
    return bodies


def survey(trigpoint, out, *settings):
    command = [trigpoint, "survey", str(out), "--quiet"]
    for s in settings:
        command += ["--set", s]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError("%s: %s" % (" ".join(command), done.stderr[-2000:]))
    tags = {int(r["tag_id"]): r for r in rows(out / "results" / "survey" / "tags.csv")}
    return json.load(open(out / "results" / "survey" / "summary.json")), tags


def place(r):
    return np.array([float(r[k]) for k in "xyz"])


def fitted(a, b):
    """Distances after the least-squares rigid motion of a onto b."""
    a, b = np.array(a), np.array(b)
    ca, cb = a.mean(0), b.mean(0)
    u, _, vt = np.linalg.svd((a - ca).T @ (b - cb))
    d = np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))])
    return np.linalg.norm((a - ca) @ (vt.T @ d @ u.T).T + cb - b, axis=1)


def statistics(d):
    return {"n": len(d), "median_m": float(np.median(d)), "rmse_m": float(np.sqrt((d**2).mean())), "max_m": float(d.max())}


def building_227(source, out, trigpoint):
    folder = source / "building_227" / "all_tags_fixed_test11"
    truth = {int(r["id"]): place(r) for r in rows(folder / "surveyed_tags.csv")}
    result = {}
    tagslam(folder, out)
    summary, tags = survey(trigpoint, out, "datum=tag", "fixed_tag=6")
    common = [i for i in truth if i in tags and tags[i]["x"]]
    d = fitted([place(tags[i]) for i in common], [truth[i] for i in common])
    result["one_tag_fixed"] = dict(statistics(d), each={i: round(float(x), 3) for i, x in zip(common, d)},
                                   runs=summary["runs"])
    for control in ((3, 22, 61), (11, 51, 61)):
        tagslam(folder, out, control)
        summary, tags = survey(trigpoint, out)
        result["control_%d_%d_%d" % control] = dict(summary["check"], named=[w for w in summary["warnings"] if "point" in w])
    return result


def against_reference(source, out, trigpoint):
    """Tag-to-tag distances within the reference's bodies."""
    tagslam(source, out)
    summary, tags = survey(trigpoint, out)
    frames = {}
    for r in rows(source / "tagslam_reference_tags.csv"):
        frames.setdefault(r["frame"], {})[int(r["tag"])] = place(r)
    differences, fits = [], []
    for members in frames.values():
        ids = [i for i in members if i in tags and tags[i]["x"]]
        for k, i in enumerate(ids):
            for j in ids[k + 1:]:
                differences.append(abs(np.linalg.norm(place(tags[i]) - place(tags[j])) - np.linalg.norm(members[i] - members[j])))
        if len(ids) >= 3:
            fits += list(fitted([place(tags[i]) for i in ids], [members[i] for i in ids]))
    return {"tags": len(tags), "answered": sum(bool(t["x"]) for t in tags.values()),
            "distances": statistics(np.array(differences)), "after_fit": statistics(np.array(fits)), "runs": summary["runs"]}


def field_2024(source, out, trigpoint):
    shutil.rmtree(out, ignore_errors=True)
    run = out / "runs" / "stills"
    run.mkdir(parents=True)
    pictures = sorted(p.name for p in source.glob("*.jpg"))
    for p in pictures:
        shutil.copy(source / p, run / p)
    (run / "images.txt").write_text("".join("%d.0 %s\n" % (i + 1, p) for i, p in enumerate(pictures)))
    camera = {"camera_model": "pinhole", "distortion_model": "radtan", "resolution": [1280, 720],
              "intrinsics": [1130.5, 1129.6, 630.8, 333.0], "distortion_coeffs": [0.050, -0.314, -0.003, 0.0]}
    write_camchain(run / "camchain.yaml", {"cam0": (camera, np.eye(4))})
    (out / "tags.yaml").write_text("family: tag36h11\nsize_m: 0.1651\n")
    layout = {t["ID"]: np.array([t["pose"]["translation"][k] for k in "xyz"])
              for t in json.load(open(source / "2024-crescendo.json"))["tags"]}
    result = {}
    for name, settings in (("as_calibrated", ()), ("self_calibrated", ("self_calibrate=true",))):
        summary, tags = survey(trigpoint, out, *settings)
        ids = [i for i in layout if i in tags and tags[i]["x"]]
        pairs = {}
        for k, i in enumerate(ids):
            for j in ids[k + 1:]:
                pairs["%d-%d" % (i, j)] = round(float(np.linalg.norm(place(tags[i]) - place(tags[j])) -
                                                      np.linalg.norm(layout[i] - layout[j])), 3)
        d = np.abs(np.array(list(pairs.values())))
        result[name] = dict(statistics(d), tags=ids, differences=pairs)
    return result


def main():
    source, out, trigpoint = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]
    sets = sys.argv[4:] or ["building_227", "aviary", "triangle", "field_2024"]
    for name in sets:
        if name == "building_227":
            result = building_227(source, out / name, trigpoint)
        elif name == "field_2024":
            result = field_2024(source / name, out / name, trigpoint)
        else:
            result = against_reference(source / name, out / name, trigpoint)
        print(json.dumps({name: result}, indent=1))


if __name__ == "__main__":
    main()
