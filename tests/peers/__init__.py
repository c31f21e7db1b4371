"""Independent witnesses: probing simulated by engines that nobody here wrote."""
