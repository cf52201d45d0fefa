"""An arm behind ROS 2 topics that shares no line with armcal: Eclipse Cyclone DDS by its Python package.

usage: ros2_arm.py LOG.jsonl START.json
START.json: {"names": [...], "counts": [...], "rate_counts": [...], "wrap_counts": [...]}; joints follow their set-points
the short way round, no faster than `rate_counts` a second. Readings go out at 50 Hz; LOG gets a line for each set-point and each stop. Ends when killed.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class JointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: Time


@dataclass
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    header: Header
    joint_names: sequence[str]
    points: sequence[JointTrajectoryPoint]


@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


PERIOD_S = 0.02


def main():
    log = open(sys.argv[1], "w", buffering=1)
    start = json.load(open(sys.argv[2]))
    names, counts = start["names"], list(start["counts"])
    goal, is_stopped = list(counts), False

    # As ROS 2 publishes sensor data, and as its drivers subscribe.
    offered = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
    asked = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10))
    participant = DomainParticipant(0)
    subscriber, publisher = Subscriber(participant), Publisher(participant)
    sensors = DataWriter(publisher, Topic(participant, "rt/joint_sensors", JointState, qos=offered), qos=offered)
    commands = DataReader(subscriber, Topic(participant, "rt/joint_commands", JointTrajectory, qos=asked), qos=asked)
    stops = DataReader(subscriber, Topic(participant, "rt/stop", Bool, qos=asked), qos=asked)

    began, n = time.monotonic(), 0
    while True:
        for message in commands.take(100):
            points = dict(zip(message.joint_names, message.points[-1].positions))
            goal = [points[name] for name in names]
            log.write(json.dumps({"at_s": time.monotonic() - began, "set_point": goal}) + "\n")
        for message in stops.take(100):
            is_stopped = is_stopped or message.data
            log.write(json.dumps({"at_s": time.monotonic() - began, "stop": message.data}) + "\n")
        if not is_stopped:
            for joint, (most, wrap) in enumerate(zip(start["rate_counts"], start["wrap_counts"])):
                way = (goal[joint] - counts[joint] + wrap / 2) % wrap - wrap / 2
                counts[joint] = (counts[joint] + max(-most * PERIOD_S, min(most * PERIOD_S, way))) % wrap
        now = time.time_ns()
        header = Header(Time(now // 1_000_000_000, now % 1_000_000_000), "")
        # The last count is noise.
        sensors.write(JointState(header, names, [round(count) + n % 2 for count in counts], [], []))
        n += 1
        time.sleep(max(0.0, began + n * PERIOD_S - time.monotonic()))


if __name__ == "__main__":
    main()
