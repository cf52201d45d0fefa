"""A ROS 2 bag that `rosbags` wrote, once in SQLite and once in MCAP -> tests/golden/bag/.

Twelve poses of a two-joint arm before one tag, with an attitude sensor, and an image longer than a page of the file. Both files hold
the same messages; what other writers make of them is not in armcal's hands.
"""

import math
import shutil
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

OUT = Path(__file__).resolve().parents[1] / "golden" / "bag"
START_NS = 1_700_000_000_000_000_000
N_POSES = 12

store = get_typestore(Stores.ROS2_JAZZY)
types = store.types


def stamp(nanos):
    return types["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)


def header(nanos, frame):
    return types["std_msgs/msg/Header"](stamp=stamp(nanos), frame_id=frame)


def vector(x, y, z):
    return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)


def quaternion(angle):
    return types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(angle / 2), w=math.cos(angle / 2))


def messages():
    """Time, topic and message, in the order of time."""
    for k in range(N_POSES):
        now = START_NS + k * 10**9
        joints = types["sensor_msgs/msg/JointState"](
            header=header(now, ""), name=["shoulder", "elbow"], position=np.array([0.1 * k, -0.05 * k]), velocity=np.array([]),
            effort=np.array([]))
        yield now, "/joint_states", joints
        transform = types["geometry_msgs/msg/TransformStamped"](
            header=header(now, "camera"), child_frame_id="tag36h11:7",
            transform=types["geometry_msgs/msg/Transform"](translation=vector(0.1, 0.02 * k, 1.0), rotation=quaternion(0.1 * k)))
        yield now + 10**6, "/tf", types["tf2_msgs/msg/TFMessage"](transforms=[transform])
        zeros = np.zeros(9)
        imu = types["sensor_msgs/msg/Imu"](
            header=header(now, "imu"), orientation=quaternion(0.01 * k), orientation_covariance=zeros,
            angular_velocity=vector(0.0, 0.0, 0.0), angular_velocity_covariance=zeros, linear_acceleration=vector(0.0, 0.0, 9.81),
            linear_acceleration_covariance=zeros)
        yield now + 2 * 10**6, "/imu", imu
    image = types["sensor_msgs/msg/Image"](
        header=header(START_NS, "camera"), height=40, width=150, encoding="mono8", is_bigendian=0, step=150,
        data=(np.arange(6000) % 251).astype(np.uint8))
    yield START_NS + N_POSES * 10**9, "/image", image


def write(folder, plugin):
    with Writer(folder, version=9, storage_plugin=plugin) as bag:
        connections = {}
        for nanos, topic, message in messages():
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=store)
            bag.write(connections[topic], nanos, store.serialize_cdr(message, message.__msgtype__))


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        for plugin, ending in ((StoragePlugin.SQLITE3, "db3"), (StoragePlugin.MCAP, "mcap")):
            folder = Path(scratch) / "arm"
            write(folder, plugin)
            [made] = folder.glob(f"*.{ending}")
            shutil.copy(made, OUT / f"arm.{ending}")
            shutil.rmtree(folder)
    for file in sorted(OUT.iterdir()):
        print(file.name, file.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
