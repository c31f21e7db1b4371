"""A contact and its trace for pandas and xarray."""

from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.errors import MissingExtraError
from palpate.results.columns import trace_columns

if TYPE_CHECKING:
    import pandas
    import xarray

    from palpate.identification import Identified


def to_pandas(result: "Identified") -> "pandas.DataFrame":
    """Columns of :func:`trace_columns`, indexed by time; units in ``attrs``."""
    try:
        import pandas
    except ImportError:
        raise MissingExtraError("to_pandas needs pandas: pip install 'palpate[notebook]'") from None
    table = trace_columns(result)
    frame = pandas.DataFrame(table.columns).set_index("time")
    frame.attrs["units"] = table.units
    if result.fixed:
        frame.attrs["fixed"] = list(result.fixed)
    return frame


def to_xarray(result: "Identified") -> "xarray.Dataset":
    """The samples along ``time``, the law's parameters along ``parameter``; units as attributes."""
    try:
        import xarray
    except ImportError:
        raise MissingExtraError("to_xarray needs xarray: pip install 'palpate[notebook]'") from None
    law, trace, table = result.law, result.trace, trace_columns(result)
    own = {name for each in law.names() for name in (each, f"{each}_standard_error")}
    variables: dict[str, Any] = {
        name: ("time", values, {"units": table.units[name]} if name in table.units else {})
        for name, values in table.columns.items()
        if name not in own and name != "time"
    }
    variables["parameters"] = (("time", "parameter"), trace.everywhere(trace.parameters))
    errors = trace.everywhere(trace.standard_errors)
    variables["standard_errors"] = (("time", "parameter"), errors)
    variables["covariance"] = (("parameter", "other_parameter"), result.covariance)
    names = np.array(law.names())
    return xarray.Dataset(
        variables,
        coords={
            "time": ("time", table.columns["time"], {"units": "s"}),
            "parameter": names,
            "other_parameter": names,
            "unit": ("parameter", list(law.units)),
        },
        attrs={
            "law": law.kind,
            "method": result.method,
            "source": result.contact.source,
            **({"fixed": list(result.fixed)} if result.fixed else {}),
        },
    )
