"""An arm simulated in numpy: six joints, a wrist camera, four tags. Nothing here is armcal's but the folder that it reads."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import armcal

ORIGINS = np.array([[0, 0, 0.3], [0.08, 0, 0.12], [0, 0, 0.45], [0.2, 0, 0.04], [0.22, 0, 0], [0.09, 0, 0]])
AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
CENTER = np.array([0.0, 0.6, 0.4, 0.0, 0.5, 0.0])
SPREAD = np.array([0.5, 0.4, 0.4, 0.8, 0.5, 1.0])
LINK6_FROM_CAMERA = np.array([[0, 0, 1, 0.05], [-1, 0, 0, 0], [0, -1, 0, 0.06], [0, 0, 0, 1.0]])
TOOL = np.array([0.05, 0, 0.06])
COUNTS_PER_DEG, OFFSET_COUNTS = 180.0, 32768.0
GAIN_STD, OFFSET_STD_RAD = 0.01, 0.02
IMAGE_PX, FOCAL_PX, CENTER_PX, CORNER_STD_PX = (1280, 960), 900.0, (639.5, 479.5), 0.2
SIZE_M, BOARD_M = 0.15, np.array([1.2, 0.0, -0.4])
TAGS_M = BOARD_M + np.array([[-0.15, -0.15, 0], [0.15, -0.15, 0], [-0.15, 0.15, 0], [0.15, 0.15, 0.05]])
CORNERS_M = SIZE_M / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
POSES_RAD = np.array([[0.0, 0.6, 0.4, 0.0, 0.5, 0.0], [0.3, 0.3, 0.6, 0.2, 0.3, 0.5]])
TAG_STD_M, TAG_STD_RAD = 0.0005, 0.002


def turn(axis, angle):
    """Rodrigues' formula as a homogeneous matrix."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = np.eye(4)
    out[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return out


def base_from_link6(angles):
    at = np.eye(4)
    for origin, axis, angle in zip(ORIGINS, AXES, angles):
        step = np.eye(4)
        step[:3, 3] = origin
        at = at @ step @ turn(axis, angle)
    return at


def tool_m(angles):
    return base_from_link6(angles)[:3, :3] @ TOOL + base_from_link6(angles)[:3, 3]


def urdf():
    links = "".join(f'<link name="l{k}"/>' for k in range(7))
    joints = "".join(
        f'<joint name="j{k + 1}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="{" ".join(map(str, ORIGINS[k]))}"/>'
        f'<axis xyz="{" ".join(map(str, AXES[k]))}"/><limit lower="-2.8" upper="2.8" effort="1" velocity="1"/></joint>' for k in range(6))
    camera = ('<link name="camera"/><joint name="c" type="fixed"><parent link="l6"/><child link="camera"/>'
              '<origin xyz="0.05 0 0.06" rpy="-1.57079632679 0 -1.57079632679"/></joint>')
    return f'<robot name="numpy_arm">{links}{joints}{camera}</robot>'


def robot_toml():
    sensors = "".join(
        f'[[joint_sensor]]\njoint = "j{k + 1}"\nkind = "potentiometer"\nscale_counts_per_deg = {COUNTS_PER_DEG}\n'
        f'offset_counts = {OFFSET_COUNTS}\nwrap_counts = 65536\nnoise_std_counts = 0.5\ngain_std = {GAIN_STD}\ngain_bound = 0.1\n'
        f'offset_std_rad = {OFFSET_STD_RAD}\noffset_bound_rad = 0.1\nlinearity_std_rad = 0.0\nmax_rate_rad_s = 0.5\n' for k in range(6))
    return (f'version = 1\nkind = "robot"\nname = "numpy-arm"\nurdf = "arm.urdf"\nbase_link = "l0"\n'
            f'[tool]\nlink = "l6"\npoint_m = {TOOL.tolist()}\n'
            f'[geometry]\nlink_position_std_m = 0.0\nlink_rotation_std_rad = 0.0\ntool_position_std_m = 0.0\n'
            f'[camera]\nname = "wrist"\nlink = "camera"\nmount_std_m = 0.002\nmount_std_rad = 0.005\ncorner_std_px = {CORNER_STD_PX}\n'
            f'model = "pinhole"\nresolution_px = {list(IMAGE_PX)}\nfocal_px = [{FOCAL_PX}, {FOCAL_PX}]\ncenter_px = {list(CENTER_PX)}\n'
            f'distortion = [0.0, 0.0, 0.0, 0.0]\n{sensors}')


@dataclass
class Measured:
    """A simulated arm's arrays, and the truth that no estimator sees."""

    counts: np.ndarray
    view: np.ndarray
    tag: np.ndarray
    corners_px: np.ndarray
    gain: np.ndarray
    offset_rad: np.ndarray

    def arrays(self):
        return {"counts": self.counts, "view": self.view, "tag": self.tag, "corners_px": self.corners_px}

    def true_angles(self, counts):
        """Angle by a reading: the middle of each joint's range is zero."""
        travel = (np.asarray(counts) - OFFSET_COUNTS) / np.degrees(COUNTS_PER_DEG)
        return self.gain * travel + self.offset_rad


def project(camera_from_base, at):
    """Pixels of a tag's corners; None where one is out of the image."""
    points = (at + CORNERS_M) @ camera_from_base[:3, :3].T + camera_from_base[:3, 3]
    pixels = CENTER_PX + FOCAL_PX * points[:, :2] / points[:, 2:]
    is_seen = (points[:, 2] > 0).all() and (pixels > 0).all() and (pixels < np.array(IMAGE_PX) - 1).all()
    return pixels if is_seen else None


def measure(seed, n_views=30):
    rng = np.random.default_rng(seed)
    gain, offset = 1 + rng.normal(0, GAIN_STD, 6), rng.normal(0, OFFSET_STD_RAD, 6)
    mount = LINK6_FROM_CAMERA.copy()
    mount[:3, 3] += rng.normal(0, 0.002, 3)
    lean = rng.normal(0, 0.005, 3)
    mount = mount @ turn(lean / np.linalg.norm(lean), np.linalg.norm(lean))
    tags = TAGS_M + rng.normal(0, TAG_STD_M, TAGS_M.shape)
    counts, view, tag, corners = [], [], [], []
    while len(counts) < n_views:
        angles = CENTER + rng.uniform(-1, 1, 6) * SPREAD
        camera_from_base = np.linalg.inv(base_from_link6(angles) @ mount)
        seen = [(number, pixels) for number, at in enumerate(tags) if (pixels := project(camera_from_base, at)) is not None]
        if len(seen) < 2:
            continue
        for number, pixels in seen:
            view.append(len(counts))
            tag.append(number)
            corners.append(pixels + rng.normal(0, CORNER_STD_PX, (4, 2)))
        exact = (angles - offset) / gain * np.degrees(COUNTS_PER_DEG) + OFFSET_COUNTS
        counts.append(exact + rng.normal(0, 0.5, 6))
    return Measured(np.array(counts), np.array(view), np.array(tag), np.array(corners), gain, offset)


@pytest.fixture(scope="session")
def robot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("numpy-arm")
    (folder / "arm.urdf").write_text(urdf())
    (folder / "robot.toml").write_text(robot_toml())
    return armcal.Robot.load(folder)


def tag_map():
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, :3, 3] = TAGS_M
    return armcal.TagMap.from_poses("l0", range(4), poses, size_m=SIZE_M, position_std_m=TAG_STD_M, rotation_std_rad=TAG_STD_RAD)


@pytest.fixture(scope="session")
def tags():
    return tag_map()


@pytest.fixture(scope="session")
def task():
    return armcal.Task(poses_rad=POSES_RAD, tolerance_m=0.02)


@pytest.fixture(scope="session")
def measured():
    return measure(1)


@pytest.fixture(scope="session")
def cal(robot, tags, task, measured):
    return armcal.calibrate(robot, armcal.Views.from_arrays(robot, **measured.arrays()), tags=tags, task=task)


@pytest.fixture(scope="session")
def program():
    """The program of the same profile, by which .ci/run compares."""
    return Path(os.environ["ARMCAL"])
