"""What the wires have in common: addresses, the order of samples, messages of ROS, estimates."""
