"""Output and input of an identification: numbers, tables, text and files."""
