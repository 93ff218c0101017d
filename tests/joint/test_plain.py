"""Plain forms: scored as by least squares, and the end of names that the data do not bear out."""

import numpy as np
import pytest
from closing import close_on

from opamc_cli.joint.plain import plain_forms, score_plain
from opamc_cli.joint.search import SCORE_PER_PARAMETER
from opamc_cli.joint.view import prepare


def test_plain_forms_are_scored_as_by_least_squares():
    _, loop = close_on(3, ("position_drag",), rate=100.0)
    view = prepare(loop.before, fine=False)
    found = {plain.what: plain for plain in score_plain(view)}
    track = view.grid.track
    tested = 0
    for form in plain_forms(track):
        if form.what not in found:
            continue
        white = view.whitened_rows(form.columns)
        design = np.concatenate([view.span, white], axis=1)
        left = view.values - design @ np.linalg.lstsq(design, view.values, rcond=1e-9)[0]
        plain = found[form.what]
        both = np.concatenate([view.span, plain.columns], axis=1)
        new = np.linalg.matrix_rank(both, tol=1e-6) - view.span.shape[1]
        expected = view.freedom(new) * np.log(view.power / float(left @ left))
        assert plain.likelihood == pytest.approx(expected, rel=1e-3, abs=1e-3)
        assert plain.score == pytest.approx(plain.likelihood - SCORE_PER_PARAMETER * new)
        tested += 1
    assert tested > 30


def test_what_the_model_holds_is_no_plain_form():
    _, loop = close_on(3, (), rate=100.0)
    view = prepare(loop.before, fine=False)
    names = {plain.what for plain in score_plain(view)}
    assert not names & {"the direction", "the velocity"}
    assert "a constant" in names


@pytest.mark.parametrize(
    ("effect", "seed", "neighbour", "domain"),
    [
        ("warmup", 6, "thermal_viscous", "time"),
        ("thermal_viscous", 9, "warmup", "temperature"),
        ("spring", 24, "offset", "joint-angle"),
        ("offset", 8, "spring", "load"),
    ],
)
def test_a_neighbour_that_a_plain_form_equals_is_no_name(effect, seed, neighbour, domain):
    _, loop = close_on(seed, (effect,), ratio=0.6, without=(effect,))
    assert loop.steps == ()
    assert loop.verdict == "not-in-library"
    assert loop.remaining_domain == domain
    reasons = {entry.effect: entry.why for entry in loop.rejected}
    assert "the library has no effect of that form" in reasons[neighbour]


@pytest.mark.parametrize(("effect", "seed"), [("warmup", 6), ("spring", 24), ("offset", 8)])
def test_the_same_effect_in_the_library_is_named(effect, seed):
    _, loop = close_on(seed, (effect,), ratio=0.6)
    assert [effect in (step.term.effect.name, *step.ties) for step in loop.steps] == [True]
