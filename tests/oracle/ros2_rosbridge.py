"""A rosbridge that shares no line with armcal: protocol 2 as ROS 1 spells it on one side, ROS 2 over Cyclone DDS on the other.

usage: ros2_rosbridge.py LOG.jsonl PORT
It listens on 127.0.0.1, and knows the topics of an arm. Whatever is not spelled as ROS 1 does is answered with a status of
level "error" and goes no further. LOG gets a line for each set-point, stop and call of the service /halt, with the time, Unix
seconds, and one for each error. Ends when killed.
"""

import asyncio
import dataclasses
import json
import math
import sys
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosed

from ros2_arm import Bool, Header, JointState, JointTrajectory, JointTrajectoryPoint, Time
from ros2_relay import COMMANDED, FROM_ARM

ASKED = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(100))
PACKAGES = {
    "AprilTagDetectionArray": "apriltag_msgs",
    "JointTrajectory": "trajectory_msgs",
    "Bool": "std_msgs",
}


def type_name(kind):
    return f"{PACKAGES.get(kind.__name__, 'sensor_msgs')}/{kind.__name__}"


def spelled(value, seq):
    """A message as JSON of ROS 1."""
    if isinstance(value, Time):
        return {"secs": value.sec, "nsecs": value.nanosec}
    if dataclasses.is_dataclass(value):
        fields = {field.name: spelled(getattr(value, field.name), seq) for field in dataclasses.fields(value)}
        return {"seq": seq, **fields} if isinstance(value, Header) else fields
    if isinstance(value, (list, tuple)):
        return [spelled(item, seq) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def fields(value, *names):
    """The fields of an object that has these and no others."""
    if set(value) != set(names):
        raise ValueError(f"fields {sorted(value)}, not {sorted(names)}")
    return [value[name] for name in names]


def read_time(value):
    secs, nsecs = fields(value, "secs", "nsecs")
    return Time(int(secs), int(nsecs))


def read_trajectory(value):
    header, names, points = fields(value, "header", "joint_names", "points")
    _, stamp, frame = fields(header, "seq", "stamp", "frame_id")
    point = lambda value: JointTrajectoryPoint(*value[:4], read_time(value[4]))
    names_of_point = ("positions", "velocities", "accelerations", "effort", "time_from_start")
    return JointTrajectory(Header(read_time(stamp), frame), names, [point(fields(p, *names_of_point)) for p in points])


def read_bool(value):
    (data,) = fields(value, "data")
    return Bool(data)


TO_ARM = {"joint_commands": (JointTrajectory, read_trajectory), "stop": (Bool, read_bool)}


class Bridge:
    """What one client asked for."""

    def __init__(self, log, participant):
        self.log, self.participant = log, participant
        self.readers, self.writers, self.seq = {}, {}, 0

    def write(self, **what):
        self.log.write(json.dumps({"at_s": time.time(), **what}) + "\n")

    def subscribe(self, message):
        topic = message["topic"].removeprefix("/")
        kind = FROM_ARM[topic]
        self.check_type(message, kind)
        dds_topic = Topic(self.participant, f"rt/{topic}", kind)
        self.readers[topic] = DataReader(Subscriber(self.participant), dds_topic, qos=ASKED)

    def advertise(self, message):
        topic = message["topic"].removeprefix("/")
        kind, _ = TO_ARM[topic]
        self.check_type(message, kind)
        dds_topic = Topic(self.participant, f"rt/{topic}", kind)
        self.writers[topic] = DataWriter(Publisher(self.participant), dds_topic, qos=COMMANDED)

    @staticmethod
    def check_type(message, kind):
        if message["type"] != type_name(kind):
            raise ValueError(f"type {message['type']}, not {type_name(kind)}")

    def publish(self, message):
        topic = message["topic"].removeprefix("/")
        _, read = TO_ARM[topic]
        read_message = read(message["msg"])
        if topic == "stop":
            self.write(stop=read_message.data)
        else:
            self.write(set_point=list(read_message.points[-1].positions))
        self.writers[topic].write(read_message)

    def call_service(self, message):
        if message["service"] != "/halt":
            raise ValueError(f"no service {message['service']}")
        self.write(service=message["service"])
        values = {"success": True, "message": "the arm holds"}
        return {"op": "service_response", "service": "/halt", "id": message.get("id"), "values": values, "result": True}

    async def hear(self, socket):
        """What the client says."""
        operations = {"subscribe", "advertise", "publish", "call_service"}
        async for text in socket:
            message = json.loads(text)
            try:
                if message["op"] not in operations:
                    raise ValueError(f"op {message['op']}")
                answer = getattr(self, message["op"])(message)
            except (KeyError, TypeError, ValueError) as error:
                self.write(error=repr(error))
                answer = {"op": "status", "level": "error", "msg": repr(error)}
            if answer:
                await socket.send(json.dumps(answer))

    async def tell(self, socket):
        """What the arm says."""
        while True:
            for topic, reader in list(self.readers.items()):
                for message in reader.take(1000):
                    if message.sample_info.valid_data:
                        self.seq += 1
                        told = {"op": "publish", "topic": f"/{topic}", "msg": spelled(message, self.seq)}
                        await socket.send(json.dumps(told))
            await asyncio.sleep(0.001)


async def main():
    log, port = open(sys.argv[1], "a", buffering=1), int(sys.argv[2])
    participant = DomainParticipant(0)

    async def play(socket):
        bridge = Bridge(log, participant)
        telling = asyncio.create_task(bridge.tell(socket))
        try:
            await bridge.hear(socket)
        except ConnectionClosed:
            pass
        finally:
            telling.cancel()

    async with serve(play, "127.0.0.1", port) as server:
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
