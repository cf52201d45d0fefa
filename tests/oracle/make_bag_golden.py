"""A ROS 2 bag that `rosbags` wrote, once in SQLite and once in MCAP -> tests/golden/bag/; fuzz/corpus/bag/.

Twelve poses of a two-joint arm before one tag, with an attitude sensor, and an image longer than a page of the file. Both files hold
the same messages; what other writers make of them is not in armcal's hands.

The corpus has the first messages of fuzz/corpus/recording/views.mcap in small pages, and those that follow in a log of writes, as a
recorder leaves it that was killed.
"""

import math
import shutil
import sqlite3
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_typestore

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "tests" / "golden" / "bag"
CORPUS = ROOT / "fuzz" / "corpus"
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


def write_corpus(scratch):
    """Of each topic a few messages; page size 512."""
    reader = McapReader(CORPUS / "recording" / "views.mcap")
    reader.open()
    kept, counts = [], {}
    for connection, nanos, data in reader.messages(reader.connections):
        counts[connection.topic] = counts.get(connection.topic, 0) + 1
        if counts[connection.topic] <= 6:
            kept.append((connection.topic, connection.msgtype, nanos, data))
    file = Path(scratch) / "arm.db3"
    bag = sqlite3.connect(file, isolation_level=None)
    bag.execute("PRAGMA page_size=512")
    bag.execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL)")
    bag.execute("INSERT INTO schema VALUES(3,'humble')")
    bag.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT,type TEXT,serialization_format TEXT,offered_qos_profiles TEXT)")
    bag.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
    topics = {}
    bag.execute("PRAGMA journal_mode=WAL")
    bag.execute("PRAGMA wal_autocheckpoint=0")
    bag.execute("BEGIN")
    for k, (topic, kind, nanos, data) in enumerate(kept):
        if topic not in topics:
            topics[topic] = len(topics) + 1
            bag.execute("INSERT INTO topics VALUES(?,?,?,'cdr','')", (topics[topic], topic, kind))
        bag.execute("INSERT INTO messages VALUES(NULL,?,?,?)", (topics[topic], nanos, data))
        if k == len(kept) * 2 // 3:
            bag.execute("COMMIT")
            bag.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            bag.execute("BEGIN")
    bag.execute("COMMIT")
    (CORPUS / "bag").mkdir(exist_ok=True)
    for name in ("arm.db3", "arm.db3-wal"):
        shutil.copy(Path(scratch) / name, CORPUS / "bag" / name)
        print(name, (CORPUS / "bag" / name).stat().st_size, "bytes")
    bag.close()


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        for plugin, ending in ((StoragePlugin.SQLITE3, "db3"), (StoragePlugin.MCAP, "mcap")):
            folder = Path(scratch) / "arm"
            write(folder, plugin)
            [made] = folder.glob(f"*.{ending}")
            shutil.copy(made, OUT / f"arm.{ending}")
            shutil.rmtree(folder)
        write_corpus(scratch)
    for file in sorted(OUT.iterdir()):
        print(file.name, file.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
