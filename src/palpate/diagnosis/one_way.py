"""A motion that goes one way: it passes each depth once, at one speed."""

from palpate.diagnosis.finding import Finding
from palpate.diagnosis.fit import Fit
from palpate.estimators.law_flags import ONE_WAY


def one_way(fit: Fit) -> Finding | None:
    """Mean velocity in contact over its root mean square is nearly ±1.

    At one speed v spring, damper and memory are functions of the depth alone, x = vt, of which the
    residual shows nothing: that of Hunt and Crossley, K xⁿ + B v xⁿ, is one power. Of laws that
    are compared any may win there, and a half-space's spring even come out negative.
    """
    v = fit.data.velocity[fit.inside]
    if not abs(float(v.mean())) > ONE_WAY * fit.speed:
        return None
    chosen = fit.laws is not None and fit.laws.own
    return Finding(
        "one way",
        "the probe goes one way at nearly one speed: stiffness, damping and memory are "
        "distinguished by the shape of the law alone, and their error bars do not say so",
        "press and let go, at several speeds",
        stiffness="with-care" if chosen else "trust",
        damping="do-not-trust",
    )
