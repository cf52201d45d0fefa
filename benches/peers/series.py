"""An industrial arm before a laser tracker, by the series: is a drift found that is not there, and one that is? -> a table.

    series.py ARMCAL [SERIES] [POSES] [OUT.csv]      (200 series of 90 poses)

The arm, its map and its three reflectors are those of tests/cases/laser_tracker_baseline. Sensors, links and reflectors are off by as much
as its robot.toml states or assumes, the tracker by 0.1 mm. Every second series has one joint whose offset walks by 0.02 deg. A finding is a
code of a walk, a slip or a failed sensor; without a walk it is wrong.
"""

import csv
import json
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from misread import AXES, ORIGINS  # noqa: E402

CASE = Path(__file__).parents[2] / "tests/cases/laser_tracker_baseline"
TRACKER_M, TRACKER = np.array([2.7, -1.2, 0.6]), Rotation.from_quat([0.267600, -0.005622, 0.017127, 0.963361], scalar_first=True)
REFLECTORS_M = np.array([[0.0, 0.0, 0.12], [0.075, 0.09, 0.21], [0.15, 0.0, 0.12]])
TOOL_M, TOOL = np.array([0.12, 0, 0]), Rotation.from_euler("y", 1.5707963)
OFFSET_RAD, GAIN, LINK_M, LINK_RAD, REFLECTOR_M, NOISE_M, READING_RAD = 0.005, 0.001, 5e-4, 5e-4, 0.002, 1e-4, 1e-4
WALK_RAD = np.radians(0.02)
WRONG = {"offset_walks", "offsets_walk", "sensor_slip", "sensor_failed", "sensor_worn", "sensor_error"}


def write_series(folder, rng, n_poses, walk):
    readings = rng.uniform([-1.2, -0.9, -1.0, -1.5, -1.2, -2.0], [1.2, 0.9, 1.0, 1.5, 1.2, 2.0], (n_poses, 6))
    angles = readings * (1 + rng.normal(0, GAIN, 6)) + rng.normal(0, OFFSET_RAD, 6) + rng.normal(0, READING_RAD, readings.shape)
    if walk:
        steps = rng.normal(0, 1, n_poses).cumsum()
        angles[:, rng.integers(0, 6)] += WALK_RAD * steps / np.sqrt(n_poses)
    origins = ORIGINS + np.vstack([np.zeros(3), rng.normal(0, LINK_M, (5, 3))])
    turns = [Rotation.identity(), *(Rotation.from_rotvec(rng.normal(0, LINK_RAD, 3)) for _ in range(5))]
    reflectors = REFLECTORS_M + rng.normal(0, REFLECTOR_M, REFLECTORS_M.shape)
    with open(folder / "offset.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", *[f"j{k + 1}" for k in range(6)], "smr", "x", "y", "z"])
        for pose, row in enumerate(angles):
            xyz, turn = np.zeros(3), Rotation.identity()
            for origin, link, axis, angle in zip(origins, turns, AXES, row):
                xyz, turn = xyz + turn.apply(origin), turn * link * Rotation.from_rotvec(angle * axis)
            xyz, turn = xyz + turn.apply(TOOL_M), turn * TOOL
            seen = TRACKER.inv().apply(xyz + turn.apply(reflectors) - TRACKER_M) + rng.normal(0, NOISE_M, (3, 3))
            rows.writerows([30 * pose, *readings[pose], k + 1, *(1e3 * at)] for k, at in enumerate(seen))


def main(armcal, series="200", n_poses="90", out=None):
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder) / "case"
        shutil.copytree(CASE, folder)
        for seed in range(int(series)):
            walk = seed % 2 == 1
            write_series(folder, np.random.default_rng([seed, int(n_poses)]), int(n_poses), walk)
            shutil.rmtree(folder / "out", ignore_errors=True)
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            words = [armcal, "calibrate", "offset.csv", "--robot", "robot", "--input", "input.toml", "--tag-map", "tags.toml", "--out", "out"]
            code = subprocess.run(words, cwd=folder, capture_output=True, check=False).returncode
            used_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            summary = json.loads((folder / "out/summary.json").read_text())
            codes = summary["verdict"]["codes"] + [warning["code"] for warning in summary["calibration"].get("warnings", []) if "code" in warning]
            named = sorted(WRONG & set(codes))
            held_mm = 1e3 * summary["held_out"]["rms_m"]
            rows.append([seed, "walk" if walk else "still", code, f"{held_mm:.2f}", f"{used_s:.1f}", ",".join(named), ",".join(summary["verdict"]["codes"])])
            print("| " + " | ".join(map(str, rows[-1])) + " |", flush=True)
    for case in ("still", "walk"):
        of_case = [row for row in rows if row[1] == case]
        refused, named = sum(row[2] == 4 for row in of_case), sum(row[5] != "" for row in of_case)
        print(f"{case}: {len(of_case)} series of {n_poses} poses, refused {refused}, named {named}, most {max(float(row[4]) for row in of_case)} s")
    if out:
        with open(out, "w", newline="") as file:
            csv.writer(file).writerows(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
