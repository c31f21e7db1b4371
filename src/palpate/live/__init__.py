"""The loop in real time: sources on one side, sinks on the other.

:func:`run` takes samples from a source, one at a time, prepares and learns each before the next
one comes, and writes what it found into a ring in shared memory. Sinks, such as the page and the
recorder, read it from processes of their own.
"""

from palpate.live.running import run as run
