"""How an identification shows itself: in a line, in words, in a notebook, as a table, on disk."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from palpate.results.description import of_one
from palpate.results.frames import to_pandas, to_xarray
from palpate.results.summary import line, summary

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from palpate.identification import Identification


class Presented:
    """What an identification can be asked for by a person; its base."""

    @property
    def _self(self) -> "Identification":
        return cast("Identification", self)

    def __repr__(self) -> str:
        return line(self._self)

    def _repr_html_(self) -> str:
        """Shown by a notebook: verdict, numbers at working depth, and the law."""
        from palpate.reports.card import card  # above this module, as all that shows a result

        return card(self._self)

    def summary(self) -> str:
        """Return verdict, numbers, 95 % intervals, correlations and findings, as text."""
        return summary(self._self)

    def plot(self, *, dark: bool = False, width: float | None = None) -> "Figure":
        """Draw it: :func:`palpate.figures.draw`."""
        from palpate.figures import draw

        return draw(self._self, dark=dark, width=width)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return every sample, and what was known after it, as a frame indexed by time.

        ``penetration``, ``velocity``, ``force``, ``segment``, ``predicted_force`` (a priori),
        ``fitted_force`` (by the final law), ``status``, ``validity_margin``, and each parameter
        with the ``…_standard_error`` of that moment, SI; units are in ``attrs["units"]``. NaN
        where a thinned trace has no estimate. Needs pandas, of the extra ``notebook``.

        Raises
        ------
        MissingExtraError
            pandas is not installed.
        """
        return to_pandas(self._self)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the same along ``time``, the law's parameters along ``parameter``.

        Raises
        ------
        MissingExtraError
            xarray, of the extra ``notebook``, is not installed.
        """
        return to_xarray(self._self)

    def save(self, folder: str | Path) -> None:
        """Write report, numbers, trace and options to a folder; :func:`load_result` reads it back.

        ``report.html``, ``result.json``, ``trace.parquet`` (``.csv`` without pyarrow) and
        ``run.toml``, each whole or not at all.

        Parameters
        ----------
        folder : str or Path
            It is made where it is not there.

        Raises
        ------
        RecordingError
            It cannot be made or written to.
        MissingExtraError
            matplotlib, which the report needs, is not installed.
        """
        from palpate.reports.saving import Destination

        Destination(Path(folder)).save(self._self)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and words; what is not defined is None."""
        return of_one(self._self)
