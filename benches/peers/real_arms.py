"""The recordings of real arms that arms.py and misread.py use, and armcal's files for them."""

import subprocess

# Name, recording, drawing, last link that moves; mount, board and links as their authors know them: m and rad, one sigma.
ARMS = [
    ("Franka FR3, 114 poses", "franka_114.mcap", "franka_nominal.urdf", "fr3_link7", "fr3_link0", [0.01, 0.05], [0.66025, -0.5905, -0.0097],
     [1.0, 0.0, 0.0, 0.0], [0.01, 0.03], None),
    ("UR10e, 23 poses", "ur10/ur10_23.mcap", "ur10/ur10_nominal.urdf", "wrist_3_link", "base_link", [0.03, 0.1], [0.0, 0.0, -0.9],
     [0.5 ** 0.5, 0.0, 0.0, 0.5 ** 0.5], [0.1, 0.05], [2e-3, 5e-3]),
]


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
