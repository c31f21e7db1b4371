"""What a whole contact gave: its replay, its law, and which of several laws is best."""
