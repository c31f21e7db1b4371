"""Publishes wrenches and poses by real ROS 1; run by the Python that has rospy, not by ours.

Arguments: how many, and how many seconds apart. The numbers are those of ``numbers`` below.
"""

import random
import sys
import time


def numbers(count):
    """Rows of six forces and torques and seven of a pose, the same wherever they are asked for."""
    source = random.Random(7)
    return [[source.gauss(0.0, 1.0) for _ in range(13)] for _ in range(count)]


def publish(count, pause):
    """Publish as soon as a recorder listens."""
    import rospy
    from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3, WrenchStamped

    rospy.init_node("probe", disable_signals=True)
    forces = rospy.Publisher("/ft", WrenchStamped, queue_size=count)
    poses = rospy.Publisher("/pose", PoseStamped, queue_size=count)
    deadline = time.monotonic() + 20.0
    while not (forces.get_num_connections() and poses.get_num_connections()):
        if time.monotonic() > deadline:
            sys.exit("no recorder listens")
        time.sleep(0.02)
    for k, row in enumerate(numbers(count)):
        wrench, pose = WrenchStamped(), PoseStamped()
        wrench.header.stamp = pose.header.stamp = rospy.Time(1_700_000_000, 1_000_000 * k)
        wrench.header.frame_id, pose.header.frame_id = "sensor", "base"
        wrench.wrench.force, wrench.wrench.torque = Vector3(*row[:3]), Vector3(*row[3:6])
        pose.pose.position, pose.pose.orientation = Point(*row[6:9]), Quaternion(*row[9:])
        forces.publish(wrench)
        poses.publish(pose)
        time.sleep(pause)
    time.sleep(0.5)  # for the recorder to take the last ones


if __name__ == "__main__":
    publish(int(sys.argv[1]), float(sys.argv[2]))
