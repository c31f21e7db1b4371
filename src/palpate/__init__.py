"""Real-time identification of contact models, from penetration, velocity and force."""

TYPE_CHECKING = False  # for the type checker; to import typing takes longer than all else here

if TYPE_CHECKING:
    from palpate._public import *  # noqa: F403 - they are listed there

    __version__: str
else:
    #: Modules that users name without the package in which they stand.
    _MODULES = {"figures": "palpate.output.figures"}

    # Imported at the first use of a public name, because the command line answers --help, and an
    # interrupt, without NumPy.
    def __getattr__(name: str) -> object:
        from importlib import import_module
        from importlib.util import find_spec

        if name == "__version__":
            from palpate._core import __version__

            return globals().setdefault(name, __version__)
        place = _MODULES.get(name, f"palpate.{name}")
        if find_spec(place):  # a module, for one of the package's own
            return import_module(place)
        public = vars(import_module("palpate._public"))
        offered = {each: public[each] for each in sorted(public) if not each.startswith("_")}
        globals().update(offered, __all__=list(offered))
        if name in globals():
            return globals()[name]
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return [*__getattr__("__all__"), "__version__"]
