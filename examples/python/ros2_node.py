"""ROS 2 node: calibrated joint angles on /joint_states of the raw readings on /joint_sensors.

    ros2_node.py ROBOT CALIBRATION.toml
"""

import sys
from pathlib import Path

import armcal
import rclpy
from sensor_msgs.msg import JointState

robot = armcal.Robot.load(sys.argv[1])
cal = armcal.Calibration.load(Path(sys.argv[2]), robot)
if cal.status != "accepted":
    sys.exit(f"do not use it: {cal.refusal}")

rclpy.init()
node = rclpy.create_node("calibrated_joints")
angles = node.create_publisher(JointState, "joint_states", 10)


def publish(raw: JointState) -> None:
    counts = [raw.position[raw.name.index(joint)] for joint in robot.joints]
    angles.publish(JointState(header=raw.header, name=robot.joints, position=cal.angles(counts).tolist()))


node.create_subscription(JointState, "joint_sensors", publish, 10)
rclpy.spin(node)
