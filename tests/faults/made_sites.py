"""Random sites of tags with exact truth, as project folders: a yard, two or three runs with odometry and detections in
place of pictures, control and check points. Noise is drawn from what the files state."""
import dataclasses
import math
import shutil

import numpy as np

from site_files import quaternion

FOCAL, WIDTH, HEIGHT = 420.0, 960, 600
GATES = ("gates: {survey: {min_check_points: 3, max_standardised_residual: 4.5, max_tag_sigma_m: 0.2, "
         "max_check_rmse_3d_m: 0.25}}\n")


def rotation_of(w):
    """3 x 3 of a rotation vector."""
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return np.eye(3)
    k = np.asarray(w) / angle
    x = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + math.sin(angle) * x + (1 - math.cos(angle)) * x @ x


@dataclasses.dataclass
class Tag:
    at: np.ndarray  # centre, m
    r: np.ndarray  # world from tag: x right, y down, z into the wall

    def corners(self, size):
        """Bottom-left, bottom-right, top-right, top-left as seen from the front."""
        return [self.at + self.r @ np.array([0.5 * size * x, 0.5 * size * y, 0])
                for x, y in ((-1, 1), (1, 1), (1, -1), (-1, -1))]


@dataclasses.dataclass
class Run:
    name: str
    clockwise: bool
    stamps: list
    bodies: list  # (position, world from body)
    tags: dict  # id as printed -> list of Tag where it hangs during this run
    odometry: list  # (stamp, position, rotation)
    date: str


class Site:
    """What is true, and what the files say; a fault changes one of them before write()."""

    def __init__(self, seed, tags=None, controls=None, checks=None, runs=None, noise_px=0.2):
        self.draw = np.random.default_rng(seed)
        draw = self.draw
        self.noise_px = noise_px
        self.size = float(draw.choice([0.3, 0.4, 0.5]))  # as printed
        self.stated_size, self.sizes, self.printed = self.size, {}, {}
        half = draw.uniform(8, 16), draw.uniform(7, 12)
        count = tags or int(draw.integers(14, 23))
        self.tags = {}
        for i, angle in enumerate(np.linspace(0, 2 * math.pi, count, endpoint=False) + draw.normal(size=count) * 0.05):
            self.tags[i] = self.on_wall(angle, half, draw.uniform(0.6, 2.6))
        names = [f"run{k + 1}" for k in range(runs or int(draw.integers(2, 4)))]
        self.runs = [self.drive(k, name, half) for k, name in enumerate(names)]
        order = [int(i) for i in draw.permutation(count)]
        controls, checks = controls or int(draw.integers(4, 7)), checks or int(draw.integers(5, 8))
        self.sigma = 0.005
        self.points = {}  # tag -> [role, stated position]
        for k, tag in enumerate(order[:controls + checks]):
            stated = self.tags[tag].at + draw.normal(size=3) * self.sigma
            self.points[tag] = ["control" if k < controls else "check", stated]
        self.clock_s = {run.name: 0.0 for run in self.runs}
        self.origin = (48.0, 7.8, 200.0)

    @staticmethod
    def on_wall(angle, half, height):
        """On a rectangle round the yard, facing its middle."""
        c, s = math.cos(angle), math.sin(angle)
        reach = min(half[0] / max(abs(c), 1e-9), half[1] / max(abs(s), 1e-9))
        along_x = abs(c) * half[1] > abs(s) * half[0]
        out = np.array([math.copysign(1, c), 0, 0]) if along_x else np.array([0, math.copysign(1, s), 0])
        down = np.array([0, 0, -1.0])
        return Tag(np.array([reach * c, reach * s, height]), np.column_stack([np.cross(down, out), down, out]))

    def drive(self, k, name, half):
        """A lap inside the yard, the camera looking out; odometry drifts as the survey's options state."""
        draw = self.draw
        images = int(draw.integers(70, 110))
        clockwise = bool(draw.integers(0, 2))
        start, inside = draw.uniform(0, 2 * math.pi), draw.uniform(0.4, 0.6)
        stamps, bodies, odometry = [], [], []
        scale = 1 + draw.normal() * 0.01
        t, r = np.zeros(3), np.eye(3)
        for i in range(images):
            angle = start + (-1 if clockwise else 1) * 2.1 * math.pi * i / images
            at = np.array([inside * half[0] * math.cos(angle), inside * half[1] * math.sin(angle),
                           0.8 + 0.1 * math.sin(5 * angle)])
            heading = angle + (-0.5 if clockwise else 0.5) * math.pi
            rotation = rotation_of([0, 0, heading]) @ rotation_of(draw.normal(size=3) * 0.01)
            stamps.append(1000.0 * (k + 1) + 0.5 * i)
            bodies.append((at, rotation))
            if i > 0:
                before, before_r = bodies[-2]
                step, turn = before_r.T @ (at - before), before_r.T @ rotation
                root = math.sqrt(np.linalg.norm(step))
                step = step / scale + 0.015 * root * draw.normal(size=3)
                t, r = t + r @ step, r @ turn @ rotation_of(math.radians(0.2) * root * draw.normal(size=3))
            odometry.append((stamps[-1], t, r))
        return Run(name, clockwise, stamps, bodies, {i: [tag] for i, tag in self.tags.items()}, odometry,
                   f"2026-05-{12 + k}")

    def detections(self, run):
        """Rows of detections.csv."""
        mount = self.mount(run)
        for stamp, (at, r) in zip(run.stamps, run.bodies):
            for number, places in run.tags.items():
                seen = []
                for tag in places:
                    corners = self.pixels(tag.corners(self.printed.get(number, self.size)), at, r @ mount, tag)
                    if corners is not None:
                        seen.append(corners)
                for corners in seen:
                    noisy = corners + self.draw.normal(size=(4, 2)) * self.noise_px
                    yield f"{stamp:.3f},{number}," + ",".join(f"{v:.3f}" for v in noisy.ravel()) + f",{self.noise_px}"

    @staticmethod
    def mount(run):
        """Body from camera (right, down, forward): to the side that looks out."""
        side = 1 if run.clockwise else -1  # +y is left
        forward, down = np.array([0, float(side), 0]), np.array([0, 0, -1.0])
        return np.column_stack([np.cross(down, forward), down, forward])

    @staticmethod
    def pixels(corners, at, world_from_cam, tag):
        if (tag.at - at) @ tag.r[:, 2] < 0.3 * np.linalg.norm(tag.at - at):
            return None  # from behind, or too flat
        result = []
        for corner in corners:
            x, y, z = world_from_cam.T @ (corner - at)
            if z < 1:
                return None
            u, v = FOCAL * x / z + 0.5 * WIDTH - 0.5, FOCAL * y / z + 0.5 * HEIGHT - 0.5
            if not (5 < u < WIDTH - 6 and 5 < v < HEIGHT - 6):
                return None
            result.append((u, v))
        return np.array(result)

    def write(self, folder):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        (folder / "trigpoint.yaml").write_text("schema: 1\n" + GATES)
        (folder / "origin.json").write_text('{"lat": %r, "lon": %r, "alt": %r}\n' % self.origin)
        sizes = "".join(f"  {k}: {v:.4f}\n" for k, v in self.sizes.items())
        (folder / "tags.yaml").write_text(f"size_m: {self.stated_size:.4f}\n" + ("sizes_m:\n" + sizes if sizes else ""))
        rows = [f"{tag},{role},{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},{self.sigma},{self.sigma}"
                for tag, (role, p) in self.points.items()]
        (folder / "control_points.csv").write_text("tag_id,role,x_m,y_m,z_m,sigma_h_m,sigma_v_m\n" + "\n".join(rows) +
                                                   "\n")
        for run in self.runs:
            self.write_run(run, folder / "runs" / run.name)

    def write_run(self, run, folder):
        folder.mkdir(parents=True)
        (folder / "run.yaml").write_text(f"role: survey\ndate: {run.date}\n")
        (folder / "detections.csv").write_text("timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3,sigma_px\n" +
                                               "\n".join(self.detections(run)) + "\n")
        poses = []
        for stamp, t, r in run.odometry:
            numbers = [*t, *quaternion(r)]
            poses.append(f"{stamp + self.clock_s[run.name]:.3f} " + " ".join(f"{v:.7f}" for v in numbers))
        (folder / "odometry.tum").write_text("\n".join(poses) + "\n")
        camera_from_body = self.mount(run).T
        rows = "".join("  - [%g, %g, %g, 0]\n" % tuple(row) for row in camera_from_body) + "  - [0, 0, 0, 1]\n"
        (folder / "camchain.yaml").write_text(
            f"cam0:\n  camera_model: pinhole\n  intrinsics: [{FOCAL}, {FOCAL}, {0.5 * WIDTH - 0.5}, {0.5 * HEIGHT - 0.5}]\n"
            "  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
            f"  resolution: [{WIDTH}, {HEIGHT}]\n  T_cam_imu:\n{rows}")
