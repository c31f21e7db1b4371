"""Figs. 8, 13 and 16 with Tables I to VI: the methods side by side, from several starts."""
