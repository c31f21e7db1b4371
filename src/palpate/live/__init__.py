"""Real-time identification: a loop between a source of samples and sinks of results.

:func:`run` takes samples from a source one at a time, prepares each and updates the estimate with
it before the next one arrives, and writes the results into shared memory. Sinks, such as the page
and the recorder, read them there, each in a separate process.
"""

from palpate.live.running import run as run
