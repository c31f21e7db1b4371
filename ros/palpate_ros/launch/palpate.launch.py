"""Start the node that identifies the contact, and with controller:=true the example beside it."""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Return both nodes with the parameters of a file."""
    defaults = f"{get_package_share_directory('palpate_ros')}/config/palpate.yaml"
    parameters = LaunchConfiguration("parameters")
    topics = [
        ("pose", LaunchConfiguration("pose")),
        ("wrench", LaunchConfiguration("wrench")),
        ("joint_states", LaunchConfiguration("joint_states")),
    ]
    return LaunchDescription(
        [
            DeclareLaunchArgument("parameters", default_value=defaults),
            DeclareLaunchArgument("pose", default_value="/pose"),
            DeclareLaunchArgument("wrench", default_value="/wrench"),
            DeclareLaunchArgument("joint_states", default_value="/joint_states"),
            DeclareLaunchArgument("controller", default_value="false"),
            Node(
                package="palpate_ros",
                executable="identify_contact",
                name="identify_contact",
                parameters=[parameters],
                remappings=topics,
            ),
            Node(
                package="palpate_ros",
                executable="controller",
                name="controller",
                parameters=[parameters],
                remappings=topics,
                condition=IfCondition(LaunchConfiguration("controller")),
            ),
        ]
    )
