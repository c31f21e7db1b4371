"""How accurate identification is: every figure beside the bound, the target and the paper's method.

``python -m benchmarks.accuracy`` runs all rows; ``docs/accuracy.md`` keeps what it printed.
"""
