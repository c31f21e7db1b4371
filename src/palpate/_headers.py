"""Where the C++ headers lie."""

from pathlib import Path


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
    package = Path(__file__).parent
    wheel = package / "include"
    source = package.parents[1] / "include"
    return str(wheel if wheel.is_dir() else source)
