"""A ROS 1 bag and what the conversion that armcal names makes of it -> tests/golden/bag/ros1.bag, ros1.mcap, ros1.txt.

Twelve poses of a two-joint arm before one tag. The command is the one in armcal's message; build it first:
cargo build --release --bins. The script stops where the converted file does not hold the messages of the bag.
"""

import math
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "tests" / "golden" / "bag"
START_NS = 1_500_000_000_000_000_000
N_POSES = 12

store = get_typestore(Stores.ROS1_NOETIC)
store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
types = store.types


def header(k, nanos, frame):
    stamp = types["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)
    return types["std_msgs/msg/Header"](seq=k, stamp=stamp, frame_id=frame)


def messages():
    """Time, topic and message, in the order of time."""
    for k in range(N_POSES):
        now = START_NS + k * 10**9
        yield now, "/joint_states", types["sensor_msgs/msg/JointState"](
            header=header(k, now, ""), name=["shoulder", "elbow"], position=np.array([0.1 * k, -0.05 * k]), velocity=np.array([]),
            effort=np.array([]))
        transform = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=0.1, y=0.02 * k, z=1.0),
            rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(0.05 * k), w=math.cos(0.05 * k)))
        stamped = types["geometry_msgs/msg/TransformStamped"](
            header=header(k, now, "camera"), child_frame_id="tag36h11:7", transform=transform)
        yield now + 10**6, "/tf", types["tf2_msgs/msg/TFMessage"](transforms=[stamped])


def advised_command(bag):
    """The command line in armcal's message about the bag."""
    said = subprocess.run([ROOT / "target/release/armcal", "inspect", bag], capture_output=True, text=True).stderr
    [command] = re.findall(r"`(rosbags-convert [^`]*)`", said)
    return command


def main():
    with tempfile.TemporaryDirectory() as scratch:
        bag = Path(scratch) / "ros1.bag"
        with Writer(bag) as writer:
            connections = {}
            for nanos, topic, message in messages():
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
                writer.write(connections[topic], nanos, store.serialize_ros1(message, message.__msgtype__))
        command = advised_command(bag)
        line = command.replace("IN.bag", str(bag)).replace("OUT", str(Path(scratch) / "ros1"))
        subprocess.run([Path(sys.executable).parent / shlex.split(line)[0], *shlex.split(line)[1:]], check=True)
        with Reader(Path(scratch) / "ros1") as reader:
            found = [(nanos, connection.topic) for connection, nanos, _ in reader.messages()]
        assert found == [(nanos, topic) for nanos, topic, _ in messages()], found
        OUT.mkdir(parents=True, exist_ok=True)
        shutil.copy(bag, OUT / "ros1.bag")
        shutil.copy(Path(scratch) / "ros1" / "ros1.mcap", OUT / "ros1.mcap")
        (OUT / "ros1.txt").write_text(command + "\n")
        print(command, (OUT / "ros1.bag").stat().st_size, (OUT / "ros1.mcap").stat().st_size, "bytes")


if __name__ == "__main__":
    main()
