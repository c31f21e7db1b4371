"""Identify a whole contact, with one estimator or with all of them side by side."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from palpate.errors import InvalidParameterError
from palpate.identification.diagnosis import Data, Diagnosis
from palpate.identification.identified import Identified
from palpate.input.preparation.gate import choose_gate
from palpate.input.preparation.preparing import BY_NAME, Recorded, prepare
from palpate.method.contact import Contact
from palpate.method.estimators import (
    ESTIMATORS,
    ContactEstimator,
    ViscoelasticContact,
)
from palpate.method.estimators.by_law import estimator_by_law
from palpate.method.estimators.contact_estimator import Rejection, check_exponent, estimator_named
from palpate.method.estimators.estimate import Traced, check_trace
from palpate.method.settings import ContactGate
from palpate.output.results import view

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike


class Identification(Identified):
    """The identification of a whole contact: law, trace and diagnosis.

    The base class computes the numbers in a package below tables, figures, reports and files, where
    they are needed too. This class adds only the methods that call these packages.

    Parameters
    ----------
    contact : Contact
        The identified contact.
    estimator : ContactEstimator
        The estimator after the last sample; it accepts further samples.
    trace : Trace
        Every sample, on the contact's clock, with the estimates requested from
        :func:`palpate.identify`.
    findings : tuple of Finding
        Checks of the last estimate and of the samples; the diagnosis includes them. ``flags`` has
        their text.
    data : Data, optional
        The contact with the checks of its channels, which several methods share.
    depth : float, optional
        The working depth of the diagnosis, m. Default: the median penetration in contact.
    segments : tuple of Identification
        One for each segment between changes of the material, from :meth:`by_segment`; or one for
        each place of a travelling probe, from :meth:`by_place`.
    noticed : Trace, optional
        Trace with a change detector, from :meth:`by_segment`.
    place : Place, optional
        Place on the material, from :meth:`by_place`.
    chosen : tuple of str
        Settings that were None and were chosen from the data.
    query : QueryOptions
        The impact and the tip of the derived quantities, from :meth:`with_query`.
    traced : int, float, "full" or False
        The requested ``trace``; the same for segments and places.
    bounded : Estimate, optional
        The estimate under the weak prior of :class:`VariableProjection`, if the motion does not
        determine the estimator's own; :attr:`estimate` is then this one.
    selected : Identification, optional
        The identification that selected the law, if variable projection then identified that law.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> round(result.law.K, -2), round(result.law.n, 2)
    (2000.0, 1.0)
    >>> print(result.stiffness, result.damping, sep=", ")  # N/m and N·s/m
    2000.7 ± 0.8 (trust), 17.56 ± 0.06 (trust)
    >>> print(result.force_at(5e-3))  # N
    9.982 ± 0.013
    """

    segments: tuple["Identification", ...]

    def __repr__(self) -> str:
        return view.one_line(self)

    def _repr_html_(self) -> str:
        """Return a card for a notebook: the numbers with their marks, and the law."""
        from palpate.output.reports.identification import card

        return card(self)

    def summary(self) -> str:
        """Return verdict, numbers, 95 % intervals, correlations and findings, as text."""
        return view.summary(self)

    def plot(
        self,
        panels: Sequence[str] | None = None,
        *,
        ax: "Axes | Sequence[Axes] | None" = None,
        dark: bool = False,
        width: float | None = None,
    ) -> "Figure":
        """Draw the result with :func:`palpate.figures.draw`."""
        from palpate.output.figures import draw

        return draw(self, panels, ax=ax, dark=dark, width=width)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return every sample, and the estimate after it, as a frame indexed by time.

        ``penetration``, ``velocity``, ``force``, ``segment``, ``predicted_force`` (one-step
        prediction), ``fitted_force`` (final law), ``status``, ``validity_margin``, and each
        parameter with its ``…_standard_error`` after the sample, SI; units are in
        ``attrs["units"]``. Values are NaN where a thinned trace has no estimate. Needs pandas, of
        the extra ``notebook``.

        Raises
        ------
        MissingExtraError
            pandas is not installed.
        """
        from palpate.output.results.saved import to_pandas

        return to_pandas(self)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the same as a dataset along ``time``; parameters along ``parameter``.

        Raises
        ------
        MissingExtraError
            xarray, of the extra ``notebook``, is not installed.
        """
        from palpate.output.results.saved import to_xarray

        return to_xarray(self)

    def save(self, folder: str | Path) -> None:
        """Write report, numbers, trace and options to a folder; :func:`load_result` reads it back.

        ``report.html``, ``result.json``, ``trace.parquet`` (``.csv`` without pyarrow) and
        ``run.toml``, each complete or not at all.

        Parameters
        ----------
        folder : str or Path
            Created if it does not exist.

        Raises
        ------
        RecordingError
            The folder cannot be created or written to.
        MissingExtraError
            matplotlib, which the report needs, is not installed.
        """
        from palpate.output.reports.identification import Destination

        Destination(Path(folder)).save(self)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as numbers and text in JSON types; undefined values are None."""
        from palpate.output.results.saved import result_dict

        return result_dict(self)


def identify(
    source: "Contact | Recorded | None" = None,
    estimator: ContactEstimator | str | None = None,
    *arrays: object,
    method: str | None = None,
    law: str | None = None,
    companion: "Recorded | None" = None,
    trace: Traced = 2000,
    no_time: bool = False,
    delay: float | tuple[float, float] | Literal["find"] = 0.0,
    units: Mapping[str, str] | None = None,
    exponent: float | None = None,
    time: "ArrayLike | None" = None,
    rate: float | None = None,
    penetration: "ArrayLike | None" = None,
    position: "ArrayLike | None" = None,
    force: "ArrayLike | None" = None,
    velocity: "ArrayLike | None" = None,
) -> Identification:
    """Identify the contact model of a whole contact.

    The samples go one by one through the estimator's recursion, segment by segment.

    Parameters
    ----------
    source : Contact, Recording, path or frame, optional
        Prepared by :func:`prepare`, with its default columns, unless it is a contact. Or pass
        arrays instead, by their names: ``time`` (or ``rate``), ``penetration`` (or
        ``position``) and ``force``.
    estimator : ContactEstimator or str, optional
        Method with settings, which is not modified, or the name of a method. Default: the same as
        ``law="auto"``, or :class:`VariableProjection` without time. A ``gate`` or ``scale`` of None
        is chosen from the data: see :func:`choose_gate`. Variable projection selects its samples
        itself, and uses the contact's ``tare_deviation`` as the prior of its offset.
        :class:`OutlierRejection` excludes outliers unless ``outlier_rejection`` is False.
    *arrays : array_like
        Refused: pass arrays by their names.
    method : str, optional
        Name of a method, such as ``"single-stage"``, instead of ``estimator``.
    law : str, optional
        Instead of an estimator, or together with the name of a method that identifies the law:
        ``"hunt-crossley"``, ``"kelvin-voigt"``, ``"half-space"`` or another law. ``"auto"`` (the
        default) selects the law that fits best, with a spectrum of relaxation times if the material
        relaxes: :class:`ViscoelasticContact`. :attr:`Identification.law_verdict` has the evidence.
        If the Hunt–Crossley law is selected, variable projection identifies it.
    companion : Recording, path or frame, optional
        A second recording, which has the force or the position that ``source`` lacks, as in
        :func:`prepare`.
    trace : int, float, "full" or False
        Which estimates ``trace`` of the result records. An int: at most this number, evenly
        spread up to the last sample. A float: one per this number of seconds, in [1e-9, 1e9];
        ``trace=2.0`` is 2 s, ``trace=2`` two estimates. ``"full"``: one after every sample, which
        takes several times as long with variable projection. False: none. The result, its
        diagnosis and figures are identical.
    no_time : bool
        Identify only the stiffness, from a curve without time, as in :func:`prepare`.
    delay : float, tuple of float or "find"
        Delay of the force, s, with its standard error, as in :func:`prepare`; :func:`skew` measures
        it.
    units : mapping, optional
        Units of channels, such as ``{"penetration": "mm"}``, as in :func:`prepare`.
    exponent : float, optional
        Known n of the law, from the shape of the tip. Default: identified.
    time : array_like, shape (k,), optional
        s, with the arrays that follow, instead of ``source``.
    rate : float, optional
        Sample rate, Hz, instead of ``time``.
    penetration : array_like, shape (k,), optional
        m, positive inside the material.
    position : array_like, shape (k,) or (k, 3), optional
        m, instead of ``penetration``: a coordinate, or a position in space; :func:`prepare` finds
        its direction and the surface. ``force`` may have the same shape.
    force : array_like, shape (k,), optional
        N, compression positive.
    velocity : array_like, shape (k,), optional
        m/s, positive while penetrating, in addition to these arrays. Default: differentiated.

    Returns
    -------
    Identification
        Law, numbers with error bars and marks, and the estimator with its trace.

    Raises
    ------
    RecordingError
        The recording cannot be prepared; no sample is in contact; or fewer than 20 samples lie
        above the estimated surface.
    InvalidParameterError
        The source or ``trace`` has another type; there is no such method or law; or arguments
        exclude each other.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> print(result.stiffness.combined.format("N/m"), result.stiffness.mark)
    2000.7 ± 0.8 N/m trust
    >>> round(result.law.K, -2), round(result.law.B, -2), round(result.law.n, 2)
    (2000.0, 2000.0, 1.0)
    """
    if arrays:
        raise InvalidParameterError(BY_NAME)
    if method is not None and estimator is not None:
        raise InvalidParameterError(f"pass estimator or method={method!r}, not both")
    traced = check_trace(trace)  # before reading anything
    estimator = _estimator_for_law(method if estimator is None else estimator, law, exponent)
    signals = {"time": time, "penetration": penetration, "force": force, "velocity": velocity}
    signals |= {"position": position, "rate": rate}
    given = {name: values for name, values in signals.items() if values is not None}
    options: dict[str, Any] = {"companion": companion, "no_time": no_time, "delay": delay}
    options["units"] = units
    if not isinstance(source, Contact) or given or any(map(bool, options.values())):
        source = prepare(source, **options, **given)  # type: ignore[arg-type]  # it refuses a contact with arrays
    return Identification.selected_law(Data(source), estimator, trace=traced)


def diagnose(
    source: "Contact | Recorded",
    estimator: ContactEstimator | str | None = None,
    *,
    method: str | None = None,
    law: str | None = None,
    depth: float | None = None,
) -> Diagnosis:
    """Diagnose the identification of a contact: verdict, findings, numbers at working depth.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        As for :func:`identify`.
    estimator : ContactEstimator or str, optional
        As for :func:`identify`.
    method, law : str, optional
        As for :func:`identify`.
    depth : float, optional
        The working depth, m. Default: the median penetration in contact.

    Returns
    -------
    Diagnosis
        Marks, findings, and the numbers at working depth with their error bars.

    Examples
    --------
    >>> import palpate
    >>> diagnosis = palpate.diagnose("examples/recordings/tapping.csv")
    >>> diagnosis.verdict.stiffness
    'with-care'
    >>> diagnosis.deciding.check
    'moving mass'
    """
    result = identify(source, estimator, method=method, law=law, trace=False)
    return (result if depth is None else result.at_depth(depth)).diagnosis


class Comparison(dict[str, Identification]):
    """The identification of a contact by each method; it prints one on each line."""

    def __repr__(self) -> str:
        return "\n".join(f"{name}: {result!r}" for name, result in self.items())


def compare(
    source: "Contact | Recorded",
    *,
    gate: ContactGate | None = None,
    outlier_rejection: Rejection = None,
    exponent: float | None = None,
    trace: Traced = 2000,
    watch: Callable[[Sequence[str]], Iterable[str]] = iter,
    known: Identification | None = None,
) -> Comparison:
    """Identify a contact with every method.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        As for :func:`identify`.
    gate : ContactGate, optional
        Which samples are in contact, for every method. Default: chosen from the data, the same for
        all except variable projection, which selects its samples itself.
    outlier_rejection : OutlierRejection or False, optional
        How outliers are excluded; False keeps all of them.
    exponent : float, optional
        Exponent known from the shape of the tip, such as 1.5 for a sphere. It is fixed in every
        method whose law has an exponent. A method that cannot fix this value is omitted.
    trace : int, float, "full" or False
        As for :func:`identify`.
    watch : callable
        Iterates over the methods' names, for example with a progress bar.
    known : Identification, optional
        An identification of this contact. It is reused for its method if its settings are the same.

    Returns
    -------
    Comparison
        A dict: an :class:`Identification` for each method's name, in the order of ``ESTIMATORS``.

    Examples
    --------
    >>> import palpate
    >>> results = palpate.compare("examples/recordings/ball.csv")
    >>> round(results["variable-projection"].fit_rmse_percent, 2)
    0.4
    >>> round(results["kelvin-voigt"].fit_rmse_percent, 2)
    0.66
    """
    traced = check_trace(trace)
    contact = source if isinstance(source, Contact) else prepare(source)
    data = Data(contact)
    rejecting = outlier_rejection is not False
    if (
        known is not None
        and known.data is not None
        and known.estimator.rejects_outliers is rejecting
    ):
        data = known.data
    data = data.samples(rejecting=rejecting)  # checked once for all methods
    chosen = choose_gate(data.contact) if gate is None else gate
    results = Comparison()
    kept = check_exponent(exponent)
    able = [
        name
        for name, kind in ESTIMATORS.items()
        if (kept is None or kind.exponents[0] <= kept <= kind.exponents[1])
        and (kind.works_without_time or not contact.timeless)
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


def _estimator_for_law(
    estimator: ContactEstimator | str | None,
    law: str | None,
    exponent: float | None = None,
) -> ContactEstimator | str | None:
    """Return the estimator of a law, if one is requested, or that keeps a known exponent."""
    known = {} if exponent is None else {"exponent": exponent}
    if law is None:
        if not known:
            return estimator
        if isinstance(estimator, ContactEstimator):
            return estimator.replace(**known)
        kind = ViscoelasticContact if estimator is None else estimator_named(estimator)
        return kind(**known)
    if isinstance(estimator, ContactEstimator):
        raise InvalidParameterError(
            f"law={law!r} excludes an estimator with settings, such as "
            f"{type(estimator).__name__}(), which has a law already: leave one of them out"
        )
    kind, settings = estimator_by_law(law, estimator)
    return kind(**settings, **known)
