"""Drake: a law as one point contact or as several."""
