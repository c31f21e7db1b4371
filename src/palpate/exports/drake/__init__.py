"""Drake: a law as one contact of points, as several, or as a slab of springs."""
