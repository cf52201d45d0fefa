"""A relay between an arm and armcal that shares no line with armcal: it passes messages on, and does one fault.

usage: ros2_relay.py LOG.jsonl FAULT [KEY=VALUE...]
The arm is in ROS domain 1, armcal in ROS domain 0, with the same topics. The fault begins at the set-point number `after`
of those that differ from the one before (default 50). Times are Unix seconds. FAULT is one of
  none
  lose      a `share` of all messages, both ways
  delay     every message by `s`, both ways
  step      stamps of the arm's clock leap by `s`
  freeze    joint readings stay as they are, with new stamps
  repeat    the last joint readings again and again, with their old stamps
  spike     one reading of joint number `joint` is off by `counts`
  jump      all readings of joint number `joint` are off by `counts`
  ignore    no set-point reaches the arm
  cut       nothing passes for `s`
LOG gets a line for each set-point and stop that armcal sent, with the time at which it did, for each joint reading that
was passed on, and for the fault. Ends when killed.
"""

import heapq
import json
import random
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from ros2_arm import Bool, Header, JointState, JointTrajectory


@dataclass
class Point(IdlStruct, typename="apriltag_msgs::msg::dds_::Point_"):
    x: float64
    y: float64


@dataclass
class AprilTagDetection(IdlStruct, typename="apriltag_msgs::msg::dds_::AprilTagDetection_"):
    family: str
    id: int32
    hamming: int32
    goodness: float32
    decision_margin: float32
    centre: Point
    corners: array[Point, 4]
    homography: array[float64, 9]


@dataclass
class AprilTagDetectionArray(IdlStruct, typename="apriltag_msgs::msg::dds_::AprilTagDetectionArray_"):
    header: Header
    detections: sequence[AprilTagDetection]


@dataclass
class Temperature(IdlStruct, typename="sensor_msgs::msg::dds_::Temperature_"):
    header: Header
    temperature: float64
    variance: float64


@dataclass
class FluidPressure(IdlStruct, typename="sensor_msgs::msg::dds_::FluidPressure_"):
    header: Header
    fluid_pressure: float64
    variance: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


ARM, ARMCAL = 1, 0
FROM_ARM = {
    "joint_sensors": JointState,
    "camera/wrist/detections": AprilTagDetectionArray,
    "temperature/oil": Temperature,
    "temperature/water": Temperature,
    "depth_pressure": FluidPressure,
    "vehicle/imu": Imu,
}
TO_ARM = {"joint_commands": JointTrajectory, "stop": Bool}
RELIABLE = Policy.Reliability.Reliable(duration(milliseconds=100))
# As ROS 2 publishes sensor data.
OFFERED = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(100))
COMMANDED = Qos(RELIABLE, Policy.History.KeepLast(100))
ASKED = Qos(RELIABLE, Policy.History.KeepLast(10000))


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


class Fault:
    """What is done to messages from a moment on."""

    def __init__(self, kind, keys):
        self.kind, self.keys = kind, keys
        self.began_s = None
        self.held = None
        self.chance = random.Random(1)

    def is_on(self):
        return self.began_s is not None

    def passes(self, topic):
        """Whether the message goes on."""
        if not self.is_on():
            return True
        if self.kind == "cut":
            return time.time() - self.began_s > self.keys["s"]
        if self.kind == "lose":
            return self.chance.random() >= self.keys["share"]
        return not (self.kind == "ignore" and topic == "joint_commands")

    def delay_s(self):
        return self.keys["s"] if self.is_on() and self.kind == "delay" else 0.0

    def change(self, topic, message):
        """Spoils a message of the arm."""
        if not self.is_on():
            return
        if self.kind == "step":
            nanos = round(1e9 * (seconds(message.header.stamp) + self.keys["s"]))
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanos, 1_000_000_000)
        if topic != "joint_sensors":
            return
        if self.kind in ("freeze", "repeat"):
            self.held = self.held or (message.header.stamp, list(message.position))
            message.position = self.held[1]
            if self.kind == "repeat":
                message.header.stamp = self.held[0]
        if self.kind == "jump" or (self.kind == "spike" and self.held is None):
            self.held = True
            message.position[int(self.keys["joint"])] += self.keys["counts"]


class Relay:
    """Both domains, and what is on its way between them."""

    def __init__(self, log, fault):
        self.log, self.fault = log, fault
        self.last, self.n_moves, self.after = None, 0, fault.keys.pop("after", 50)
        self.pending, self.n_pending = [], 0
        participants = {domain: DomainParticipant(domain) for domain in (ARM, ARMCAL)}
        self.ways = [self.way(participants, ARM, ARMCAL, *item, OFFERED) for item in FROM_ARM.items()]
        self.ways += [self.way(participants, ARMCAL, ARM, *item, COMMANDED) for item in TO_ARM.items()]

    @staticmethod
    def way(participants, source, target, topic, kind, offered):
        ends = [Topic(participants[domain], f"rt/{topic}", kind) for domain in (source, target)]
        reader = DataReader(Subscriber(participants[source]), ends[0], qos=ASKED)
        writer = DataWriter(Publisher(participants[target]), ends[1], qos=offered)
        return topic, reader, writer

    def write(self, at_s, **what):
        self.log.write(json.dumps({"at_s": at_s, **what}) + "\n")

    def hear(self, topic, message):
        """Logs what armcal sent, and begins the fault."""
        sent_s = 1e-9 * message.sample_info.source_timestamp
        if topic == "stop":
            self.write(sent_s, stop=message.data)
        if topic != "joint_commands":
            return
        positions = list(message.points[-1].positions)
        self.write(sent_s, set_point=positions, stamp_s=seconds(message.header.stamp))
        self.n_moves += self.last is not None and positions != self.last
        self.last = positions
        if not self.fault.is_on() and self.n_moves >= self.after:
            self.fault.began_s = time.time()
            self.write(self.fault.began_s, fault=self.fault.kind)

    def send(self, topic, writer, message):
        if topic == "joint_sensors":
            self.write(time.time(), reading=list(message.position), stamp_s=seconds(message.header.stamp))
        writer.write(message)

    def turn(self):
        for topic, reader, writer in self.ways:
            for message in reader.take(1000):
                if not message.sample_info.valid_data:
                    continue
                self.hear(topic, message)
                if not self.fault.passes(topic):
                    continue
                if topic in FROM_ARM:
                    self.fault.change(topic, message)
                due_s = time.monotonic() + self.fault.delay_s()
                self.n_pending += 1
                heapq.heappush(self.pending, (due_s, self.n_pending, topic, writer, message))
        while self.pending and self.pending[0][0] <= time.monotonic():
            self.send(*heapq.heappop(self.pending)[2:])


def main():
    keys = {key: float(value) for key, value in (pair.split("=") for pair in sys.argv[3:])}
    relay = Relay(open(sys.argv[1], "w", buffering=1), Fault(sys.argv[2], keys))
    while True:
        relay.turn()
        time.sleep(0.001)


if __name__ == "__main__":
    main()
