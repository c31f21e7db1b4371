"""Figs. 5, 11 and 14: three repetitions."""
