"""Identify many contacts: a pure function from a table of contacts to a table of results.

:func:`palpate.identify_many` runs it in this process, :mod:`palpate.fleet.running` on Dask; Ray and
Spark can call :func:`palpate.fleet.running.identify_batch` directly. Needs the extra ``fleet``.
"""
