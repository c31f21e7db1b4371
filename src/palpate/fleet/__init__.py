"""Many contacts at once: one pure function from a table of contacts to a table of what they are.

:func:`palpate.identify_many` runs it here, :mod:`palpate.fleet.running` on Dask; Ray and Spark take
:func:`palpate.fleet.running.identify_batch` as it is. Needs the extra ``fleet``.
"""
