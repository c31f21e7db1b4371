"""An identification on its way out: as numbers, tables, words and files, and back."""
