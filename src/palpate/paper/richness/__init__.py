"""Figs. 17 and 18: two sines and one."""
