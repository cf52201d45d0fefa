"""Joint readings, zeros and focal lengths falsified one by one in a plain recording: verdict, true tool error and first cause -> a table.

    readings.py ARMCAL [OUT.csv]

The recording is tests/cases/targets_out_of_reach (40 views of a six-joint arm that simulates no fault, tag corners). Its readings are
rewritten, or robot.toml's lens and the task are changed. The true tool error of an accepted result is the largest distance, over 200 random
configurations, between the tool by this result and by the calibration of the plain recording. Needs numpy and mcap==1.4.0 from PyPI.
"""

import csv
import json
import math
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

CASE = Path(__file__).parents[2] / "tests/cases/targets_out_of_reach"
JOINTS = [f"j{k}" for k in range(1, 7)]
ORIGINS = np.array([[0, 0, 0.3], [0.08, 0, 0.12], [0, 0, 0.45], [0.2, 0, 0.04], [0.22, 0, 0], [0.09, 0, 0]])
AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
TOOL = np.array([0.12, 0, 0])
FACTORS = [0.01, math.radians(1), 0.1, 0.25, 0.5, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.25, 2.0, 4.0, 10.0, math.degrees(1), 100.0]
ZEROS_DEG = [1, 2, 5, 10, 20, 45, 90, 135, 180]
FOCAL = [0.5, 0.6, 0.75, 0.9, 0.97, 1.03, 1.1, 1.333, 1.5, 2.0]
TOLERANCE_M = 0.01


def aligned(offset, to):
    return 4 + (offset - 4 + to - 1) // to * to


def positions(data):
    """Names, offset of the positions and the positions of a sensor_msgs/JointState in CDR."""
    at = 12
    at = aligned(at + 4 + struct.unpack_from("<I", data, at)[0], 4)
    names = []
    (n,) = struct.unpack_from("<I", data, at)
    at += 4
    for _ in range(n):
        at = aligned(at, 4)
        (length,) = struct.unpack_from("<I", data, at)
        names.append(data[at + 4:at + 3 + length].decode())
        at += 4 + length
    at = aligned(at, 4)
    (n,) = struct.unpack_from("<I", data, at)
    at = aligned(at + 4, 8)
    return names, at, struct.unpack_from(f"<{n}d", data, at)


def rewrite(target, topic, change):
    """The case's recording with the bytes of each message on `topic` changed."""
    with open(CASE / "run.mcap", "rb") as old, open(target, "wb") as new:
        writer, schemas, channels = Writer(new), {}, {}
        writer.start(profile="ros2")
        for schema, channel, message in make_reader(old).iter_messages():
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata)
            data = change(message.data) if channel.topic == topic else message.data
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()


def with_readings(data, change):
    names, at, read = positions(data)
    changed = change(dict(zip(names, read)))
    return data[:at] + struct.pack(f"<{len(read)}d", *[changed[name] for name in names]) + data[at + 8 * len(read):]


def with_focal_length(data, k):
    """A camera_info with `k` times its focal length: the largest number that K and P repeat."""
    numbers = [struct.unpack_from("<d", data, at)[0] for at in range(4, len(data) - 7)]
    focal = max(value for value in numbers if 300 < value < 3000 and numbers.count(value) >= 2)
    return data.replace(struct.pack("<d", focal), struct.pack("<d", k * focal))


def turn(axis, angle):
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def tool(angles):
    at, rotation = np.zeros(3), np.eye(3)
    for origin, axis, angle in zip(ORIGINS, AXES, angles):
        at, rotation = at + rotation @ origin, rotation @ turn(axis, angle)
    return at + rotation @ TOOL


def angles_by(folder):
    """Function from readings to angles by calibration.toml, its straight part."""
    joints = tomllib.loads((folder / "out/calibration.toml").read_text())["joint"]
    gain = np.array([joint["gain_rad_per_count"] for joint in joints])
    center = np.array([joint["center_rad"] for joint in joints])
    offset = np.array([joint["offset_rad"] for joint in joints])
    return lambda readings: center + gain * (readings - center) + offset


def calibrate(armcal, folder, change=None, task=None):
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(CASE, folder)
    poses = [[0.3, 0.4, 0.4, 0.2, 0.5, 0.1], [-0.3, 0.6, 0.3, -0.4, 0.4, -0.5]]
    (folder / "task.toml").write_text(task or f"version = 1\nkind = \"task\"\ntolerance_m = {TOLERANCE_M}\nposes_rad = {poses}\n")
    if callable(change):
        rewrite(folder / "run.mcap", "/joint_states", lambda data: with_readings(data, change))
    words = [armcal, "calibrate", "run.mcap", "--robot", "robot", "--input", "input.toml", "--tag-map", "tags.toml", "--task", "task.toml",
             "--out", "out"]
    return lambda: subprocess.run(words, cwd=folder, capture_output=True, text=True)


def cases():
    """(kind, change of the readings, codes that name it)."""
    for joint in ("j2", "j4", "j6"):
        for k in FACTORS:
            yield f"{joint} times {k:.4g}", lambda q, j=joint, k=k: {**q, j: k * q[j]}, {"sensor_line", "sensor_unit", "beyond_datasheet"}
    for joint in JOINTS:
        for deg in ZEROS_DEG:
            yield f"zero of {joint} by {deg} deg", lambda q, j=joint, d=deg: {**q, j: q[j] + math.radians(d)}, {"joint_zeros", "beyond_datasheet"}
    for deg in ZEROS_DEG:
        yield (f"zeros of j2 and j3 by {deg} and -{deg} deg",
               lambda q, d=deg: {**q, "j2": q["j2"] + math.radians(d), "j3": q["j3"] - math.radians(d)}, {"joint_zeros", "beyond_datasheet"})
    for a in range(6):
        for b in range(a + 1, 6):
            i, k = JOINTS[a], JOINTS[b]
            yield f"{i} and {k} exchanged", lambda q, i=i, k=k: {**q, i: q[k], k: q[i]}, {"joints_exchanged"}
    for a in range(1, 6):
        for sign in (1, -1):
            i, k = JOINTS[a], JOINTS[a - 1]
            yield f"{i} with {sign:+d} times {k}", lambda q, i=i, k=k, s=sign: {**q, i: q[i] + s * q[k]}, {"joints_coupled"}
    for joint in JOINTS:
        yield f"{joint} of other sign", lambda q, j=joint: {**q, j: -q[j]}, {"sensor_line"}
    yield "0 to 360 deg", lambda q: {name: value % (2 * math.pi) for name, value in q.items()}, {"joint_turns"}


def judge(folder, done, plain, change):
    """Verdict, U95, true tool error, first code."""
    if done.returncode == 2:
        return "error", None, None, re.findall(r"\[(\w+)\]\s*$", done.stderr.strip())[-1:]
    summary = json.loads((folder / "out/summary.json").read_text())
    verdict, u95_m = summary["verdict"], (summary.get("u95_m") or {}).get("max")
    error_m = None
    if done.returncode in (0, 3):
        rng, own = np.random.default_rng(1), angles_by(folder)
        configurations = [0.0, 0.5, 0.4, 0.0, 0.4, 0.0] + rng.uniform(-0.5, 0.5, (200, 6))
        changed = [np.array([change(dict(zip(JOINTS, q)))[j] for j in JOINTS]) for q in configurations] if change else configurations
        error_m = max(np.linalg.norm(tool(own(there)) - tool(plain(q))) for q, there in zip(configurations, changed))
    return verdict["grade"], u95_m, error_m, verdict["codes"]


def main(armcal, out=None):
    armcal, rows, wrong, unnamed = Path(armcal).resolve(), [], 0, 0
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder) / "case"
        calibrate(armcal, folder)()
        plain = angles_by(folder)

        def row(kind, done, change, names):
            nonlocal wrong, unnamed
            grade, u95_m, error_m, codes = judge(folder, done, plain, change)
            is_wrong = error_m is not None and (u95_m is None or error_m > 3 * u95_m)
            # What is accepted within U95 needs no name.
            is_unnamed = grade in ("refused", "error") and not (codes and codes[0] in names)
            wrong, unnamed = wrong + is_wrong, unnamed + is_unnamed
            show = lambda m: "" if m is None else f"{1e3 * m:.2f}"
            rows.append([kind, grade, show(u95_m), show(error_m), codes[0] if codes else "", "WRONGLY ACCEPTED" if is_wrong else "OTHER CAUSE" if is_unnamed else ""])
            print("| " + " | ".join(rows[-1]) + " |", flush=True)

        print("| change | verdict | U95, mm | true tool error, mm | first code | |\n|---|---|--:|--:|---|---|")
        for kind, change, names in cases():
            row(kind, calibrate(armcal, folder, change)(), change, names)
        for k in FOCAL:
            kind = f"focal length times {k:.4g}"
            run = calibrate(armcal, folder)
            rewrite(folder / "run.mcap", "/camera_info", lambda data, k=k: with_focal_length(data, k))
            row(kind, run(), None, {"lens_contradicted", "input_image_size", "lens"})
        for kind, xyz, names in [("a target 5 m away", [5.0, 0.0, 0.5], {"targets_not_judged"}), ("a target in reach", [0.7, 0.1, 0.8], set())]:
            row(kind, calibrate(armcal, folder, task=f"version = 1\nkind = \"task\"\ntolerance_m = {TOLERANCE_M}\ntargets_m = [{xyz}]\n")(), None, names)
    print(f"\n{len(rows)} calibrations; accepted while off by more than 3 U95: {wrong}; refused for another cause: {unnamed}")
    if out:
        with open(out, "w", newline="") as file:
            csv.writer(file).writerows(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
