"""How much of its domain's curve a name holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.chain import chain_of, extended
from opamc_cli.joint.name.form import share_of_form
from opamc_cli.joint.name.search import Pool

LIBRARY = built_in_library()


def share(effect, *terms):
    start = chain_of(plain_fit(joint_of("cyclic", effect, strength=10.0, rate=100.0)), 0)
    best = extended(start, *terms)
    drop = start.mean_square - best.mean_square
    unnamed = Pool.of(start.fit.dataset, unnamed_library())
    return share_of_form(best, drop, terms[0], unnamed), start, best


def test_a_form_that_is_the_data_s_holds_all_of_the_curve():
    def spring(q, v, a, t):
        return q

    assert share(spring, Term(LIBRARY["spring"], {}))[0] == 1.0


def test_a_form_that_is_another_holds_what_it_takes_of_what_its_domain_explains():
    def waves(q, v, a, t):
        return np.sign(v) * np.sin(9 * np.abs(v))

    found, start, best = share(waves, Term(LIBRARY["quadratic_friction"], {}))
    # All that the effect is can be explained, but for the noise, which is a hundredth of it.
    took = 1 - best.mean_square / start.mean_square
    assert 0 <= took < 0.9
    assert found == pytest.approx(took, abs=0.02)


BEST = SimpleNamespace(mean_square=10.0, score=-1.0)


def effect(name, domain, fast=False):
    return SimpleNamespace(name=name, domain=domain, fast=fast)


VISCOUS = effect("viscous", "velocity")


def rival(left, t_value=3.0, score=-1.1):
    chain = SimpleNamespace(mean_square=left, score=score)
    return SimpleNamespace(chain=chain, t_value=t_value)


UNNAMED = {
    name: effect(name, domain, fast)
    for name, domain, fast in (("bend", "velocity", False), ("tone", "velocity", True),
                               ("place", "joint-angle", False))
}  # fmt: skip


def held(monkeypatch, drop, rivals, term=VISCOUS):
    """Return the share, and the pools that were asked."""
    pools = []
    monkeypatch.setattr(
        "opamc_cli.joint.name.form.trials", lambda chain, pool: pools.append(pool) or rivals
    )
    pool = Pool([], UNNAMED, 0.3, ("beam",))
    return share_of_form(BEST, drop, SimpleNamespace(effect=term), pool), pools


def test_what_explains_most_beside_a_name_is_what_its_form_lacks(monkeypatch):
    # Of an error of 10 the strongest leaves 4.
    assert held(monkeypatch, 2.0, [rival(7.0), rival(4.0), rival(8.0)])[0] == pytest.approx(0.25)
    assert held(monkeypatch, 2.0, [])[0] == 1.0
    assert held(monkeypatch, 2.0, [rival(12.0)])[0] == 1.0
    assert held(monkeypatch, -2.0, [rival(4.0)])[0] == 0.0


def test_only_what_is_sure_and_worth_its_price_counts(monkeypatch):
    for no_rival in (rival(4.0, t_value=2.0), rival(4.0, score=-1.0)):
        assert held(monkeypatch, 2.0, [no_rival])[0] == 1.0


def test_only_slow_functions_of_the_same_domain_are_asked(monkeypatch):
    (pool,) = held(monkeypatch, 2.0, [])[1]
    assert set(pool.library) == {"bend"}
    # However little it takes: the price decides.
    assert (pool.least_share, pool.without) == (0.0, ("beam",))


def test_a_line_is_whole(monkeypatch):
    line = effect("ripple", "velocity", fast=True)
    assert held(monkeypatch, 0.0, [rival(4.0)], line) == (1.0, [])
