"""Independent reference simulators: probing simulated by engines that nobody here wrote."""
