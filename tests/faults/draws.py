"""Random projects made of a good one: combinations of faults, and variations without any."""
import random

import numpy as np

import faults
from faults import LOCALIZE, SURVEY, Fault
from site_files import NotApplicable, station_number, turn


def combination(index):
    """One to three faults at once; a refusal must name one of them."""
    draw = random.Random(1000 + index)
    commands = LOCALIZE if draw.random() < 0.75 else SURVEY
    fitting = [f for f in faults.FAULTS if f.commands == commands or (commands == SURVEY and f.group == "odometry")]
    chosen = draw.sample(fitting, draw.choice([1, 2, 2, 3]))

    made = Fault(" + ".join(f.name for f in chosen), "combination", None, None, commands, True)

    def apply(project):
        done = []
        for f in chosen:
            try:
                f.apply(project)
                done.append(f)
            except NotApplicable:
                continue
            except (ValueError, IndexError, KeyError, OSError):
                if not done:
                    raise
                # The file is no longer one of this kind, by the faults before.
        if not done:
            raise NotApplicable("none of them")
        made.cause = "|".join(f.cause for f in done if f.cause) or None

    made.apply = apply
    return made


def variation(index, truth):
    """No fault: another stretch of the run, geotags drawn anew with their own sigmas, odometry a little noisier."""
    draw = np.random.default_rng(5000 + index)

    def apply(project):
        def stretch(rows):
            count = int(len(rows) * draw.uniform(0.75, 1))
            first = int(draw.integers(0, len(rows) - count + 1))
            return rows[first:first + count]

        project.rows("images.txt", stretch)

        def geotags(table):
            for row in table:
                station = station_number(row.get("station", ""))
                at = truth.panoramas.get(station)
                if at is None or not row.get("sigma_h_m"):
                    continue
                sigma_h, sigma_v = float(row["sigma_h_m"]), float(row["sigma_v_m"])
                wanted = at + draw.normal(size=3) * [sigma_h, sigma_h, sigma_v]
                move = wanted - truth.earth.enu(row)
                faults.earth_m([row], move[0], move[1])
                row["height_m"] = f"{float(row['height_m']) + move[2]:.3f}"
                attitude = truth.attitudes.get(station)
                if attitude is None or not row.get("sigma_heading_deg"):
                    continue
                sigmas = [float(row["sigma_heading_deg"]), *[float(row["sigma_tilt_deg"])] * 2]
                for name, angle in zip(("heading_deg", "pitch_deg", "roll_deg"), attitude + draw.normal(size=3) * sigmas):
                    row[name] = f"{angle % 360 if name == 'heading_deg' else angle:.3f}"

        project.table(project.panoramas(), geotags)
        walk = np.zeros(3)

        def noise(_, pose):
            nonlocal walk
            walk = walk + draw.normal(size=3) * 0.002
            return pose.t + walk, pose.r @ turn(2, draw.normal() * 0.02)

        project.poses(noise)

    return Fault(f"variation {index}", "variation", apply, None, LOCALIZE, True)
