"""The recordings of real arms that several scripts use, and armcal's files for them."""

import json
import subprocess
import tempfile
from pathlib import Path

# Name, recording, drawing, last link that moves; mount, board and links as their authors know them: m and rad, one sigma.
ARMS = [
    ("Franka FR3, 114 poses", "franka_114.mcap", "franka_nominal.urdf", "fr3_link7", "fr3_link0", [0.01, 0.05], [0.66025, -0.5905, -0.0097],
     [1.0, 0.0, 0.0, 0.0], [0.01, 0.03], None),
    ("UR10e, 23 poses", "ur10/ur10_23.mcap", "ur10/ur10_nominal.urdf", "wrist_3_link", "base_link", [0.03, 0.1], [0.0, 0.0, -0.9],
     [0.5 ** 0.5, 0.0, 0.0, 0.5 ** 0.5], [0.1, 0.05], [2e-3, 5e-3]),
]

# Axes and target as the example has them, in a base frame turned so that the first axis is z.
POSITIONER = """<robot name="positioner"><link name="base_link"/><link name="l1"/><link name="l2"/><link name="target"/>
<joint name="j1" type="revolute"><parent link="base_link"/><child link="l1"/><axis xyz="0 0 1"/>
<limit lower="-3.14159" upper="3.14159" effort="100" velocity="1"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="0 0 1"/>
<origin xyz="0 -0.475 0" rpy="-1.5707963267948966 -1.5707963267948966 0"/>
<limit lower="-6.28" upper="6.28" effort="100" velocity="1"/></joint>
<joint name="t" type="fixed"><parent link="l2"/><child link="target"/>
<origin xyz="0.17 -0.65 0.5" rpy="1.5707963267948966 -0.20000119387833815 -1.5707963267948966"/></joint></robot>"""
POSITIONER_MAP = """version = 1
kind = "input"
[table]
format = "yaml"
[joint_sensors]
names = { j1 = "target_joints.0", j2 = "target_joints.1" }
unit = "rad"
[tags]
child_frame = "target"
use = "pose"
[tags.columns]
direction = "camera_from_tag"
position = ["pose.x", "pose.y", "pose.z"]
rotation = ["pose.qw", "pose.qx", "pose.qy", "pose.qz"]
rotation_form = "quaternion_wxyz"
"""
TARGET = """version = 1
kind = "tag_map"
frame = "target"
[[tag]]
name = "target"
position_m = [0.0, 0.0, 0.0]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
position_std_m = [0.1, 0.1, 0.1]
rotation_std_rad = [0.1, 0.1, 0.1]
"""


def prepare(armcal, data, arm, folder):
    """A robot folder and a tag map in `folder`, with what `arm` states of mount, board and links."""
    _, _, urdf, _, base, mount, board_m, board_wxyz, board_std, links = arm
    subprocess.run([armcal, "new-robot", data / urdf, "--out", folder / "robot"], check=True, capture_output=True)
    text = (folder / "robot/robot.toml").read_text()
    text = text.replace("mount_std_m = 0.01", f"mount_std_m = {mount[0]}").replace("mount_std_rad = 0.05", f"mount_std_rad = {mount[1]}")
    if links:
        text += f"\n[geometry]\nlink_position_std_m = {links[0]}\nlink_rotation_std_rad = {links[1]}\n"
    (folder / "robot/robot.toml").write_text(text)
    stds = [f"{key} = {[std] * 3}" for key, std in zip(("position_std_m", "rotation_std_rad"), board_std)]
    tag = [f"position_m = {board_m}", f"quaternion_wxyz = {board_wxyz}", *stds]
    (folder / "tags.toml").write_text("\n".join(["version = 1", f'frame = "{base}"', "[[tag]]", 'name = "board"', *tag]) + "\n")


def calibrated(armcal, data, arm):
    """armcal's summary of a recording of ARMS, by the input map that it proposes."""
    run = lambda *words: subprocess.run([armcal, *map(str, words)], check=False, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        prepare(armcal, data, arm, folder)
        run("inspect", data / arm[1], "--robot", folder / "robot", "--write-input", folder / "map.toml")
        run("calibrate", data / arm[1], "--robot", folder / "robot", "--input", folder / "map.toml", "--tag-map", folder / "tags.toml",
            "--out", folder / "out")
        return json.loads((folder / "out/summary.json").read_text())


def positioner(armcal, measurements):
    """armcal's summary of the two-axis positioner; camera and target as known as the example's guesses: 0.1 m and 0.1 rad."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        run = lambda *words: subprocess.run([armcal, *map(str, words)], check=True, capture_output=True)
        (folder / "arm.urdf").write_text(POSITIONER)
        run("new-robot", folder / "arm.urdf", "--camera-link", "base_link", "--out", folder / "robot")
        file = folder / "robot/robot.toml"
        head, camera = file.read_text().split("[camera]\n")
        camera = camera.replace("position_m = [0.0, 0.0, 0.0]", "position_m = [0.0, -0.525, -0.7]", 1)
        camera = camera.replace("quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]", "quaternion_wxyz = [0.7071067811865476, -0.7071067811865476, 0.0, 0.0]", 1)
        assert "mount_std_m = 0.1\n" in camera and "mount_std_rad = 0.1\n" in camera
        file.write_text(f"{head}[camera]\n{camera}")
        (folder / "map.toml").write_text(POSITIONER_MAP)
        (folder / "target.toml").write_text(TARGET)
        run("calibrate", measurements, "--robot", folder / "robot", "--input", folder / "map.toml",
            "--tag-map", folder / "target.toml", "--out", folder / "out")
        return json.loads((folder / "out/summary.json").read_text())
