#!/usr/bin/env python3
"""Table of docs/reference/any-arm.md: what `armcal new-robot` and `armcal check` make of well-known arms' URDFs.

    python tests/oracle/any_arm_table.py target/release/armcal [FOLDER...]

Reads the URDFs of the wheel example-robot-data (requirements.txt), and any further FOLDER's. Prints Markdown.
"""

import pathlib
import re
import subprocess
import sys
import sysconfig
import tempfile

ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
# URDF, and what is asked of the user where a file holds several arms.
ARMS = [
    ("panda_description/urdf/panda.urdf", []),
    ("ur_description/urdf/ur5_robot.urdf", []),
    ("ur_description/urdf/ur10_robot.urdf", []),
    ("ur_description/urdf/ur5_gripper.urdf", []),
    ("kinova_description/robots/kinova.urdf", []),
    ("xarm_description/urdf/xarm7.urdf", []),
    ("z1_description/urdf/z1.urdf", []),
    ("z1_description/urdf/z1.urdf", ["--tip", "gripperStator"]),
    ("bravo7_description/urdf/bravo7_no_ee.urdf", []),
    ("bravo7_description/urdf/bravo7_gripper.urdf", []),
    ("talos_data/robots/talos_left_arm.urdf", []),
    ("tiago_description/robots/tiago_no_hand.urdf", []),
    ("tiago_description/robots/tiago.urdf", []),
    ("tiago_pro_description/robots/tiago_pro.urdf", []),
    ("baxter_description/urdf/baxter.urdf", []),
    ("baxter_description/urdf/baxter.urdf", ["--tip", "left_gripper"]),
    ("pr2_description/urdf/pr2.urdf", []),
    ("pr2_description/urdf/pr2.urdf", ["--tip", "r_wrist_roll_link"]),
    ("bluevolta_description/urdf/bluevolta_bravo7_gripper.urdf", []),
    ("anymal_b_simple_description/robots/anymal-kinova.urdf", []),
    ("double_pendulum_description/urdf/double_pendulum_continuous.urdf", []),
]


def said(program, *args):
    answer = subprocess.run([program, *map(str, args)], capture_output=True, text=True, check=False)
    return answer.returncode, (answer.stdout + answer.stderr).strip()


def row(program, urdf, more):
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "robot"
        code, text = said(program, "new-robot", urdf, "--out", out, *more)
        if code:
            return "", f"exit {code}: {text.splitlines()[0].split(': ', 2)[-1]}", ""
        made = re.search(r"(\d+) joints from `([^`]*)`.*camera `([^`]*)`; (\d+) files", text)
        toml = (out / "robot.toml").read_text()
        tip = re.search(r'\[tool\][^\[]*?\nlink = "([^"]*)"', toml).group(1)
        joints, base, camera, files = made.groups()
        meshes = "ignored" if "\ncollision_meshes" in toml else f"{int(files) - 2} meshes"
        code, text = said(program, "check", out)
        checked = "ok" if code == 0 else f"exit {code}: {text.splitlines()[0]}"
        return f"{joints}, `{base}` .. `{tip}`, camera `{camera}`", meshes, checked


def main():
    program, folders = sys.argv[1], [pathlib.Path(folder) for folder in sys.argv[2:]]
    data = pathlib.Path(sysconfig.get_paths()["purelib"]) / ROBOTS
    arms = [(data / name, name, more) for name, more in ARMS]
    arms += [(urdf, urdf.name, []) for folder in folders for urdf in sorted(folder.glob("**/*.urdf"))]
    print("| URDF | joints, base .. tool | shapes | `check` |\n|---|---|---|---|")
    for urdf, name, more in arms:
        options = f" `{' '.join(more)}`" if more else ""
        chain, meshes, checked = row(program, urdf, more)
        print(f"| {pathlib.Path(name).name}{options} | {chain} | {meshes} | {checked} |")


if __name__ == "__main__":
    main()
