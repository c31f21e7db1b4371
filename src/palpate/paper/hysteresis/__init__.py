"""Fig. 10: the loop of force and penetration near the surface."""
