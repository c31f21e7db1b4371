"""Identify a whole contact, with one estimator or with all of them side by side."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.contact import Contact
from palpate.diagnosis import Data, Diagnosis
from palpate.errors import InvalidParameterError
from palpate.estimators import ESTIMATORS, ContactEstimator
from palpate.estimators.by_law import estimator_by_law
from palpate.estimators.contact_estimator import Rejection, known_exponent
from palpate.estimators.estimate import Traced, checked_trace
from palpate.identification.identified import Identified
from palpate.preparation.gates import choose_gate
from palpate.preparation.preparing import Recorded, prepare
from palpate.results import view
from palpate.settings import ContactGate

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


class Identification(Identified):
    """What a whole contact gave.

    Attributes
    ----------
    contact : Contact
        What was identified.
    estimator : ContactEstimator
        As it stood after the last sample; it can go on.
    trace : Trace
        Every sample, on the contact's clock, with the estimates that :func:`palpate.identify` was
        asked for.
    findings : tuple of Finding
        What the estimate leaves open, and what is to be known of the samples; the diagnosis has
        them too. ``flags`` has them in words.
    data : Data, optional
        The contact with the checks of its channels, where several methods share them.
    depth : float, optional
        The working depth of the diagnosis, m; the median penetration taken unless given.
    segments : tuple of Identification
        One for each stretch between changes of the material, by :meth:`by_segment`.
    noticed : Trace, optional
        With a change detector, by :meth:`by_segment`.
    place : Place, optional
        Where on the material it is, by :meth:`by_place`.
    chosen : tuple of str
        The settings that were left open, and chosen from the data.
    query : QueryOptions
        The impact and the tip that derived numbers are for, by :meth:`with_query`.
    traced : int, float, "full" or False
        How much of a trace was requested; of its stretches and places too.
    """

    segments: tuple["Identification", ...]

    def __repr__(self) -> str:
        return view.line(self)

    def _repr_html_(self) -> str:
        """Shown by a notebook: verdict, numbers at working depth, and the law."""
        from palpate.reports.identification import card

        return card(self)

    def summary(self) -> str:
        """Return verdict, numbers, 95 % intervals, correlations and findings, as text."""
        return view.summary(self)

    def plot(self, *, dark: bool = False, width: float | None = None) -> "Figure":
        """Draw it: :func:`palpate.figures.draw`."""
        from palpate.figures import draw

        return draw(self, dark=dark, width=width)

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
        from palpate.results.saved import to_pandas

        return to_pandas(self)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the same along ``time``, the law's parameters along ``parameter``.

        Raises
        ------
        MissingExtraError
            xarray, of the extra ``notebook``, is not installed.
        """
        from palpate.results.saved import to_xarray

        return to_xarray(self)

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
        from palpate.reports.identification import Destination

        Destination(Path(folder)).save(self)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and words; what is not defined is None."""
        from palpate.results.saved import of_one

        return of_one(self)


def identify(
    source: "Contact | Recorded",
    estimator: ContactEstimator | str | None = None,
    *,
    law: str | None = None,
    trace: Traced = 2000,
) -> Identification:
    """Identify the contact model of a whole contact.

    The samples go one by one through the estimator's own recursion, a segment at a time.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        What is not yet a contact is prepared by :func:`prepare`, with its default columns.
    estimator : ContactEstimator or str, optional
        Method and settings; it is left as it is. Or the name of a method, such as
        ``"single-stage"``. :class:`VariableProjection` unless given. A ``gate`` or ``scale`` it
        leaves open (None) is chosen from the data: see :mod:`palpate.preparation.gates`; but
        variable projection chooses its samples itself, and knows what a tare left of the offset by
        the contact's ``tare_deviation``. Outliers are left out by :class:`OutlierRejection` unless
        ``outlier_rejection`` is False.
    law : str, optional
        In place of an estimator, or beside the name of one that identifies it. ``"auto"``: the
        everyday law by which these samples are best explained; ``"any"``: of all that there are;
        or one by name: ``"hunt-crossley"``, which is the default, ``"kelvin-voigt"``,
        ``"half-space"``, or by its memory ``"flat"``, ``"single"``, ``"power-law"``, or by both,
        ``"half-space+single"``. :class:`ViscoelasticContact` says what they are, and
        :attr:`Identification.law_verdict` by what evidence one was chosen.
    trace : int, float, "full" or False
        What :attr:`Identification.trace` holds of the estimates along the way. An int: at most so
        many, after samples evenly spread up to the last one. A float: one every so many seconds, in
        [1e-9, 1e9]; ``trace=2.0`` is 2 s, ``trace=2`` two estimates. ``"full"``: one after every
        sample, which takes several times as long by variable projection. False: none. The result,
        its diagnosis, its figures, and what a trace says of each sample are the same bits.

    Raises
    ------
    RecordingError
        The recording cannot be prepared; the probe never touches: no sample passes the gate; or a
        search for the surface has no free approach: fewer than 20 samples lie above the surface
        that it found.
    InvalidParameterError
        The source is none of these, there is no such estimator or law, they do not go together, or
        ``trace`` is none of these.
    """
    traced, estimator = checked_trace(trace), _asked_for(estimator, law)  # before reading anything
    contact = source if isinstance(source, Contact) else prepare(source)
    return Identification.of(Data(contact), estimator, trace=traced)


def diagnose(
    source: "Contact | Recorded",
    estimator: ContactEstimator | str | None = None,
    *,
    law: str | None = None,
    depth: float | None = None,
) -> Diagnosis:
    """Say what may be wrong with the identification of a contact, and how far to trust it.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        As for :func:`identify`.
    estimator : ContactEstimator or str, optional
    law : str, optional
        As for :func:`identify`.
    depth : float, optional
        The working depth, m; the median penetration of the samples taken unless given.
    """
    result = identify(source, estimator, law=law, trace=False)
    return (result if depth is None else result.at_depth(depth)).diagnosis


def compare(
    source: "Contact | Recorded",
    *,
    gate: ContactGate | None = None,
    outlier_rejection: Rejection = None,
    exponent: float | None = None,
    trace: Traced = 2000,
    watch: Callable[[Sequence[str]], Iterable[str]] = iter,
    known: Identification | None = None,
) -> dict[str, Identification]:
    """Identify a contact with every method.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        As for :func:`identify`.
    gate : ContactGate, optional
        Which samples are contact, for every method. Unless given it is chosen from the data, the
        same for all but variable projection, which chooses its samples itself.
    outlier_rejection : OutlierRejection or False, optional
        How outliers are left out; False takes them all.
    exponent : float, optional
        Where the shape of the tip tells it, such as 1.5 for a sphere: kept by every method whose
        law has one. A method that cannot keep one so small or large is left out.
    trace : int, float, "full" or False
        As for :func:`identify`.
    watch : callable
        Goes through the methods' names, such as with a progress bar.
    known : Identification, optional
        Of this contact: it is the answer of its own method, unless that was asked for otherwise.

    Returns
    -------
    dict
        An :class:`Identification` for each name in ``ESTIMATORS`` but those left out.
    """
    traced = checked_trace(trace)
    contact = source if isinstance(source, Contact) else prepare(source)
    chosen = choose_gate(contact) if gate is None else gate
    data = (known and known.data) or Data(contact)  # checked once for all methods
    results = {}
    kept = known_exponent(exponent)
    able = [
        name
        for name, kind in ESTIMATORS.items()
        if kept is None or kind.exponents[0] <= kept <= kind.exponents[1]
    ]
    for name in watch(able):
        kind = ESTIMATORS[name]
        estimator = kind()
        shared: dict[str, object] = {"outlier_rejection": outlier_rejection, "exponent": kept}
        if gate is not None or not kind.chooses_samples:
            shared["gate"] = chosen
        own = {setting: value for setting, value in shared.items() if setting in estimator.settings}
        estimator = estimator.replace(**own)
        if known is not None and known.answers(estimator, traced):
            results[name] = known
        else:
            results[name] = Identification.of(data, estimator, trace=traced)
    return results


def _asked_for(
    estimator: ContactEstimator | str | None, law: str | None
) -> ContactEstimator | str | None:
    """An estimator by the law that it is to find, where one is asked for."""
    if law is None:
        return estimator
    if isinstance(estimator, ContactEstimator):
        raise InvalidParameterError(
            f"law must not be given beside an estimator with its settings, such as "
            f"{type(estimator).__name__}(), which says which law it is"
        )
    kind, settings = estimator_by_law(law, estimator)
    return kind(**settings)
