"""Fig. 9: the double stage from starts near the truth."""
