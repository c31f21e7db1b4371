"""Figs. 6, 12 and 15: the condition (10) over time."""
