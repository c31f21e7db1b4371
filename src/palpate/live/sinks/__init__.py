"""What becomes of what the loop found: a page, a recording, a line on the console."""
