#!/usr/bin/env python3
"""Counts what `armcal new-robot` makes of every URDF below some folders, next to two other readers.

    pip download --no-deps -d wheels example-robot-data pybullet ..   # unpack each wheel into a folder of its own
    cargo build --release && cargo build --release -p armcal-core --example tool_pose
    python tests/oracle/urdf_census.py target/release NAME=FOLDER .. > table.md

Needs yourdfpy and pin (requirements.txt). Prints a Markdown table: per NAME the URDFs that pinocchio or yourdfpy reads,
those of them without a moving joint, folders made, files for which armcal asks for --tip or --base, and files refused.
A folder is wrong where its joints are not the moving joints between base and tool, or where the tool's pose differs by
more than 1e-9 m or 1e-7 rad from yourdfpy's at five random configurations. Reasons go to stderr, one line per file.
"""

import collections
import multiprocessing
import pathlib
import re
import subprocess
import sys
import tempfile
import tomllib

import numpy as np

TOO_LONG_S = 120
POSITION_M, ROTATION_RAD = 1e-9, 1e-7
ASKED = re.compile(r"name one with --tip|arm's with --base")


def other_readers(path):
    """Names of the readers that read the file, and the number of moving joints."""
    readers, n_moving = [], 0
    try:
        import yourdfpy

        model = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=False, mesh_dir="")
        n_moving = sum(joint.type in ("revolute", "continuous", "prismatic") for joint in model.robot.joints)
        readers.append("yourdfpy")
    except BaseException:  # of any kind: the file is not read
        pass
    try:
        import pinocchio

        model = pinocchio.buildModelFromUrdf(str(path))
        n_moving = max(n_moving, model.njoints - 1)
        readers.append("pinocchio")
    except BaseException:
        pass
    return readers, n_moving


def other_chain(model, base, tip):
    """Moving joints between two links, base first."""
    holds = {joint.child: joint for joint in model.robot.joints}
    chain = []
    while tip != base:
        chain.append(holds[tip])
        tip = holds[tip].parent
    return [joint for joint in reversed(chain) if joint.type != "fixed"]


def pose_of(model, joints, angles, tool):
    """Product of the chain's transforms, by yourdfpy's origins and axes."""
    pose = np.eye(4)
    values = dict(zip(joints, angles))
    for joint in tool:
        pose = pose @ (np.eye(4) if joint.origin is None else joint.origin)
        if joint.type == "fixed":
            continue
        axis = np.array([1.0, 0, 0] if joint.axis is None else joint.axis, dtype=float)
        axis /= np.linalg.norm(axis)
        step = np.eye(4)
        if joint.type == "prismatic":
            step[:3, 3] = values[joint.name] * axis
        else:
            x, y, z = axis
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            angle = values[joint.name]
            step[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        pose = pose @ step
    return pose


def wrong(programs, path, folder, said):
    """What is wrong with a folder of which armcal said something; None where nothing is."""
    import yourdfpy

    robot = tomllib.loads((folder / "robot.toml").read_text())
    model = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=False, mesh_dir="")
    base, tool, camera = robot["base_link"], robot["tool"]["link"], robot["camera"]["link"]
    joints = [sensor["joint"] for sensor in robot["joint_sensor"]]
    chains = [[joint.name for joint in other_chain(model, base, link)] for link in (tool, camera)]
    if joints != max(chains, key=len):
        return f"joints {joints}, expected {max(chains, key=len)}"
    if any(joint.mimic for joint in other_chain(model, base, tool)):
        return "a joint of the chain follows another"
    held = {joint.child: joint for joint in model.robot.joints}
    above, at = [], base
    while at in held:
        above.append(held[at])
        at = held[at].parent
    turning = [joint.name for joint in above if joint.type in ("revolute", "continuous")]
    if any(name not in said for name in turning) and all(joint.type not in ("floating", "planar") for joint in above):
        return f"the base leaves out {turning}"
    holds = {joint.child: joint for joint in model.robot.joints}
    way, at = [], tool
    while at != base:
        way.insert(0, holds[at])
        at = holds[at].parent
    angles = np.random.default_rng(1).uniform(-1, 1, (5, len(joints)))
    lines = "\n".join(" ".join(map(repr, map(float, row))) for row in angles)
    answer = subprocess.run([programs / "examples/tool_pose", folder], input=lines, capture_output=True, text=True)
    for row, line in zip(angles, answer.stdout.splitlines(), strict=True):
        ours = np.array(line.split(), dtype=float)
        theirs = pose_of(model, joints, row, way)
        w, x, y, z = ours[3:]
        turn = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])
        off_m, off_rad = np.abs(ours[:3] - theirs[:3, 3]).max(), np.abs(turn - theirs[:3, :3]).max()
        if off_m > POSITION_M or off_rad > ROTATION_RAD:
            return f"tool off by {off_m:.1e} m, {off_rad:.1e} rad"
    return None


def judge(work):
    programs, name, path = work
    readers, n_moving = other_readers(path)
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch) / "robot"
        try:
            answer = subprocess.run(
                [programs / "armcal", "new-robot", path, "--out", folder],
                capture_output=True, text=True, timeout=TOO_LONG_S,
            )
        except subprocess.TimeoutExpired:
            return name, path, readers, n_moving, "refused", f"takes more than {TOO_LONG_S} s"
        said = " ".join((answer.stderr if answer.returncode else answer.stdout).split())
        if answer.returncode == 0:
            try:
                problem = wrong(programs, path, folder, said) if "yourdfpy" in readers else None
            except Exception as error:  # a comparison that cannot be made is shown, not hidden
                problem = f"not compared: {error!r}"
            return name, path, readers, n_moving, "wrong" if problem else "made", problem or said
        return name, path, readers, n_moving, "asked" if ASKED.search(said) else "refused", said


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    works = []
    for argument in sys.argv[2:]:
        name, folder = argument.split("=", 1)
        works += [(programs, name, path) for path in sorted(pathlib.Path(folder).rglob("*.urdf")) if path.is_file()]
    table = collections.defaultdict(collections.Counter)
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=50) as pool:
        for name, path, readers, n_moving, verdict, said in pool.imap(judge, works):
            row = table[name]
            row["files"] += 1
            row["read"] += bool(readers)
            if readers and n_moving == 0 and verdict == "refused":
                verdict = "no joint"
            elif not readers and verdict == "refused":
                verdict = "refused by all"
            row[verdict] += 1
            print(f"{verdict}\t{name}\t{path}\t{','.join(readers)}\t{said[:600]}", file=sys.stderr, flush=True)
    keys = ["files", "read", "no joint", "refused by all", "made", "asked", "refused", "wrong"]
    print("| package | " + " | ".join(keys) + " |\n|---|" + "--:|" * len(keys))
    total = sum(table.values(), collections.Counter())
    for name, row in [*sorted(table.items()), ("**all**", total)]:
        print(f"| {name} | " + " | ".join(str(row[key]) for key in keys) + " |")
    arms = total["made"] + total["asked"] + total["refused"] + total["wrong"]
    print(f"\nRefused although another reader reads it: {total['refused']} of {arms} ({100 * total['refused'] / max(arms, 1):.1f} %).")


if __name__ == "__main__":
    main()
