"""What the benchmarks share: tables, the machine, timing, workers, materials and recordings."""
