"""How accurate identification is: every result with its bound and the paper's method.

``python -m benchmarks.accuracy`` runs all parts; ``docs/validation/accuracy`` has the results.
"""
