"""Recordings that `armcal run` made, as other tools take them: views of corners and joint angles by the datasheet, rests at the targets.

Nothing here is armcal's but the files: robot.toml, the URDF, run.mcap, and truth.mcap for the errors alone.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from compare_real_arms import chain, pose
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[2]


def quaternion_wxyz(q):
    return Rotation.from_quat([q[1], q[2], q[3], q[0]]).as_matrix()


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


class Drawing:
    """What robot.toml and its URDF say: sensors, lens, surveyed tags, and the chain to the camera."""

    def __init__(self, folder):
        folder = Path(folder)
        robot = tomllib.loads((folder / "robot.toml").read_text())
        self.urdf = folder / robot["urdf"]
        self.camera_chain = chain(self.urdf, robot["camera"]["link"])
        self.joints = [name for _, name, _ in self.camera_chain if name]
        self.sensors = [s for s in robot["joint_sensor"] if s["joint"] in self.joints]
        self.camera = robot["camera"]
        self.tags = {t["id"]: t for t in robot["tag"]}
        limits = self.limits()
        self.center = np.array([0.5 * sum(limits[name]) for name in self.joints])
        # The tool's point lies on the last axis: in the camera's frame it stands still whatever the last joint does.
        tool_chain = chain(self.urdf, robot["tool"]["link"])
        tool = np.append(robot["tool"]["point_m"], 1.0)
        at = lambda last: forward(tool_chain, np.append(self.center, last))[-1] @ tool
        assert np.allclose(at(0.0), at(1.0), atol=1e-9), "the tool is off the last axis"
        self.camera_from_tool = (np.linalg.inv(forward(self.camera_chain, self.center)[-1]) @ at(0.0))[:3]

    def limits(self):
        import xml.etree.ElementTree as ET

        joints = {j.get("name"): j.find("limit") for j in ET.parse(self.urdf).getroot().iter("joint")}
        return {name: (float(joints[name].get("lower")), float(joints[name].get("upper"))) for name in self.joints}

    def travel(self, counts):
        """Travel about the middle of each joint's range by the datasheet, rad."""
        out = []
        for raw, sensor, center in zip(counts, self.sensors, self.center):
            per_rad = np.degrees(sensor["scale_counts_per_deg"])
            half = 0.5 * sensor["wrap_counts"]
            lead = raw - sensor["offset_counts"] - center * per_rad
            out.append(((lead + half) % sensor["wrap_counts"] - half) / per_rad)
        return np.array(out)

    def base_from_tag(self, tag_id):
        tag = self.tags[tag_id]
        return pose(tag["position_m"], quaternion_wxyz(tag["quaternion_wxyz"]))

    def corners(self, tag_id):
        """In the tag's frame: bottom left, bottom right, top right, top left."""
        h = 0.5 * self.tags[tag_id]["size_m"]
        return np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])

    def project(self, points):
        """Pixels of points in the camera's frame, and their derivatives (n x 2 x 3): Kannala and Brandt's fisheye."""
        x, y, z = points.T
        r = np.hypot(x, y)
        angle = np.arctan2(r, z)
        k = np.array(self.camera["distortion"])
        powers = angle[:, None] ** np.array([3, 5, 7, 9])
        radius = angle + powers @ k
        slope = 1 + (angle[:, None] ** np.array([2, 4, 6, 8])) @ (k * [3, 5, 7, 9])
        f, c = np.array(self.camera["focal_px"]), np.array(self.camera["center_px"])
        unit = np.stack([x, y], 1) / r[:, None]
        pixels = c + f * radius[:, None] * unit
        d_angle = np.stack([z * x / r, z * y / r, -r], 1) / (r * r + z * z)[:, None]
        d_unit = np.zeros((len(points), 2, 3))
        d_unit[:, 0, 0], d_unit[:, 0, 1] = y * y / r ** 3, -x * y / r ** 3
        d_unit[:, 1, 0], d_unit[:, 1, 1] = -x * y / r ** 3, x * x / r ** 3
        jacobian = slope[:, None, None] * unit[:, :, None] * d_angle[:, None, :] + radius[:, None, None] * d_unit
        return pixels, f[None, :, None] * jacobian


def forward(links, angles):
    """base_from_link after each joint that moves (without the fixed ones behind it), and of the last link."""
    at, k, out = np.eye(4), 0, []
    for fixed, name, axis in links:
        at = at @ fixed
        if name:
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angles[k] * axis / np.linalg.norm(axis)).as_matrix()
            at, k = at @ turn, k + 1
            out.append(at)
    return out + [at]


@dataclass
class View:
    """The arm at rest before its tags."""

    travel: np.ndarray
    corners: dict  # tag: mean pixels, 4 x 2
    frames: dict  # tag: how many images


@dataclass
class Rest:
    """The arm at rest at a target after `armcal run` calibrated it, and where its tool truly was, base frame."""

    travel: np.ndarray
    tool_m: np.ndarray


def messages(path):
    """(topic, log time in ns, message)."""
    store = get_typestore(Stores.ROS2_JAZZY)
    reader = McapReader(Path(path))
    reader.open()
    for connection in reader.connections:
        if not connection.msgtype.startswith("foxglove"):
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    wanted = [c for c in reader.connections if not c.msgtype.startswith("foxglove")]
    for connection, stamp, data in reader.messages(wanted):
        yield connection.topic, stamp, store.deserialize_cdr(data, connection.msgtype)


def nanos(stamp):
    return stamp.sec * 10 ** 9 + stamp.nanosec


def read(folder, drawing):
    """Views of the capture, rests of the reaches after it."""
    readings, detections, marks = [], [], []
    for topic, _, message in messages(Path(folder) / "run.mcap"):
        if topic == "/joint_sensors":
            readings.append((nanos(message.header.stamp), drawing.travel(message.position)))
        elif topic.endswith("/detections"):
            detections.append((nanos(message.header.stamp), message.detections))
        elif topic == "/marks":
            marks.append((message.kind, nanos(message.start), nanos(message.end)))
    stamps = np.array([stamp for stamp, _ in readings])
    travels = np.array([travel for _, travel in readings])
    mean = lambda start, end: travels[np.searchsorted(stamps, start):np.searchsorted(stamps, end, "right")].mean(axis=0)
    views = []
    for kind, start, end in marks:
        if kind != "capture_fit":
            continue
        seen = {}
        for stamp, found in detections:
            if start <= stamp <= end:
                for tag in found:
                    seen.setdefault(tag.id, []).append([[p.x, p.y] for p in tag.corners])
        views.append(View(mean(start, end), {t: np.mean(c, axis=0) for t, c in seen.items()}, {t: len(c) for t, c in seen.items()}))
    truth = [(nanos(m.header.stamp), m.pose.position) for topic, _, m in messages(Path(folder) / "truth.mcap") if topic == "/truth/tool_pose"]
    when = np.array([stamp for stamp, _ in truth])
    rests = []
    for kind, start, end in marks:
        if kind == "reach_after":
            at = truth[int(np.argmin(abs(when - (start + end) // 2)))][1]
            rests.append(Rest(mean(start, end), np.array([at.x, at.y, at.z])))
    return views, rests


def located(drawing, view, start):
    """base_from_camera from the surveyed tags' corners alone: what a marker's pose by PnP is. From `start`, for the lens is a fisheye's."""
    points = np.concatenate([drawing.corners(t) @ drawing.base_from_tag(t)[:3, :3].T + drawing.base_from_tag(t)[:3, 3] for t in view.corners])
    pixels = np.concatenate(list(view.corners.values()))

    def camera(x):
        return start @ pose(x[:3], Rotation.from_rotvec(x[3:]).as_matrix())

    def residuals(x):
        at = camera(x)
        return (drawing.project((points - at[:3, 3]) @ at[:3, :3])[0] - pixels).ravel()

    found = least_squares(residuals, np.zeros(6), x_scale="jac")
    rms = np.sqrt((found.fun ** 2).mean())
    assert rms < 20, f"no pose fits: {rms:.1f} px"
    return camera(found.x), rms


def reprojection_px(drawing, view, base_from_camera, places=None):
    """All corners of a view, n x 2, against the surveyed tags, or against tags at `places`."""
    out = []
    for tag, pixels in view.corners.items():
        place = (places or {}).get(tag, drawing.base_from_tag(tag))
        points = drawing.corners(tag) @ place[:3, :3].T + place[:3, 3]
        out.append(drawing.project((points - base_from_camera[:3, 3]) @ base_from_camera[:3, :3])[0] - pixels)
    return np.concatenate(out)


def rms_px(rows):
    """Of distances in the image, corner by corner."""
    return np.sqrt((np.concatenate(rows) ** 2).sum(axis=1).mean())


def tool_errors_mm(rests, tool_of):
    return 1e3 * np.array([np.linalg.norm(tool_of(rest.travel) - rest.tool_m) for rest in rests])
