"""Laws and formats of other packages: entry points of ``palpate.laws`` and ``palpate.formats``.

They are loaded when a law or a format is asked for that palpate does not have: palpate's own need
no metadata of packages.
"""

import logging
import os
from collections.abc import Callable
from typing import Any

_LOGGER = logging.getLogger(__name__)
#: The environment variable of ``--no-plugins``; worker processes inherit it.
SWITCH = "PALPATE_NO_PLUGINS"
_loaded = set[str]()


def load_plugins(group: str, add: Callable[[Any], object]) -> None:
    """Load the entry points of a group, at most once, and add what they name.

    A warning of one line reports an entry point that fails; the others are loaded.

    Parameters
    ----------
    group : str
        ``"palpate.laws"`` or ``"palpate.formats"``.
    add : callable
        Registers the loaded object, or raises.
    """
    if group in _loaded or os.environ.get(SWITCH):
        return
    _loaded.add(group)
    from importlib.metadata import entry_points

    for point in entry_points(group=group):
        try:
            add(point.load())
        except (Exception, SystemExit) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            _LOGGER.warning(
                "plugin %s (%s) of %s is not loaded: %s; mend it, or switch plugins off by %s=1",
                point.name,
                point.value,
                group,
                reason,
                SWITCH,
            )
