"""Where the C++ headers lie."""

from pathlib import Path

import palpate


def get_include() -> str:
    """Return the folder of the C++ headers, for ``-I``.

    A wheel brings them with it, and a CMake package, which ``find_package(palpate)`` finds with the
    folder above this one in ``CMAKE_PREFIX_PATH``; an editable install uses those of its source.

    Returns
    -------
    str
        The folder that holds ``palpate/palpate.hpp``.

    Examples
    --------
    >>> import palpate
    >>> from pathlib import Path
    >>> Path(palpate.get_include(), "palpate", "palpate.hpp").exists()
    True
    """
    source = Path(__file__).parents[2]
    folders = [Path(each, "include") for each in palpate.__path__] + [source / "include"]
    return str(next(each for each in folders if each.is_dir()))
