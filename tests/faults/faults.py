"""The table of faults: each a small change of a good project, as people make them.

A fault has a name, what it touches, the change, and words (a regular expression) one of which a refusal or a warning
must hold to have named the cause: in its errors and new warnings, see run_faults.py. `cause=None`: nothing has to be
said, there must be a result within its sigmas. A fault that moves what a picture shows moves p.truth, too.
"""
import copy
import math
import random
from dataclasses import dataclass

import numpy as np

from site_files import NotApplicable, Project, rotation, station_number, tum_row, turn

LOCALIZE, SURVEY = ["localize"], ["detect", "survey"]
FAULTS = []


@dataclass
class Fault:
    name: str
    group: str
    apply: object
    cause: str
    commands: list
    quick: bool


def fault(group, name, cause, commands=LOCALIZE, quick=False):
    """Adds the decorated function to the table."""

    def add(apply):
        FAULTS.append(Fault(name, group, apply, cause, commands, quick))
        return apply

    return add


def add(group, name, cause, apply, commands=LOCALIZE, quick=False):
    FAULTS.append(Fault(name, group, apply, cause, commands, quick))


def earth_m(table, de, dn):
    """Moves rows of latitude_deg, longitude_deg by metres."""
    for row in table:
        latitude = float(row["latitude_deg"])
        row["latitude_deg"] = f"{latitude + dn / 111320:.9f}"
        row["longitude_deg"] = f"{float(row['longitude_deg']) + de / (111320 * math.cos(math.radians(latitude))):.9f}"


# --- odometry: order, inverse, axes, signs -----------------------------------------------------------------------

ODOMETRY = r"odometry"


def poses(name, change, cause=ODOMETRY, quick=False):
    add("odometry", name, cause, lambda p: p.poses(change), quick=quick)


def columns(name, order, cause=ODOMETRY, quick=False):
    """Columns of each row in another order; order counts from the timestamp as 0."""

    def apply(p):
        p.rows("odometry.tum", lambda rows: (" ".join(row.split()[k] for k in order) for row in rows))

    add("odometry", name, cause, apply, quick=quick)


def inverse(q):
    return -q.r.T @ q.t, q.r.T


CAMERA_AXES = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], float)  # right, down, forward, from forward, left, up
FLIP = np.diag([1.0, -1, -1])
MIRROR = np.diag([1.0, -1, 1])

columns("quaternions w x y z", [0, 1, 2, 3, 7, 4, 5, 6], quick=True)
columns("quaternion before position", [0, 4, 5, 6, 7, 1, 2, 3], "odometry|quaternion")
columns("columns y z x", [0, 2, 3, 1, 4, 5, 6, 7])
columns("columns x z y", [0, 1, 3, 2, 4, 5, 6, 7])
poses("rotations inverted", lambda k, q: (q.t, q.r.T), quick=True)
poses("poses inverted (body_from_odom)", lambda k, q: inverse(q), quick=True)
poses("camera axes (right, down, forward) for the body", lambda k, q: (q.t, q.r @ CAMERA_AXES.T), quick=True)
poses("camera axes for body and frame", lambda k, q: (CAMERA_AXES @ q.t, CAMERA_AXES @ q.r @ CAMERA_AXES.T), quick=True)
poses("axes forward, right, down", lambda k, q: (FLIP @ q.t, FLIP @ q.r @ FLIP))
poses("axes right, forward, up", lambda k, q: (q.t, q.r @ turn(2, -90)))
poses("body turned by 180 deg", lambda k, q: (q.t, q.r @ turn(2, 180)))
poses("body on its side", lambda k, q: (q.t, q.r @ turn(0, 90)))
poses("y negated", lambda k, q: (MIRROR @ q.t, q.r), quick=True)
poses("x and y negated", lambda k, q: (turn(2, 180) @ q.t, q.r), quick=True)
poses("x and y swapped", lambda k, q: (q.t[[1, 0, 2]], q.r))
poses("x negated", lambda k, q: (np.diag([-1.0, 1, 1]) @ q.t, q.r))
poses("z negated", lambda k, q: (np.diag([1.0, 1, -1]) @ q.t, q.r), r"z is negated")
poses("positions negated", lambda k, q: (-q.t, q.r))
poses("left-handed (y right)", lambda k, q: (MIRROR @ q.t, MIRROR @ q.r @ MIRROR))
poses("frame turned (positions and rotations)", lambda k, q: (turn(2, 70) @ q.t, turn(2, 70) @ q.r), None)
poses("positions turned by 90 deg against rotations", lambda k, q: (turn(2, 90) @ q.t, q.r))
poses("positions turned by 10 deg against rotations", lambda k, q: (turn(2, 10) @ q.t, q.r), r"turned against its rotations")
poses("inverted, w first", lambda k, q: (q.t, rotation(np.roll(quaternion_of(q.r.T), 1))))


def quaternion_of(r):
    from site_files import quaternion

    return quaternion(r)


def yaw_of(r):
    return math.degrees(math.atan2(r[1, 0], r[0, 0]))


poses("yaw negated", lambda k, q: (q.t, turn(2, -2 * yaw_of(q.r)) @ q.r), quick=True)
poses("yaw clockwise from north", lambda k, q: (q.t, turn(2, 90 - 2 * yaw_of(q.r)) @ q.r))
poses("rotations all identity", lambda k, q: (q.t, np.eye(3)), quick=True)
poses("rotations all 45 deg", lambda k, q: (q.t, turn(2, 45)))
poses("rotations halved", lambda k, q: (q.t, turn(2, -0.5 * yaw_of(q.r)) @ q.r))
poses("yaw in degrees taken as radians", lambda k, q: (q.t, turn(2, math.degrees(yaw_of(q.r)) - yaw_of(q.r)) @ q.r))


@fault("odometry", "poses of the camera, not the body", ODOMETRY)
def poses_of_camera(p):
    text = p.text("camchain.yaml").split("cam1")[0]
    rows = [line.strip()[1:].strip() for line in text.splitlines() if line.strip().startswith("- [")][:4]
    matrix = np.array([[float(x) for x in row.strip("[]").split(",")] for row in rows])
    camera = np.linalg.inv(matrix)
    p.poses(lambda k, q: (q.r @ camera[:3, 3] + q.t, q.r @ camera[:3, :3]))


@fault("odometry", "rotations of other rows", ODOMETRY)
def shuffled_rotations(p):
    all_poses = p.odometry()
    others = random.Random(1).sample(all_poses, len(all_poses))
    p.poses(lambda k, q: (q.t, others[k].r))


@fault("odometry", "positions as steps, not sums", ODOMETRY)
def steps(p):
    all_poses = p.odometry()
    p.poses(lambda k, q: (q.t - all_poses[max(0, k - 1)].t, q.r))


# --- odometry: unit, scale -----------------------------------------------------------------------------------------

for unit, factor, quick in [("feet", 1 / 0.3048, True), ("inches", 1 / 0.0254, False), ("centimetres", 100, False),
                            ("millimetres", 1000, True), ("kilometres", 0.001, False), ("yards", 1 / 0.9144, False),
                            ("decimetres", 10, False)]:
    poses(f"in {unit}", lambda k, q, f=factor: (f * q.t, q.r), r"odometry|unit|metres|contradict|scale|the run is \S+ m long", quick)
for percent in (-20, -5, 5, 20):
    poses(f"scale {percent:+d} %", lambda k, q, f=1 + percent / 100: (f * q.t, q.r),
          r"scale|size|sigma|contradict|geotag|odometry")
poses("x alone scaled by 1.3", lambda k, q: (np.diag([1.3, 1, 1]) @ q.t, q.r), r"odometry|contradict|sigma|geotag")

# --- odometry: jumps, drift, noise -----------------------------------------------------------------------------------


def jump(metres):
    def apply(p):
        all_poses = p.odometry()
        middle = len(all_poses) // 2
        aside = all_poses[middle].r @ [0, metres, 0]
        p.poses(lambda k, q: (q.t + (aside if k >= middle else 0), q.r))

    return apply


for metres, quick in [(0.5, False), (2, False), (5, True), (20, False), (10000, False)]:
    add("odometry", f"one jump of {metres} m", r"odometry.*(jump|step)|jump", jump(metres), quick=quick)


@fault("odometry", "a jump of 5 m and back", r"jump")
def spike(p):
    middle = len(p.odometry()) // 2
    p.poses(lambda k, q: (q.t + ([0, 5, 0] if k == middle else 0), q.r))


@fault("odometry", "one turn by 90 deg that was not", ODOMETRY)
def heading_jump(p):
    all_poses = p.odometry()
    pivot = all_poses[len(all_poses) // 2]
    by = turn(2, 90)

    def change(k, q):
        return (q.t, q.r) if k < len(all_poses) // 2 else (by @ (q.t - pivot.t) + pivot.t, by @ q.r)

    p.poses(change)


def drift(degrees_m):
    """Heading drifts along the path; positions follow."""

    def apply(p):
        all_poses = p.odometry()
        moved, t, angle = [], all_poses[0].t, 0.0
        for k, q in enumerate(all_poses):
            if k > 0:
                step = q.t - all_poses[k - 1].t
                t = t + turn(2, angle) @ step
                angle += degrees_m * np.linalg.norm(step)
            moved.append((t, turn(2, angle) @ q.r))
        p.poses(lambda k, q: moved[k])

    return apply


add("odometry", "heading drifts by 0.3 deg a metre", r"odometry|contradict", drift(0.3))
add("odometry", "heading drifts by 2 deg a metre", r"contradicts the images", drift(2))
add("odometry", "heading drifts by 10 deg a metre", ODOMETRY, drift(10))


def noise(metres, degrees):
    def apply(p):
        generator = np.random.default_rng(1)

        def change(k, q):
            axis = generator.normal(size=3)
            wobble = turn(0, degrees * axis[0]) @ turn(1, degrees * axis[1]) @ turn(2, degrees * axis[2])
            return q.t + metres * generator.normal(size=3), q.r @ wobble

        p.poses(change)

    return apply


add("odometry", "noise of 5 cm and 0.5 deg a pose", None, noise(0.05, 0.5))
add("odometry", "noise of 0.3 m and 3 deg a pose", r"contradicts the images|rotations are taken as noisy", noise(0.3, 3))
add("odometry", "noise of 2 m and 20 deg a pose", ODOMETRY, noise(2, 20))


@fault("odometry", "stands still for a third of the run", r"odometry.tum(:\d+)?: jumps")
def stuck(p):
    all_poses = p.odometry()
    n = len(all_poses)
    p.poses(lambda k, q: (all_poses[n // 3].t, all_poses[n // 3].r) if n // 3 < k < 2 * n // 3 else (q.t, q.r))


poses("all poses the same", lambda k, q: (np.zeros(3), np.eye(3)), r"odometry|same|moving|moves|motion")
poses("positions rounded to a metre", lambda k, q: (np.round(q.t), q.r), r"odometry.tum: (jumps|all positions are whole metres)")
poses("positions rounded to 0.1 m", lambda k, q: (np.round(q.t, 1), q.r), None)
poses("far from its origin, as UTM", lambda k, q: (q.t + [412345.0, 5318234, 240], q.r), None)

# --- odometry: times, rows, files --------------------------------------------------------------------------------------


def odometry_times(name, change, cause, quick=False):
    def apply(p):
        rows = []
        for q in p.odometry():
            rows.append(tum_row(change(q.stamp), q.t, q.r))
        p.write_odometry(rows)

    add("clocks", name, cause, apply, quick=quick)


for seconds in (0.2, 1, -2, 5):
    odometry_times(f"odometry {seconds:+g} s late", lambda s, d=seconds: f"{float(s) + d:.6f}",
                   r"time_offset|clock|contradicts the images", quick=seconds == 5)
odometry_times("odometry an hour late", lambda s: f"{float(s) + 3600:.6f}", r"odometry")
odometry_times("odometry in milliseconds", lambda s: f"{1000 * float(s):.3f}", r"odometry|time", True)
odometry_times("odometry in nanoseconds", lambda s: f"{float(s) * 1e9:.0f}", r"expected a time")


@fault("clocks", "odometry's clock 2 % fast", r"clock")
def fast_clock(p):
    first = float(p.odometry()[0].stamp)
    p.write_odometry([tum_row(f"{first + 1.02 * (float(q.stamp) - first):.6f}", q.t, q.r) for q in p.odometry()])


@fault("clocks", "odometry backwards in time", r"odometry")
def backwards(p):
    all_poses = p.odometry()
    p.poses(lambda k, q: (all_poses[-1 - k].t, all_poses[-1 - k].r))


@fault("files", "odometry of another run", r"odometry|covers", quick=True)
def other_odometry(p):
    others = [d for d in sorted((p.site / "runs").iterdir()) if d.name != p.run.name and (d / "odometry.tum").exists()]
    if not others:
        raise NotApplicable("another run")
    p.write(p.run / "odometry.tum", (others[0] / "odometry.tum").read_text())


@fault("odometry", "the path the other way round, mirrored", ODOMETRY)
def mirrored_backwards(p):
    all_poses = p.odometry()
    p.poses(lambda k, q: (MIRROR @ all_poses[-1 - k].t, MIRROR @ all_poses[-1 - k].r @ MIRROR))


def odometry_rows(name, change, cause, quick=True):
    add("files", name, cause, lambda p: p.rows("odometry.tum", change), quick=quick)


odometry_rows("odometry with commas", lambda rows: (",".join(row.split()) for row in rows), None, False)
odometry_rows("odometry with decimal commas", lambda rows: (row.replace(".", ",") for row in rows), r"comma")
odometry_rows("odometry with semicolons", lambda rows: (";".join(row.split()) for row in rows), r"expected 8")
odometry_rows("odometry as KITTI matrices", lambda rows: (" ".join(["1 0 0 0 0 1 0 0 0 0 1 0"]) for row in rows),
              r"KITTI's poses without times")
odometry_rows("odometry as x y z roll pitch yaw", lambda rows: (" ".join(row.split()[:7]) for row in rows),
              r"expected 8")
odometry_rows("odometry not normalised", lambda rows: (" ".join(row.split()[:4] + ["0.1", "0.2", "0.3", "2"])
                                                       for row in rows), r"unit quaternion")
odometry_rows("odometry empty", lambda rows: [], r"empty")
odometry_rows("odometry's second half missing", lambda rows: rows[:len(rows) // 2], r"covers|odometry", False)
odometry_rows("odometry's every second row missing", lambda rows: rows[::2], None, False)
odometry_rows("odometry shuffled", lambda rows: random.Random(1).sample(rows, len(rows)), None, False)
odometry_rows("odometry with NaN in every fifth row",
              lambda rows: (row if k % 5 else row.split()[0] + " nan nan nan 0 0 0 1" for k, row in enumerate(rows)),
              r"nan|skipped", False)


@fault("files", "odometry with EuRoC's header over TUM's columns", ODOMETRY, quick=True)
def euroc_header(p):
    _, rows = p.lines("odometry.tum")
    p.write_odometry([",".join(row.split()) for row in rows], "#timestamp,px,py,pz,qw,qx,qy,qz")


@fault("files", "no odometry", r"odometry", quick=True)
def no_odometry(p):
    p.path("odometry.tum").unlink()


# --- geotags ---------------------------------------------------------------------------------------------------------


def geotags(name, change, cause, quick=False):
    add("geotags", name, cause, lambda p: p.table(p.panoramas(), change), quick=quick)


def swap(row):
    row["latitude_deg"], row["longitude_deg"] = row["longitude_deg"], row["latitude_deg"]


def each(change):
    def apply(table):
        for row in table:
            change(row)

    return apply


def first(change, count=1):
    def apply(table):
        if len(table) < count + 1:
            raise NotApplicable("one geotag only")
        change(table[:count])

    return apply


POSITION = r"geotag|latitude|origin"
geotags("latitude and longitude swapped", each(swap), r"swapped", quick=True)
geotags("latitude and longitude of one swapped", first(each(swap)), r"swapped")
for metres, quick in [(1, False), (3, False), (10, False), (100, False), (1000, True), (10000, False)]:
    geotags(f"one {metres} m off", first(lambda t, m=metres: earth_m(t, m, 0)), POSITION, quick)
geotags("two 10 m off, the same way", first(lambda t: earth_m(t, 10, 0), 2), POSITION)
geotags("two 10 m off, opposite ways", first(lambda t: (earth_m(t[:1], 10, 0), earth_m(t[1:], -10, 0)), 2), POSITION)
geotags("all 30 m off", lambda t: earth_m(t, 30, 0), POSITION)
geotags("all 5 km off", lambda t: earth_m(t, 5000, 0), POSITION)
geotags("all 300 km off", lambda t: earth_m(t, 300000, 0), POSITION, quick=True)
geotags("longitude's sign", each(lambda r: r.update(longitude_deg=-float(r["longitude_deg"]))), POSITION)
geotags("at 0, 0", each(lambda r: r.update(latitude_deg=0, longitude_deg=0)), r"latitude 0", quick=True)
geotags("one at 0, 0", first(each(lambda r: r.update(latitude_deg=0, longitude_deg=0))), r"latitude 0")
geotags("4 decimals (11 m)", each(lambda r: r.update(latitude_deg=f"{float(r['latitude_deg']):.4f}",
                                                     longitude_deg=f"{float(r['longitude_deg']):.4f}")), POSITION)
geotags("5 decimals (1 m)", each(lambda r: r.update(latitude_deg=f"{float(r['latitude_deg']):.5f}",
                                                    longitude_deg=f"{float(r['longitude_deg']):.5f}")), POSITION)


def minutes(value):
    value = float(value)
    return f"{100 * int(value) + 60 * (value - int(value)):.7f}"


geotags("degrees and minutes (ddmm.mmmm)", each(lambda r: r.update(latitude_deg=minutes(r["latitude_deg"]),
                                                                  longitude_deg=minutes(r["longitude_deg"]))),
        r"latitude|longitude|degrees", quick=True)
geotags("in radians", each(lambda r: r.update(latitude_deg=math.radians(float(r["latitude_deg"])),
                                              longitude_deg=math.radians(float(r["longitude_deg"])))), POSITION)


@fault("geotags", "places of two exchanged", POSITION)
def exchange_two(p):
    def change(table):
        if len(table) < 3:
            raise NotApplicable("too few")
        for field in ("latitude_deg", "longitude_deg"):
            table[0][field], table[1][field] = table[1][field], table[0][field]

    p.table(p.panoramas(), change)


@fault("geotags", "places of all shifted by one row", POSITION)
def shift_rows(p):
    def change(table):
        places = [(r["latitude_deg"], r["longitude_deg"]) for r in table]
        for row, place in zip(table, places[1:] + places[:1]):
            row["latitude_deg"], row["longitude_deg"] = place

    p.table(p.panoramas(), change)


@fault("geotags", "mirrored about a meridian", POSITION)
def mirrored_places(p):
    def change(table):
        middle = np.mean([float(r["longitude_deg"]) for r in table])
        for row in table:
            row["longitude_deg"] = f"{2 * middle - float(row['longitude_deg']):.9f}"

    p.table(p.panoramas(), change)


HEADING = r"heading"


def headings(name, change, cause=HEADING, quick=False):
    add("geotags", f"headings {name}", cause, lambda p: p.column(p.panoramas(), "heading_deg", change), quick=quick)


headings("in radians", math.radians, quick=True)
headings("counter-clockwise", lambda h: -h % 360, quick=True)
headings("from east, counter-clockwise", lambda h: (90 - h) % 360)
headings("from south", lambda h: (h + 180) % 360)
headings("from east", lambda h: (h + 90) % 360)
headings("10 deg off", lambda h: (h + 10) % 360)
headings("all 0", lambda h: 0)
headings("in gon", lambda h: h / 0.9 % 400 % 360)
headings("in 0 to 1", lambda h: h / 360)
geotags("heading of one 180 deg off", first(each(lambda r: r.update(heading_deg=(float(r["heading_deg"]) + 180) % 360))),
        HEADING)
geotags("without headings", each(lambda r: r.update(heading_deg="")), HEADING)
for kept in (3, 2, 1):
    def few(p, n=kept, change=None):
        def apply(table):
            if len(table) <= n:
                raise NotApplicable("fewer")
            del table[n:]
            for row in table:
                row["heading_deg"] = math.radians(float(row["heading_deg"]))

        p.table(p.panoramas(), apply)

    add("geotags", f"headings in radians, {kept} geotag(s)", r"heading|direction|geotag|contradict", few)

geotags("heights above the sea", each(lambda r: r.update(height_m=float(r["height_m"]) - 48)), r"height|geoid")
geotags("heights in feet", each(lambda r: r.update(height_m=float(r["height_m"]) / 0.3048)), r"height|feet")
geotags("heights 0", each(lambda r: r.update(height_m=0)), r"height")
geotags("height of one 10 m off", first(each(lambda r: r.update(height_m=float(r["height_m"]) + 10))), r"geotag.*height")
geotags("pitch 20 deg off", each(lambda r: r.update(pitch_deg=float(r["pitch_deg"]) + 20)), r"pitch|tilt|attitude|roll")
geotags("pitch and roll swapped", each(lambda r: r.update(pitch_deg=r["roll_deg"], roll_deg=r["pitch_deg"])), r"pitch")
geotags("sigmas ten times too small", each(lambda r: r.update(sigma_h_m=0.03, sigma_v_m=0.05)), r"sigma|geotag")
geotags("sigmas in centimetres", each(lambda r: r.update(sigma_h_m=30, sigma_v_m=50)), r"sigma")
geotags("sigma 0", each(lambda r: r.update(sigma_h_m=0)), r"sigma", quick=True)
geotags("sigma negative", each(lambda r: r.update(sigma_h_m=-0.3)), r"sigma", quick=True)
geotags("one place not a number", first(each(lambda r: r.update(latitude_deg="nan"))), r"latitude|nan", quick=True)
geotags("one row without a file", lambda table: [dict(table[0], file="")], r"panoramas|photos|file", quick=True)


def table_text(name, change, cause, quick=True):
    add("files", name, cause, lambda p: p.edit(p.panoramas(), change), quick=quick)


table_text("geotags with semicolons", lambda s: s.replace(",", ";"), r"panoramas|photos|;|column")
table_text("geotags with tabs", lambda s: s.replace(",", "\t"), r"panoramas|photos|column")
table_text("geotags with another header", lambda s: s.replace("latitude_deg", "lat"), r"lat")
table_text("geotags empty", lambda s: "", r"panoramas|photos|empty")
table_text("geotags without rows", lambda s: "\n".join([*(x for x in s.splitlines() if x.startswith("#")), next(
    x for x in s.splitlines() if x and not x.startswith("#"))]) + "\n", r"panoramas|photos|empty|rows")


@fault("geotags", "pictures of two panoramas exchanged", POSITION)
def exchange_pictures(p):
    def change(table):
        if len(table) < 3:
            raise NotApplicable("too few")
        table[0]["file"], table[1]["file"] = table[1]["file"], table[0]["file"]

    p.table(p.panoramas(), change)


@fault("geotags", "one panorama's picture at every place", POSITION)
def same_picture(p):
    table = p.table(p.panoramas())
    picture = p.dir / table[0]["file"]
    for row in table[1:]:
        p.write(p.dir / row["file"], picture.read_bytes())
    places = p.truth.panoramas
    places.update(dict.fromkeys(places, places[station_number(table[0]["station"])]))


# --- site, origin, GPS -----------------------------------------------------------------------------------------------


def origin(name, change, cause, quick=False):
    import json

    def apply(p):
        data = json.loads(p.text("origin.json"))
        change(data)
        p.write(p.dir / "origin.json", json.dumps(data))
        if (p.dir / "trigpoint.yaml").exists():
            (p.dir / "trigpoint.yaml").unlink()
        p.init = True

    add("site", name, cause, apply, quick=quick)


origin("origin's latitude and longitude swapped", lambda d: d.update(lat=d["lon"], lon=d["lat"]), r"origin|swapped")
origin("origin 1 deg off", lambda d: d.update(lat=d["lat"] + 1), r"origin|km")
origin("origin 5 km off", lambda d: d.update(lat=d["lat"] + 0.045), r"origin")
origin("origin's latitude 95", lambda d: d.update(lat=95), r"lat", quick=True)


def gps_only(p):
    for name in ("panoramas.csv", "photos.csv"):
        if (p.dir / name).exists():
            # Pictures state the places, too: the table without positions wins.
            p.table(name, each(lambda r: r.update(latitude_deg="", longitude_deg="", height_m="", heading_deg="")))


def gps(name, change, cause, only=True, quick=False):
    def apply(p):
        if not (p.run / "gps.csv").exists():
            raise NotApplicable("gps.csv")
        if only:
            gps_only(p)
        p.table("gps.csv", change)

    add("gps", name + (", GPS only" if only else ""), cause, apply, quick=quick)


def gps_times(seconds):
    return each(lambda r: r.update(timestamp_s=f"{float(r['timestamp_s']) + seconds:.3f}"))


gps("GPS as it is", lambda table: None, None)
gps("GPS swapped", each(swap), r"GPS|swapped|km")
gps("GPS 10 s late", gps_times(10), r"gps|GPS|time")
gps("GPS an hour late", gps_times(3600), r"GPS|gps|time")
gps("GPS all the same", lambda t: [r.update(latitude_deg=t[0]["latitude_deg"], longitude_deg=t[0]["longitude_deg"])
                                   for r in t] and None, r"GPS|gps|direction|contradict|size")
gps("GPS sigmas 0.01 m", each(lambda r: r.update(sigma_h_m=0.01, sigma_v_m=0.02)), r"GPS|sigma|contradict|size|geotag")
gps("GPS at 0, 0", each(lambda r: r.update(latitude_deg=0, longitude_deg=0)), r"latitude 0")
gps("GPS mirrored", lambda t: [r.update(longitude_deg=f"{2 * float(t[0]['longitude_deg']) - float(r['longitude_deg']):.9f}")
                               for r in t] and None, r"GPS|contradict|direction|odometry|sigma")
gps("GPS 10 km off", lambda t: earth_m(t, 10000, 0), r"GPS|km|geotag", only=False)
gps("GPS empty of numbers", each(lambda r: r.update(latitude_deg="x")), r"latitude|GPS|gps", only=False, quick=True)


@fault("gps", "odometry in feet, GPS only", r"odometry|unit|metres|size|scale|contradict")
def feet_gps(p):
    if not (p.run / "gps.csv").exists():
        raise NotApplicable("gps.csv")
    gps_only(p)
    p.poses(lambda k, q: (q.t / 0.3048, q.r))


# --- calibration -------------------------------------------------------------------------------------------------------


def camchain(name, change, cause, quick=False):
    def apply(p):
        import yaml

        data = yaml.safe_load(p.text("camchain.yaml"))
        before = copy.deepcopy(data)
        change(data["cam0"])
        if data == before:
            raise NotApplicable(name)
        p.write(p.path("camchain.yaml"), yaml.safe_dump(data))

    add("calibration", name, cause, apply, quick=quick)


def extrinsics(name, change, cause, quick=False):
    def apply(cam):
        if "T_cam_imu" not in cam:
            raise NotApplicable("T_cam_imu")
        cam["T_cam_imu"] = np.asarray(change(np.array(cam["T_cam_imu"], float))).tolist()

    camchain(name, apply, cause, quick)


def rotated(r):
    m = np.eye(4)
    m[:3, :3] = r
    return m


CAMERA = r"T_cam_imu|calibration|focal|camchain"
extrinsics("T_cam_imu inverted", np.linalg.inv, CAMERA, True)
extrinsics("T_cam_imu identity", lambda m: np.eye(4), CAMERA, True)
extrinsics("camera turned by 5 deg", lambda m: rotated(turn(1, 5)) @ m, CAMERA)
extrinsics("camera turned by 15 deg", lambda m: rotated(turn(1, 15)) @ m, CAMERA)
extrinsics("camera turned by 45 deg", lambda m: rotated(turn(1, 45)) @ m, CAMERA)
extrinsics("camera turned by 90 deg", lambda m: rotated(turn(1, 90)) @ m, CAMERA)
extrinsics("camera turned by 180 deg", lambda m: rotated(turn(1, 180)) @ m, CAMERA)
extrinsics("camera on its head", lambda m: rotated(turn(2, 180)) @ m, CAMERA)
extrinsics("lever arm in millimetres", lambda m: m @ np.diag([1.0, 1, 1, 1]) + np.pad(999 * m[:3, 3:], ((0, 1), (3, 0))),
           CAMERA + "|lever|jump|metres", True)
extrinsics("lever arm negated", lambda m: m - 2 * np.pad(m[:3, 3:], ((0, 1), (3, 0))), CAMERA)
extrinsics("lever arm 3 m off", lambda m: m + np.pad(np.full((3, 1), 1.7), ((0, 1), (3, 0))), CAMERA)
extrinsics("T_cam_imu left-handed", lambda m: rotated(MIRROR) @ m, r"T_cam_imu|rotation", True)
extrinsics("T_cam_imu scaled", lambda m: 2 * m, r"T_cam_imu|rotation", True)
camchain("T_cam_imu of three rows", lambda c: c.update(T_cam_imu=c["T_cam_imu"][:3]), r"T_cam_imu", True)


def intrinsics(name, change, cause, quick=False):
    camchain(name, lambda c: c.update(intrinsics=[float(v) for v in change(list(c["intrinsics"]))]), cause, quick)


for percent, cause in ((2, r"calibration|focal"), (10, r"calibration"), (50, CAMERA + "|feature|pixel|sigma")):
    intrinsics(f"focal length {percent} % off",
               lambda v, f=1 + percent / 100: [f * v[0], f * v[1], v[2], v[3]], cause)
intrinsics("focal length halved", lambda v: [v[0] / 2, v[1] / 2, v[2], v[3]], CAMERA + "|feature|pixel|sigma")
intrinsics("focal length in millimetres", lambda v: [4.2, 4.2, v[2], v[3]], r"focal", True)
intrinsics("focal length negative", lambda v: [-v[0], v[1], v[2], v[3]], r"intrinsics|focal", True)
intrinsics("all of half the size", lambda v: [x / 2 for x in v], CAMERA + "|principal")
intrinsics("principal point at 0, 0", lambda v: [v[0], v[1], 0, 0], r"principal")
intrinsics("principal point swapped", lambda v: [v[0], v[1], v[3], v[2]], CAMERA + "|principal|feature|pixel")
intrinsics("principal point 4795", lambda v: [v[0], v[1], 4795, v[3]], r"principal")
intrinsics("principal point 20 px off", lambda v: [v[0], v[1], v[2] + 20, v[3]], r"calibration")
camchain("distortion -0.9", lambda c: c.update(distortion_coeffs=[-0.9, 0, 0, 0]), r"distortion")
camchain("distortion of another lens", lambda c: c.update(distortion_coeffs=[-0.2, 0.05, 0, 0]), r"calibration")
camchain("another lens model named", lambda c: c.update(distortion_model="equidistant"), r"lens model")
camchain("resolution swapped", lambda c: c.update(resolution=c["resolution"][::-1]), r"resolution|px|size|expected", True)
camchain("resolution halved", lambda c: c.update(resolution=[v // 2 for v in c["resolution"]]),
         r"resolution|px|size|expected", True)
camchain("unknown model", lambda c: c.update(camera_model="pinhol"), r"camera_model|pinhol", True)
camchain("intrinsics of three", lambda c: c.update(intrinsics=c["intrinsics"][:3]), r"intrinsics", True)
add("calibration", "no calibration", r"camera|calib|camchain", lambda p: p.path("camchain.yaml").unlink(), quick=True)
add("calibration", "calibration cut off", r"camchain", lambda p: p.edit("camchain.yaml", lambda s: s[:len(s) // 3]),
    quick=True)


def with_focal_length(picture, factor):
    """A JPEG whose EXIF states another focal length, as a 35 mm equivalent; nothing else in it changes."""
    from PIL import Image

    exif = Image.open(picture).getexif()
    details = exif.get_ifd(0x8769)
    if 0xA405 not in details:
        raise NotApplicable("FocalLengthIn35mmFilm")
    details[0xA405] = round(factor * details[0xA405])
    fresh = exif.tobytes()
    data, at = picture.read_bytes(), 2
    while data[at + 1] != 0xE1 or data[at + 4:at + 8] != b"Exif":
        at += 2 + int.from_bytes(data[at + 2:at + 4], "big")
    end = at + 2 + int.from_bytes(data[at + 2:at + 4], "big")
    return data[:at + 2] + (len(fresh) + 2).to_bytes(2, "big") + fresh + data[end:]


@fault("calibration", "EXIF's focal length of photos 7 % off", None)
def exif_of_photos(p):
    pictures = sorted((p.dir / "photos").glob("*/*.jpg"))
    if not pictures:
        raise NotApplicable("photos")
    for picture in pictures:
        p.write(picture, with_focal_length(picture, 1.07))


# --- clocks: images -----------------------------------------------------------------------------------------------------


def image_times(name, change, cause, quick=False):
    def apply(p):
        _, rows = p.lines("images.txt")
        stamps = [float(row.split()[0]) for row in rows]
        p.rows("images.txt", lambda rs: (" ".join([f"{t:.6f}", *row.split()[1:]])
                                         for t, row in zip(change(stamps), rs)))

    add("clocks", name, cause, apply, quick=quick)


image_times("images 1 s late", lambda s: [t + 1 for t in s], r"time_offset|clock|contradicts")
image_times("images 0.1 s late", lambda s: [t + 0.1 for t in s], None)
image_times("images an hour late", lambda s: [t + 3600 for t in s], r"odometry|cover")
image_times("images in milliseconds", lambda s: [1000 * t for t in s], r"odometry|cover|time", True)
image_times("images at twice the rate", lambda s: [s[0] + (t - s[0]) / 2 for t in s], ODOMETRY + "|clock")
image_times("images backwards", lambda s: s[::-1], ODOMETRY)
image_times("images in random order", lambda s: random.Random(1).sample(s, len(s)), ODOMETRY)
image_times("two images at one time", lambda s: [s[1]] + s[1:], r"time|stamp|same", True)


@fault("clocks", "one image at two times", r"image|twice|listed", quick=True)
def image_twice(p):
    p.rows("images.txt", lambda rows: rows + [f"{float(rows[-1].split()[0]) + 1:.6f} {rows[0].split()[1]}"])


# --- images, panoramas ---------------------------------------------------------------------------------------------------


def picture(name, change, cause, quick=False, which=lambda files: files[len(files) // 2:len(files) // 2 + 1]):
    def apply(p):
        for file in which(p.images()):
            change(p, file)

    add("files", name, cause, apply, quick=quick)


def pillow(change):
    def apply(p, file):
        import io

        from PIL import Image

        image = change(Image.open(file))
        out = io.BytesIO()
        image.save(out, "JPEG" if file.suffix.lower() in (".jpg", ".jpeg") else "PNG", quality=95)
        p.write(file, out.getvalue())

    return apply


def all_files(files):
    return files


PICTURE = r"\.(jpg|png)|decode"
picture("one image cut off", lambda p, f: p.write(f, f.read_bytes()[:5000]), PICTURE)
picture("one image empty", lambda p, f: p.write(f, b""), PICTURE)
picture("one image missing", lambda p, f: f.unlink(), PICTURE)
picture("one image of another size", pillow(lambda i: i.resize((i.width // 2, i.height // 2))), PICTURE)
picture("one image of noise", pillow(lambda i: noise_picture(i)), None)
picture("one image black", pillow(lambda i: i.point(lambda v: 0)), None)
picture("one image of another place in time", lambda p, f: p.write(f, p.images()[0].read_bytes()), None)
picture("all images mirrored", pillow(lambda i: i.transpose(0)), ODOMETRY + "|mirror|unmatched", which=all_files)
picture("all images on their head", pillow(lambda i: i.transpose(3)), ODOMETRY + "|unmatched", which=all_files)
picture("all images the same", lambda p, f: p.write(f, p.images()[-1].read_bytes()), r"odometry|image|unmatched",
        which=lambda files: files[:-1])
picture("half of the images blurred", pillow(lambda i: blurred(i)), None, which=lambda files: files[::2])


def noise_picture(image):
    from PIL import Image

    values = np.random.default_rng(1).integers(0, 255, (image.height, image.width, 3), dtype=np.uint8)
    return Image.fromarray(values)


def blurred(image):
    from PIL import ImageFilter

    return image.filter(ImageFilter.GaussianBlur(6))


def panorama(name, change, cause, which=lambda table: table[:1], quick=False):
    def apply(p):
        for row in which(p.table("panoramas.csv")):
            change(p, p.dir / row["file"])

    add("files", name, cause, apply, quick=quick)


panorama("one panorama cut off", lambda p, f: p.write(f, f.read_bytes()[:20000]), r"panorama|jpg|decode")
panorama("one panorama missing", lambda p, f: f.unlink(), r"panorama|jpg")
panorama("one panorama's half", pillow(lambda i: i.crop((0, 0, i.width // 2, i.height))), r"panorama|2 ?: ?1|size|jpg|wide")
panorama("panoramas mirrored", pillow(lambda i: i.transpose(0)), r"panoramas.* mirrored", lambda t: t, True)
panorama("panoramas rolled by a quarter",
         pillow(lambda i: rolled(i)), r"heading|geotag|direction|contradict", lambda t: t)


def rolled(image):
    from PIL import Image

    return Image.fromarray(np.roll(np.asarray(image), image.width // 4, axis=1))


# --- settings ------------------------------------------------------------------------------------------------------------


def run_yaml(name, text, cause, quick=True):
    def apply(p):
        import yaml

        settings = (yaml.safe_load((p.run / "run.yaml").read_text()) or {}) if (p.run / "run.yaml").exists() else {}
        for key, value in yaml.safe_load(text).items():
            settings[key] = {**settings.get(key, {}), **value} if isinstance(value, dict) else value
        p.write(p.run / "run.yaml", yaml.safe_dump(settings))

    add("units", name, cause, apply, quick=quick)


run_yaml("scale sigma in per cent", "odometry: {scale_sigma: 1}", r"scale", False)
run_yaml("scale sigma 0", "odometry: {scale_sigma: 0}", r"scale_sigma")
run_yaml("scale sigma 1e-6", "odometry: {scale_sigma: 1.0e-6}", r"scale_sigma", False)
run_yaml("odometry called levelled, which it is not", "odometry: {levelled: true}", r"level", False)
run_yaml("unknown key", "odometri: {levelled: true}", r"odometri")
run_yaml("time offset in milliseconds", "odometry: {time_offset_s: 1000}", r"odometry|cover")
run_yaml("mirrored said of images that are not", "mirrored: true", ODOMETRY + r"|mirrored|unmatched", False)

# --- tags, control -------------------------------------------------------------------------------------------------------


def survey_table(group, name, file, change, cause, quick=False):
    add(group, name, cause, lambda p: p.table(file, change), SURVEY, quick)


def tag_size(name, factor, cause):
    def apply(p):
        import re

        p.edit("tags.yaml", lambda s: re.sub(r"(size_m:\s*)([0-9.]+)", lambda m: f"{m[1]}{float(m[2]) * factor:.6f}", s))

    add("tags", name, cause, apply, SURVEY)


TAGS = r"size|scale|metres"
tag_size("size in millimetres", 1000, TAGS)
tag_size("size in centimetres", 100, TAGS)
tag_size("size in inches", 1 / 0.0254, TAGS)
tag_size("size with its white border", 1.25, TAGS)
tag_size("size 5 % off", 1.05, None)
add("tags", "another family", r"family|no tag|36h11", lambda p: p.edit("tags.yaml", lambda s: s.replace("36h11", "25h9")), SURVEY)
add("tags", "unknown family", r"family", lambda p: p.edit("tags.yaml", lambda s: s.replace("36h11", "99h1")), SURVEY, True)
add("tags", "size negative", r"size", lambda p: p.edit("tags.yaml", lambda s: s.replace("size_m: ", "size_m: -")), SURVEY, True)

CONTROL = r"control|height|swapped|origin|distance"


def control(name, change, cause=CONTROL, quick=False):
    survey_table("control", name, "control_points.csv", change, cause, quick)


control("latitude and longitude swapped", each(swap))
control("latitude and longitude of one swapped", first(each(swap)))
control("heights above the sea", each(lambda r: r.update(height_m=float(r["height_m"]) - 48)), None)
control("height of one 48 m off", first(each(lambda r: r.update(height_m=float(r["height_m"]) - 48))))
control("heights in feet", each(lambda r: r.update(height_m=float(r["height_m"]) / 0.3048)))
control("one 1 m off", first(lambda t: earth_m(t, 1, 0)))
control("one 20 m off", first(lambda t: earth_m(t, 20, 0)))
control("one 940 m off", first(lambda t: earth_m(t, 940, 0)))
control("all 50 m off", lambda t: earth_m(t, 50, 0), None)
control("tags of two exchanged", first(lambda t: swap_ids(t), 2))
control("unknown tag", first(each(lambda r: r.update(tag_id=586))))
control("sigmas in millimetres", each(lambda r: r.update(sigma_h_m=8, sigma_v_m=12)), None)
control("sigma 0", each(lambda r: r.update(sigma_h_m=0)), r"sigma", True)
control("at 0, 0", each(lambda r: r.update(latitude_deg=0, longitude_deg=0)), r"latitude 0|control")
control("mirrored", lambda t: [r.update(longitude_deg=f"{2 * float(t[0]['longitude_deg']) - float(r['longitude_deg']):.9f}")
                               for r in t] and None)
control("role misspelt", each(lambda r: r.update(role="contrl")), r"role", True)
control("doubled, 2 m apart", lambda t: t + moved_copy(t[0]))


def swap_ids(table):
    table[0]["tag_id"], table[1]["tag_id"] = table[1]["tag_id"], table[0]["tag_id"]


def moved_copy(row):
    copy = [dict(row)]
    earth_m(copy, 2, 0)
    return copy


add("odometry", "in feet, survey", TAGS, lambda p: p.poses(lambda k, q: (q.t / 0.3048, q.r)), SURVEY)
add("odometry", "quaternions w x y z, survey", ODOMETRY,
    lambda p: p.rows("odometry.tum", lambda rows: (" ".join(row.split()[k] for k in [0, 1, 2, 3, 7, 4, 5, 6])
                                                   for row in rows)), SURVEY)
add("odometry", "poses inverted, survey", ODOMETRY, lambda p: p.poses(lambda k, q: inverse(q)), SURVEY)
add("odometry", "rotations all identity, survey", ODOMETRY, lambda p: p.poses(lambda k, q: (q.t, np.eye(3))), SURVEY)
add("odometry", "yaw negated, survey", ODOMETRY,
    lambda p: p.poses(lambda k, q: (q.t, turn(2, -2 * yaw_of(q.r)) @ q.r)), SURVEY)
