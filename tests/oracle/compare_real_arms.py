"""Recordings of real arms, held out: a fit of our own in SciPy beside armcal's, in the same measures -> a table on stdout.

    compare_real_arms.py NAME RECORDING.mcap ARM.urdf CAMERA_LINK BOARD_LINK OUT_DIR RAD_M

CAMERA_LINK carries the camera, BOARD_LINK the board; one of them moves. The recording has /joint_states in radians and on /tf one pose
of the board in the camera's frame for each pose of the arm, as those of docs/reference/real-arms.md have. OUT_DIR is the `--out` of
`armcal calibrate` on it, whose summary.json has armcal's own figures.

Fits: camera and board alone; with an offset and a gain for each joint; with the places of the links as well, under priors of 2 mm and
5 mrad. A radian weighs as RAD_M metres: its noise over that of a place, by armcal's result. Each fifth of the poses is held out in turn; of franka, too, the odd poses from the even ones.

Two measures: the camera's place as seen from the board, and the board's place as seen from the camera; with the distance between them
an error of an angle weighs differently in the two.
"""

import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_typestore
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

LINK_STD = np.array([2e-3] * 3 + [5e-3] * 3)
GAIN_STD, OFFSET_STD = 0.01, 0.05


def pose(translation, rotation):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation, translation
    return out


def small(six):
    return pose(six[:3], Rotation.from_rotvec(six[3:]).as_matrix())


def chain(urdf, link):
    """Joints from the root to a link: (fixed pose, name or None, axis)."""
    joints = {j.find("child").get("link"): j for j in ET.parse(urdf).getroot().iter("joint")}
    out = []
    while link in joints:
        joint = joints[link]
        origin = joint.find("origin")
        numbers = lambda key: [float(v) for v in (origin.get(key) if origin is not None and origin.get(key) else "0 0 0").split()]
        fixed = pose(numbers("xyz"), Rotation.from_euler("xyz", numbers("rpy")).as_matrix())
        moves = joint.get("type") != "fixed"
        axis = [float(v) for v in joint.find("axis").get("xyz").split()] if moves else [0, 0, 1]
        out.insert(0, (fixed, joint.get("name") if moves else None, np.array(axis)))
        link = joint.find("parent").get("link")
    return out


def mcap_messages(path):
    """(topic, message) of an MCAP file whose schemas are ROS 2's."""
    store = get_typestore(Stores.ROS2_JAZZY)
    reader = McapReader(Path(path))
    reader.open()
    for connection, _, data in reader.messages(reader.connections):
        yield connection.topic, store.deserialize_cdr(data, connection.msgtype)


def read(path):
    """Readings by joint, and camera_from_board, of each pose."""
    readings, seen = [], []
    for topic, message in mcap_messages(path):
        if topic == "/joint_states":
            readings.append(dict(zip(message.name, message.position)))
        elif topic == "/tf":
            t = message.transforms[0].transform
            r = Rotation.from_quat([t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w])
            seen.append(pose([t.translation.x, t.translation.y, t.translation.z], r.as_matrix()))
    assert len(readings) == len(seen), (len(readings), len(seen))
    return readings, np.array(seen)


class Fit:
    def __init__(self, urdf, camera, board, data, level, rad_m):
        self.rad_m = rad_m
        self.chains = chain(urdf, camera), chain(urdf, board)
        rows, self.seen = data
        self.names = sorted({name for c in self.chains for _, name, _ in c if name})
        self.readings = {name: np.array([row[name] for row in rows]) for name in self.names}
        self.level = level
        self.n = 12 + (2 * len(self.names) if level >= 1 else 0) + (6 * len(self.names) if level >= 2 else 0)

    def frames(self, which, x):
        """Of the camera or the board at all poses."""
        out = np.broadcast_to(np.eye(4), (len(self.seen), 4, 4))
        for fixed, name, axis in self.chains[which]:
            if not name:
                out = out @ fixed
                continue
            j = self.names.index(name)
            offset, gain = (x[12 + 2 * j], x[13 + 2 * j]) if self.level >= 1 else (0.0, 0.0)
            if self.level >= 2:
                at = 12 + 2 * len(self.names) + 6 * j
                fixed = fixed @ small(x[at:at + 6])
            turns = np.zeros_like(self.seen)
            turns[:, 3, 3] = 1.0
            turns[:, :3, :3] = Rotation.from_rotvec(np.outer(self.readings[name] * (1 + gain) + offset, axis)).as_matrix()
            out = out @ fixed @ turns
        return out @ small(x[6 * which:6 * which + 6])

    def predicted(self, x):
        return np.linalg.inv(self.frames(0, x)) @ self.frames(1, x)

    def residuals(self, x, poses):
        off = (np.linalg.inv(self.seen) @ self.predicted(x))[poses]
        turns = Rotation.from_matrix(off[:, :3, :3]).as_rotvec()
        out = [off[:, :3, 3].ravel(), self.rad_m * turns.ravel()]
        # Priors weigh as if poses were measured to 1 mm.
        n = len(self.names)
        if self.level >= 1:
            out.append(1e-3 * x[12:12 + 2 * n] / np.tile([OFFSET_STD, GAIN_STD], n))
        if self.level >= 2:
            out.append(1e-3 * x[12 + 2 * n:] / np.tile(LINK_STD, n))
        return np.concatenate(out)

    def start(self):
        """Camera and board so that the first poses fit: a few random turns, the best one."""
        rng = np.random.default_rng(1)
        best = None
        for trial in range(40):
            x = np.zeros(self.n)
            x[3:6] = 0 if trial == 0 else Rotation.random(random_state=rng).as_rotvec()
            # The board where the first pose has it, seen from such a camera.
            link = np.linalg.inv(self.frames(1, x)[0]) @ self.frames(0, x)[0] @ self.seen[0]
            x[6:9], x[9:12] = link[:3, 3], Rotation.from_matrix(link[:3, :3]).as_rotvec()
            poses = np.arange(0, len(self.seen), max(1, len(self.seen) // 20))
            found = least_squares(self.residuals, x, args=(poses,), loss="linear", max_nfev=60)
            if best is None or found.cost < best.cost:
                best = found
        return best.x

    def errors_mm(self, x, poses):
        """Of each pose: the camera seen from the board, the board seen from the camera."""
        measured, predicted = self.seen[poses], self.predicted(x)[poses]
        camera = np.linalg.inv(measured)[:, :3, 3] - np.linalg.inv(predicted)[:, :3, 3]
        return 1e3 * np.stack([np.linalg.norm(camera, axis=1), np.linalg.norm((measured - predicted)[:, :3, 3], axis=1)], axis=1)


def held_out(fit, start, folds):
    everything = range(len(fit.seen))
    out = []
    for fold in folds:
        train = [k for k in everything if k not in fold]
        x = least_squares(fit.residuals, start, args=(train,), max_nfev=200).x
        out.extend(fit.errors_mm(x, fold))
    return np.array(out)


def row(name, what, errors):
    mean, rms = errors.mean(axis=0), np.sqrt((errors ** 2).mean(axis=0))
    print(f"| {name} | {what} | {mean[0]:.2f} | {mean[1]:.2f} | {rms[1]:.2f} |", flush=True)


def main():
    name, recording, urdf, camera, board, out = sys.argv[1:7]
    rad_m = float(sys.argv[7])
    data = read(recording)
    n = len(data[1])
    print("| arm | fit | camera from the board, mean mm | board from the camera, mean mm | rms mm |\n|---|---|--:|--:|--:|")
    start = Fit(urdf, camera, board, data, 0, rad_m).start()
    for level, what in enumerate(["camera and board alone", "with offsets and gains", "with links, 2 mm and 5 mrad"]):
        fit = Fit(urdf, camera, board, data, level, rad_m)
        x = np.zeros(fit.n)
        x[:12] = start
        row(name, f"{what}; fifths in turn", held_out(fit, x, [list(range(k, n, 5)) for k in range(5)]))
        if name == "franka":
            row(name, f"{what}; odd poses from even ones", held_out(fit, x, [list(range(1, n, 2))]))
    held = json.loads((Path(out) / "summary.json").read_text())["held_out"]
    figures = [held.get(key) for key in ("camera_mean_m", "mean_m", "rms_m")]
    print(f"| {name} | armcal; fifths in turn | " + " | ".join("-" if v is None else f"{1e3 * v:.2f}" for v in figures) + " |")


if __name__ == "__main__":
    main()
