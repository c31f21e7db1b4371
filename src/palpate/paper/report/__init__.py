"""What becomes of the claims, on a page and as JSON."""
