"""What a whole contact gave: the replay, the law that it ends with, and which of several is best."""
