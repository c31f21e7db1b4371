"""The experiments of Haddadi & Hashtrudi-Zaad (2012), repeated in simulation: ``python -m paper``.

``trials``, ``methods``, ``motions`` and ``changes`` contain the experiments, ``claims.toml`` the
paper's claims about them, and ``judging.py`` the conditions under which a claim holds.
"""
