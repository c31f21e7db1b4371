"""Drake: a law as one point contact, as several, or as a hydroelastic slab."""
