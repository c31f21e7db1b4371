"""The output: results, figures and reports."""
