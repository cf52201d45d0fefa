#!/usr/bin/env python3
"""Table of closed loops for well-known arms: `armcal new-robot`, `check` and `run`, with tags around each arm.

    python tests/oracle/any_arm_loops.py target/release/armcal FOLDER [NAME...]

Reads the URDFs of the wheel example-robot-data (requirements.txt). FOLDER takes the robot folders, routines and runs.
What a user has to do is done here, by the same rules for every arm: collision meshes that are COLLADA or have too many
corners become STL hulls; a missing effort is that of the weakest other joint; an inertia that is none becomes a small
one; a wrist lens 6 cm before the link that `new-robot` chose, known to 5 mm and 0.02 rad; joint rates of 0.5 rad/s;
16 tags on a sphere about the arm; eight targets that some configuration reaches. `stowed_rad` is the one that
`new-robot` found. Prints Markdown.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree as ElementTree

import numpy as np
import trimesh

ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
ARMS = {
    "panda": ("panda_description/urdf/panda.urdf", []),
    "ur3": ("ur_description/urdf/ur3_robot.urdf", []),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", []),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", []),
    "kinova": ("kinova_description/robots/kinova.urdf", ["--tip", "j2s6s200_end_effector"]),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", []),
    "z1": ("z1_description/urdf/z1.urdf", ["--tip", "gripperStator"]),
    "bravo7": ("bravo7_description/urdf/bravo7_no_ee.urdf", []),
    "talos": ("talos_data/robots/talos_left_arm.urdf", ["--tip", "gripper_left_base_link"]),
    "tiago": ("tiago_description/robots/tiago_no_hand.urdf", ["--base", "torso_lift_link"]),
    "baxter": ("baxter_description/urdf/baxter.urdf", ["--tip", "left_gripper"]),
    "pr2": ("pr2_description/urdf/pr2.urdf", ["--base", "torso_lift_link", "--tip", "r_wrist_roll_link"]),
}
# Weight that something else carries: water, or springs that are in no URDF.
CARRIED = {"bravo7": 0.7, "pr2": 0.9, "baxter": 0.7}
MOST_CORNERS = 1000
LENS = """model = "equidistant"
resolution_px = [1280, 1024]
focal_px = [400.0, 400.0]
center_px = [639.5, 511.5]
distortion = [0.02, -0.01, 0.0, 0.0]
max_view_angle_rad = 1.3
corner_std_px = 0.3
position_m = [0.0, 0.0, 0.06]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
mount_std_m = 0.005
mount_std_rad = 0.02
"""
VEHICLE = pathlib.Path(__file__).resolve().parents[2] / "robots/vehicles/fixed-base.toml"
N_TAGS, N_TARGETS = 16, 8


def robots_folder():
    return pathlib.Path(sysconfig.get_path("purelib")) / ROBOTS


def said(program, *args):
    answer = subprocess.run([program, *map(str, args)], capture_output=True, text=True, check=False)
    return answer.returncode, (answer.stdout + answer.stderr).strip()


def rotation(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])


def about(axis, angle):
    axis = axis / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Chain:
    """Forward kinematics from the robot's own URDF: base to tool."""

    def __init__(self, folder):
        self.toml = (folder / "robot.toml").read_text()
        urdf = ElementTree.parse(folder / re.search(r'\nurdf = "([^"]*)"', self.toml).group(1)).getroot()
        base = re.search(r'\nbase_link = "([^"]*)"', self.toml).group(1)
        link = re.search(r'\[tool\][^\[]*?\nlink = "([^"]*)"', self.toml).group(1)
        self.names = re.findall(r'\njoint = "([^"]*)"', self.toml)
        by_child = {joint.find("child").get("link"): joint for joint in urdf.findall("joint")}
        self.steps, self.limits = [], {}
        while link != base:
            joint = by_child[link]
            self.steps.insert(0, joint)
            link = joint.find("parent").get("link")
        for joint in self.steps:
            if joint.get("name") in self.names:
                limit = joint.find("limit")
                low, high = (-np.pi, np.pi) if joint.get("type") == "continuous" else (
                    float(limit.get("lower")), float(limit.get("upper")))
                self.limits[joint.get("name")] = (max(low, -np.pi), min(high, np.pi))

    def tool(self, angles):
        turn, place = np.eye(3), np.zeros(3)
        for joint in self.steps:
            origin = joint.find("origin")
            values = lambda key: np.array([float(v) for v in (origin.get(key) or "0 0 0").split()])
            if origin is not None:
                place, turn = place + turn @ values("xyz"), turn @ rotation(values("rpy"))
            if joint.get("name") in angles:
                axis = joint.find("axis")
                axis = np.array([float(v) for v in axis.get("xyz").split()]) if axis is not None else np.array([1.0, 0, 0])
                turn = turn @ about(axis, angles[joint.get("name")])
        return place

    def random(self, rng, share):
        middle = {n: 0.5 * (low + high) for n, (low, high) in self.limits.items()}
        return {n: middle[n] + share * rng.uniform(-0.5, 0.5) * (high - low) for n, (low, high) in self.limits.items()}


def quaternion(z):
    """wxyz of a frame whose z axis is `z`."""
    x = np.cross([0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    m = np.column_stack([x, np.cross(z, x), z])
    w, v = np.linalg.eigh(np.array([
        [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
        [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
        [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
    ]))
    q = v[:, np.argmax(w)]
    return [q[3], q[0], q[1], q[2]]


def tags(center, radius):
    """Evenly on a sphere, faces inward."""
    text = ""
    for k in range(N_TAGS):
        z = 1 - (2 * k + 1) / N_TAGS
        angle = k * np.pi * (3 - np.sqrt(5))
        out = np.array([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
        place, turn = center + radius * out, quaternion(-out)
        text += f"""
[[tag]]
id = {k}
family = "36h11"
size_m = {0.12 * radius:.3f}
position_m = [{", ".join(f"{v:.4f}" for v in place)}]
quaternion_wxyz = [{", ".join(f"{v:.9f}" for v in turn)}]
position_std_m = 0.001
rotation_std_rad = 0.0035
"""
    return text


def routine(name, targets):
    rows = "\n".join(f"  [{', '.join(f'{v:.3f}' for v in target)}]," for target in targets)
    return f"""version = 1
kind = "routine"
name = "{name}"
robot = "{name}"
vehicle = "{VEHICLE}"
seed = 1
method = "bundle"

[capture]
poses = 30
held_out = 0
min_tags = 2
clearance_m = 0.02
dwell_s = 1.0

[task]
tolerance_m = 0.01
targets_m = [
{rows}
]

# Gears are stiffer than oil.
[world.hydraulics]
bulk_modulus_pa = 1e10
"""


def mended(description, copy):
    """A copy of the folder with meshes that armcal reads."""
    shutil.copytree(description, copy)
    for mesh in [*copy.rglob("*.[dD][aA][eE]"), *copy.rglob("*.[sS][tT][lL]")]:
        scene = trimesh.load(mesh, force="scene")
        hull = scene.to_geometry().convex_hull
        if mesh.suffix.lower() == ".dae" or len(hull.vertices) > MOST_CORNERS:
            directions = np.random.default_rng(1).normal(size=(MOST_CORNERS, 3))
            corners = hull.vertices[np.unique(np.argmax(directions @ hull.vertices.T, axis=1))]
            mesh.unlink()
            place = mesh.with_suffix(".stl") if mesh.suffix.lower() == ".dae" else mesh
            trimesh.convex.convex_hull(corners).export(place, file_type="stl")


def add_dynamics(drawing):
    tree = ElementTree.parse(drawing)
    moving = [j for j in tree.getroot().findall("joint") if j.get("type") in ("revolute", "continuous")]
    efforts = [float(j.find("limit").get("effort") or 0) for j in moving if j.find("limit") is not None]
    weakest = min((effort for effort in efforts if effort > 0), default=50.0)
    for joint in moving:
        limit = joint.find("limit")
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit", velocity="0.5")
        if float(limit.get("effort") or 0) == 0:
            limit.set("effort", str(weakest))
    for inertia in tree.getroot().iter("inertia"):
        xx, yy, zz, xy, xz, yz = (float(inertia.get(k) or 0) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        if np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0] <= 0:
            for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
                inertia.set(key, "1e-4" if key[1] == key[2] else "0")
    tree.write(drawing)


def prepared(program, folder, name, urdf, more):
    robot = folder / name
    # ROBOTS/DESCRIPTION/.../ARM.urdf: `package://` paths begin with the folders above.
    description = urdf.parents[len(urdf.relative_to(robots_folder()).parts) - 2]
    copy = folder / "given" / name / "example-robot-data/robots" / description.name
    mended(description, copy)
    code, text = said(program, "new-robot", copy / urdf.relative_to(description), "--out", robot, *more)
    if code:
        raise RuntimeError(text.splitlines()[0])
    chain = Chain(robot)
    rng = np.random.default_rng(1)
    tools = np.array([chain.tool(chain.random(rng, 1.0)) for _ in range(400)])
    center = tools.mean(axis=0)
    radius = 1.35 * np.linalg.norm(tools - center, axis=1).max()
    toml = chain.toml.split("# Tags of the family")[0]
    toml = re.sub(r"\nmount_std_m = .*\nmount_std_rad = .*\n", "\n" + LENS, toml)
    toml = toml.replace("# base_tag = 0", "base_tag = 0") + tags(center, radius)
    targets = [chain.tool(chain.random(rng, 0.6)) for _ in range(N_TARGETS)]
    (folder / f"{name}.toml").write_text(routine(name, targets))
    toml = toml.replace("# stowed_rad = ", "stowed_rad = ")
    toml = toml.replace("buoyancy_fraction = 0.0", f"buoyancy_fraction = {CARRIED.get(name, 0.0)}")
    toml = re.sub(r"\nmax_rate_rad_s = .*", "\nmax_rate_rad_s = 0.5", toml)
    drawing = robot / re.search(r'\nurdf = "([^"]*)"', toml).group(1)
    add_dynamics(drawing)
    (robot / "robot.toml").write_text(toml)
    code, text = said(program, "check", folder / f"{name}.toml")
    if code:
        raise RuntimeError(text.splitlines()[0])


def row(program, folder, name, urdf, more):
    try:
        prepared(program, folder, name, urdf, more)
    except RuntimeError as error:
        return f"| {name} | {error} | | | | |"
    out = folder / f"{name}-run"
    code, text = said(program, "run", folder / f"{name}.toml", "--out", out)
    summary = out / "summary.json"
    if not summary.exists():
        return f"| {name} | exit {code}: {text.splitlines()[-1][:200]} | | | |"
    found = json.loads(summary.read_text())
    score, calibration = found["score"], found["calibration"]
    mm = lambda value: "" if value is None else f"{1000 * value:.2f}"
    before, after = (score.get(key) or {} for key in ("before", "after"))
    error = lambda side: (side.get("tool_error_m") or {}).get("median")
    predicted = (calibration.get("predicted_tool_error_with_priors_m") or {}).get("median")
    why = found.get("refusal") or ""
    contacts = (found.get("capture") or {}).get("collisions")
    return (f"| {name} | {found['status']} {why[:160]} | {mm(error(before))} | {mm(error(after))} | "
            f"{mm(predicted)} | {contacts} |")


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    robots = robots_folder()
    print("| arm | verdict | before, mm | after, mm | predicted, mm | contacts |")
    print("|---|---|--:|--:|--:|--:|")
    for name, (urdf, more) in ARMS.items():
        if not sys.argv[3:] or name in sys.argv[3:]:
            print(row(program, folder, name, robots / urdf, more), flush=True)


if __name__ == "__main__":
    main()
