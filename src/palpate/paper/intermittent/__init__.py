"""Fig. 19: a soft and a hard zone in turn."""
