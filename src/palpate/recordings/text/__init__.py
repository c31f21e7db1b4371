"""Tables as text: from bytes to lines, from lines to cells, from cells to columns."""
