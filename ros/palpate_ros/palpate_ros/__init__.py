"""palpate as a ROS 2 node; the modules without ``node`` in their name need no ROS."""
