"""The measurements of :mod:`benchmarks.fleet`, one module each."""
