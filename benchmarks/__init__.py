"""Benchmarks of speed, memory and accuracy: ratios within one run, printed as tables."""
