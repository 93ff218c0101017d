"""What is found out about a model is found out once, whatever is barred later."""

import numpy as np
from closing import close_on

from opamc_cli.joint import rounds
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.gate import Gate
from opamc_cli.joint.rounds import Round, Rules


def test_a_model_is_traced_and_extended_once(monkeypatch):
    _, loop = close_on(7, ("ripple",), ratio=1.0)
    counted = {"trace_residual": 0, "fit_terms": 0, "decoy_likelihood": 0}

    def counting(name):
        inner = getattr(rounds, name)

        def call(*arguments):
            counted[name] += 1
            return inner(*arguments)

        monkeypatch.setattr(rounds, name, call)

    for name in counted:
        counting(name)
    rules = Rules(built_in_library(), Gate(), np.random.default_rng(0))
    first = Round(loop.before, rules)
    traced = first.traced({})
    best = next(candidate for candidate in traced.candidates if candidate.why_not is None)
    name = best.term.effect.name
    followed = first.following(first.beside_decoys(best))
    first.rest()

    barred = first.traced({name: "its form is another one"})
    again = next(found for found in barred.candidates if found.term.effect.name == name)
    assert (again.why_not, again.imitates) == ("its form is another one", None)
    others = [found for found in barred.candidates if found.term.effect.name != name]
    assert [found.why_not for found in others] == [
        found.why_not for found in traced.candidates if found.term.effect.name != name
    ]
    assert first.beside_decoys(best).why_not is None
    assert first.following(best) is followed
    assert followed.fitted.terms == (*loop.before.terms, best.term)
    assert counted == {"trace_residual": 1, "fit_terms": 1, "decoy_likelihood": 1}
