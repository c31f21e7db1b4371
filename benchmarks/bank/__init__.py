"""Simulated recordings with known truth, and one fault each: for the benchmarks and the tests."""
