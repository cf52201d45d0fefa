"""Pure noise: random joint readings and random tag positions, poses or corners. How many of them armcal accepts -> a table.

    noise.py ARMCAL [SEEDS] [OUT.csv]

A six-joint arm with three tags, 30, 60 and 200 views, without a task and with one of 20 mm. None may be accepted.
"""

import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from misread import SIMULATED, run, write_simulated  # noqa: E402
from real_arms import prepare  # noqa: E402

VIEWS = (30, 60, 200)
LENS = 'model = "pinhole"\nresolution_px = [1280, 960]\nfocal_px = [900.0, 900.0]\ncenter_px = [639.5, 479.5]\ndistortion = [0.0, 0.0, 0.0, 0.0]\n'
SIZE_M = 0.15
PIXELS = [f"{axis}{k}" for k in range(4) for axis in "uv"]
INPUT = """version = 1
kind = "input"
[table]
time = { column = "t", unit = "s" }
[joint_sensors]
unit = "rad"
[tags]
use = "USE"
[tags.columns]
direction = "camera_from_tag"
position = ["x", "y", "z"]
id = "id"
"""
CORNERS = f'[tags]\nuse = "corners"\n[tags.columns]\nid = "id"\ncorners = {PIXELS}\n'
ROTATION = 'rotation = ["qw", "qx", "qy", "qz"]\nrotation_form = "quaternion_wxyz"\n'


def random_square(rng):
    """Corners of a tag that faces the camera somewhere, px: bottom left, bottom right, top right, top left."""
    facing = Rotation.from_rotvec([np.pi, 0, 0]) * Rotation.from_euler("zyx", rng.uniform(-1, 1, 3) * [np.pi, 0.6, 0.6])
    corners = SIZE_M / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    points = facing.apply(corners) + rng.uniform([-0.3, -0.2, 0.8], [0.3, 0.2, 1.5])
    return ([639.5, 479.5] + 900 * points[:, :2] / points[:, 2:]).ravel()


def write_noise(folder, use, n_views, seed):
    rng = np.random.default_rng([seed, n_views, ("position", "pose", "corners").index(use)])
    seen = PIXELS if use == "corners" else ["x", "y", "z", "qw", "qx", "qy", "qz"]
    with open(folder / "noise.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", *[f"j{k + 1}" for k in range(6)], "id", *seen])
        for view in range(n_views):
            angles = rng.uniform(-1.5, 1.5, 6)
            for tag in (1, 2, 3):
                if use == "corners":
                    what = random_square(rng)
                else:
                    what = [*rng.uniform([-0.5, -0.5, 0.3], [0.5, 0.5, 1.5]), *Rotation.random(rng=rng).as_quat()]
                rows.writerow([20 * view, *angles, tag, *what])
    text = INPUT.replace("USE", use) + (ROTATION if use == "pose" else "")
    (folder / "input.toml").write_text(INPUT[:INPUT.index("[tags]")] + CORNERS if use == "corners" else text)
    tags = [f"[[tag]]\nid = {k}\nsize_m = {SIZE_M}\nposition_m = [{1.0 + 0.1 * k}, {0.2 * k - 0.4}, -0.4]\nposition_std_m = {[0.01] * 3}\n"
            f"quaternion_wxyz = [0.0, 1.0, 0.0, 0.0]\nrotation_std_rad = {[0.03] * 3}\n" for k in (1, 2, 3)]
    (folder / "tags.toml").write_text("version = 1\nkind = \"tag_map\"\nframe = \"l0\"\n" + "".join(tags))
    head = "version = 1\nkind = \"task\"\ntolerance_m = 0.02\n"
    (folder / "task.toml").write_text(head + "poses_rad = [[0.0, 0.6, 0.4, 0.0, 0.5, 0.0], [0.3, 0.3, 0.6, 0.2, 0.3, 0.5]]\n")


def main(armcal, seeds="3", out=None):
    rows, accepted = [], 0
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_simulated(folder, 1)
        prepare(armcal, folder, ("", "", *SIMULATED), folder)
        robot = folder / "robot/robot.toml"
        robot.write_text(robot.read_text().replace("[camera]\n", "[camera]\n" + LENS, 1))
        for n_views in VIEWS:
            for use in ("position", "pose", "corners"):
                for seed in range(int(seeds)):
                    write_noise(folder, use, n_views, seed)
                    for task in ([], ["--task", folder / "task.toml"]):
                        began = time.monotonic()
                        code, held_m, said = run(armcal, folder, [folder / "noise.csv", "--robot", folder / "robot", "--input", folder / "input.toml",
                                                                  "--tag-map", folder / "tags.toml", *task])
                        accepted += code in (0, 3)
                        rows.append([n_views, use, seed, "task" if task else "no task", code, held_m, f"{time.monotonic() - began:.1f} s", said])
                        print("| " + " | ".join(map(str, rows[-1])) + " |", flush=True)
    print(f"\n{len(rows)} recordings of noise; accepted: {accepted}")
    if out:
        with open(out, "w", newline="") as file:
            csv.writer(file).writerows(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
