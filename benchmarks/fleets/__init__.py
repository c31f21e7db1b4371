"""What :mod:`benchmarks.fleet` measures, a module each."""
