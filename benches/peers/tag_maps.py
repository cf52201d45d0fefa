"""TagSLAM's own tests (github berndpfrommer/tagslam_test) through `armcal tagmap`, beside the maps that TagSLAM left there -> a table.

    tag_maps.py ARMCAL TESTS [NUMBER ...]

TESTS is the repository's folder `tests`, its .bag.bz2 as they are. Each has detections (ROS 1), cameras, tags, and the bag of TagSLAM's
own result. It is an output, no survey: the table says how far apart the maps are, and how well each fits the same corners. For that every
image, 300 at most, evenly, gets the camera pose that suits the map best (least squares with a soft loss of 1 px, both maps alike); the
figures are over all corners of the images that show tags of both. Odometry, planes and distances of a test are TagSLAM's alone; the
cameras of a rig are one body to TagSLAM and strangers to armcal. Times: armcal's processor time, whole command; TagSLAM, which needs
ROS 1, was not run.
"""

import bz2
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import yaml
from rosbags.rosbag1 import Reader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/oracle"))
from compare_real_arms import pose  # noqa: E402

TESTS = range(1, 25)
N_IMAGES = 300
LIMIT_S = 300
MESSAGES = """std_msgs/Header header
apriltag_msgs/AprilTagDetection[] detections
================================================================================
MSG: apriltag_msgs/AprilTagDetection
string family
int32 id
int32 hamming
float32 goodness
float32 decision_margin
apriltag_msgs/Point centre
apriltag_msgs/Point[4] corners
float64[9] homography
================================================================================
MSG: apriltag_msgs/Point
float64 x
float64 y
"""


def unpacked(tests, number, name, folder):
    """A bag of a test; the repository has links to other tests' bags."""
    plain, packed = tests / f"test_{number}" / name, tests / f"test_{number}" / f"{name}.bz2"
    if plain.is_symlink():
        packed = plain.parent / f"{plain.readlink()}.bz2"
    if not packed.exists():
        raise RuntimeError(f"no {packed.name}")
    out = folder / name
    out.write_bytes(bz2.decompress(packed.read_bytes()))
    return out


def bag(path):
    """(topic, stamp, message) of a ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader(path) as reader:
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        for connection, stamp, raw in reader.messages():
            yield connection.topic, stamp, store.deserialize_ros1(raw, connection.msgtype)


def convert(path, out):
    """As a ROS 2 recording of today's message; and the images: (topic, {tag: corners})."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(MESSAGES, "apriltag_msgs/msg/AprilTagDetectionArray"))
    types = store.types
    make = lambda name: types[f"apriltag_msgs/msg/{name}"]
    images, connections = [], {}
    with Writer(out, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, stamp, message in bag(path):
            if not hasattr(message, "apriltags"):
                continue
            found = [tag for tag in message.apriltags]
            images.append((topic, {tag.id: np.array([[c.x, c.y] for c in tag.corners]) for tag in found}))
            point = lambda p: make("Point")(x=p.x, y=p.y)
            tags = [make("AprilTagDetection")("36h11", t.id, t.hamming, 0.0, 0.0, point(t.center), [point(c) for c in t.corners], np.zeros(9))
                    for t in found]
            time = types["builtin_interfaces/msg/Time"](message.header.stamp.sec, message.header.stamp.nanosec)
            array = make("AprilTagDetectionArray")(types["std_msgs/msg/Header"](time, message.header.frame_id), tags)
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, array.__msgtype__, typestore=store)
            writer.write(connections[topic], stamp, store.serialize_cdr(array, array.__msgtype__))
    return images


def reference(path, moving):
    """map_from_tag of TagSLAM's result on bodies that stand still."""
    at = {}
    for topic, _, message in bag(path):
        if topic == "/tf":
            for t in message.transforms:
                p, q = t.transform.translation, t.transform.rotation
                at[t.header.frame_id, t.child_frame_id] = pose([p.x, p.y, p.z], Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix())
    tags = {}
    for (body, tag), place in at.items():
        if tag.startswith("tag_") and tag[4:].isdigit() and body not in moving:
            tags[int(tag[4:])] = at["map", body] @ place
    return tags


def ours(armcal, recording, test):
    """Tags and sizes in the frame that most are in, how many are in others, seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = [armcal, "tagmap", recording, "--camera", test / "cameras.yaml", "--tags", test / "tagslam.yaml", "--json"]
    run = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S)
    if run.returncode not in (0, 3):
        raise RuntimeError(f"`tagmap` ends with {run.returncode}: {run.stderr.strip().splitlines()[-1][:200]}")
    said = json.loads(run.stdout)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    # Groups that known tags hold are in one frame, that of their body; others each in their own.
    frames = [group.get("body", f"tag {group.get('tag')}") for group in said["groups"]]
    of = [frames[tag["group"]] for tag in said["tags"]]
    largest = max(frames, key=of.count)
    tags = {}
    for tag, frame in zip(said["tags"], of):
        if frame == largest:
            w, x, y, z = tag["quaternion_wxyz"]
            tags[tag["id"]] = (pose(tag["position_m"], Rotation.from_quat([x, y, z, w]).as_matrix()), tag["size_m"])
    return tags, len(said["tags"]) - len(tags), seconds


def square(size):
    h = 0.5 * size
    return np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])


def points(place, size):
    return square(size) @ place[:3, :3].T + place[:3, 3]


def distances_mm(theirs, mine):
    """Of the tags' centres, once all corners lie as near as they can."""
    ids = sorted(theirs.keys() & mine.keys())
    a = np.concatenate([points(theirs[i], mine[i][1]) for i in ids])
    b = np.concatenate([points(*mine[i]) for i in ids])
    u, _, vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    turn = vt.T @ np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    moved = (b - b.mean(0)) @ turn.T + a.mean(0)
    return 1e3 * np.linalg.norm((moved - a).reshape(-1, 4, 3).mean(axis=1), axis=1)


class Lens:
    def __init__(self, spec):
        fx, fy, cx, cy = spec["intrinsics"]
        self.matrix, self.distortion = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array(spec["distortion_coeffs"], float)
        self.is_fisheye = spec["distortion_model"] in ("equidistant", "fisheye")

    def project(self, points, x):
        args = points.reshape(-1, 1, 3), x[3:], x[:3], self.matrix, self.distortion
        return (cv2.fisheye.projectPoints(args[0], args[1], args[2], *args[3:])[0] if self.is_fisheye else cv2.projectPoints(*args)[0])[:, 0]

    def start(self, points, pixels):
        undistort = cv2.fisheye.undistortPoints if self.is_fisheye else cv2.undistortPoints
        flat = undistort(pixels.reshape(-1, 1, 2), self.matrix, self.distortion)
        _, r, t = cv2.solvePnP(points, flat, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
        return np.concatenate([t.ravel(), r.ravel()])


def misfits_px(lenses, images, tags):
    """Of each image's corners under the camera pose that suits the map best."""
    out = []
    for topic, seen in images:
        world = np.concatenate([points(*tags[i]) for i in seen])
        pixels = np.concatenate(list(seen.values()))
        fun = lambda x: (lenses[topic].project(world, x) - pixels).ravel()
        found = least_squares(fun, lenses[topic].start(world, pixels), loss="soft_l1", x_scale=[1, 1, 1, 0.3, 0.3, 0.3])
        out.append(np.linalg.norm(found.fun.reshape(-1, 2), axis=1))
    return np.concatenate(out)


def compared(armcal, tests, number, scratch):
    test = tests / f"test_{number}"
    if not (test / "tagslam.yaml").exists():
        raise RuntimeError("not there")
    spec = yaml.safe_load((test / "tagslam.yaml").read_text())
    moving = {name for body in spec["bodies"] for name, about in body.items() if not about.get("is_static", False)}
    cameras = yaml.safe_load((test / "cameras.yaml").read_text())
    lenses = {camera["tagtopic"]: Lens(camera) for camera in cameras.values()}
    images = convert(unpacked(tests, number, "tag_detections.bag", scratch), scratch / "detections")
    theirs = reference(unpacked(tests, number, "reference.bag", scratch), moving)
    mine, others, seconds = ours(armcal, next((scratch / "detections").glob("*.mcap")), test)
    common = theirs.keys() & mine.keys()
    if not common:
        raise RuntimeError(f"no tag that stands still in both maps ({len(theirs)} of TagSLAM's, {len(mine)} of armcal's)")
    shown = [(topic, {i: c for i, c in seen.items() if i in common}) for topic, seen in images]
    # A pose from one tag fits any map.
    shown = [image for image in shown if len(image[1]) > 1 and image[0] in lenses]
    shown = shown[::max(1, len(shown) // N_IMAGES)]
    off = distances_mm(theirs, mine)
    fits = [misfits_px(lenses, shown, tags) for tags in ({i: (theirs[i], mine[i][1]) for i in common}, mine)]
    figures = " | ".join(f"{np.median(f):.3f} / {np.percentile(f, 95):.2f}" for f in fits)
    more = f" + {others}" if others else ""
    return (f"{len(images)} | {len(theirs)} | {len(mine)}{more} | {len(common)} | {np.median(off):.1f} | {off.max():.1f} | {figures} | "
            f"{seconds:.1f}")


def main(armcal, tests, *numbers):
    print("| test | images | tags, TagSLAM | tags, armcal | both | apart, median, mm | largest | TagSLAM's map, corners off, median / 95 %, px | "
          "armcal's | armcal, s |\n|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|", flush=True)
    tests, notes = Path(tests), []
    for number in [int(word) for word in numbers] or TESTS:
        with tempfile.TemporaryDirectory() as scratch:
            try:
                print(f"| {number} | {compared(armcal, tests, number, Path(scratch))} |", flush=True)
            except (OSError, RuntimeError, ValueError, KeyError, subprocess.TimeoutExpired, cv2.error) as error:
                notes.append(f"{number}: {str(error)[:200]}")
    print("\nNot compared: " + "; ".join(notes) + ".")


if __name__ == "__main__":
    main(*sys.argv[1:])
