"""How accurate identification is: every figure beside its bound and the paper's method.

``python -m benchmarks.accuracy`` runs all parts; ``docs/accuracy`` keeps what it printed.
"""
