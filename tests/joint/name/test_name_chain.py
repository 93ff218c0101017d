"""What a chain gains over another, what it costs, and what it keeps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit
from simulator import DECLARED

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term, dataset_of, fit_terms
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint
from opamc_cli.joint.name.chain import (
    Chain,
    chain_of,
    extended,
    line_of,
    price_of,
    released,
    signature_of,
    without,
)

LIBRARY = built_in_library()
CHARGE = 0.02


def stribeck(q, v, a, t):
    return np.sign(v) * np.exp(-((v / 0.1) ** 2))


@pytest.fixture(scope="module")
def chain():
    return chain_of(plain_fit(joint_of("cyclic", stribeck, strength=5.0, rate=100.0)), 0)


def effect(name, plausible=True, unnamed=False, searched=0, follows_load=False, fast=False):
    return SimpleNamespace(
        name=name,
        fast=fast,
        domain="motor-angle",
        several=fast,
        first_steps=lambda track, parameters: {"order": 0.5},
        at_a_place=False,
        builds_up=name in ("hysteresis", "unnamed_presliding"),
        unnamed=unnamed,
        follows_load=follows_load,
        plausible=lambda values, parameters: plausible,
        searched=lambda parameters: searched,
    )


def moves(*directions, speed=0.5):
    direction = np.array(directions)
    track = SimpleNamespace(direction=direction, velocity=speed * direction)
    return SimpleNamespace(fine=SimpleNamespace(track=track, fit=slice(None)))


def made(*terms, added=1, error=(1.0, 1.0), counts=None, widths=None, **fit):
    terms = tuple(SimpleNamespace(effect=one, parameters={}) for one in terms)
    widths = widths or [1] * len(terms)
    fit = {"dataset": moves(-1.0, 1.0)} | fit
    fit = SimpleNamespace(terms=terms, coefficients=[np.ones(w) for w in widths], **fit)
    counts = np.ones(len(error)) if counts is None else np.array(counts)
    return Chain(fit, added, np.array(error), counts)


@pytest.mark.parametrize(
    ("unnamed", "fast", "width", "searched", "units"),
    [
        (False, False, 1, 0, 2),
        (False, False, 16, 0, 17),
        (False, False, 33, 2, 19),
        (True, False, 33, 2, 36),
        (False, True, 1, 0, 2),  # a cosine and its sine are one
        (False, True, 2, 1, 3),
        (True, True, 6, 1, 5),
    ],
)
def test_a_price_is_for_the_effect_its_coefficients_and_what_was_searched(
    unnamed, fast, width, searched, units
):
    one = effect("one", True, unnamed, searched, fast=fast)
    term = SimpleNamespace(effect=one, parameters={"order": 9.0} if fast else {})
    assert price_of(term, width, None) == pytest.approx(CHARGE * units)


@pytest.mark.parametrize(("turns", "units"), [(8.0, 6), (9.0, 4)])
def test_what_turns_no_more_often_than_a_smooth_function_bends_is_no_line(turns, units):
    """Three ripples of 3 to 8 turns on the way were a drag that the library did not hold."""
    term = SimpleNamespace(effect=effect("one", searched=1, fast=True), parameters={"order": turns})
    assert price_of(term, 4, None) == pytest.approx(CHARGE * units)


def test_only_what_was_added_is_paid_for():
    chain = made(effect("declared"), effect("first", searched=1), effect("second"),
                 added=2, error=(4.0, 4.0), counts=(2.0, 2.0), widths=[7, 2, 3])  # fmt: skip
    assert [term.effect.name for term in chain.terms] == ["first", "second"]
    assert chain.mean_square == pytest.approx(2.0)
    assert chain.price == pytest.approx(CHARGE * (4 + 4))
    assert chain.score == pytest.approx(np.log(2.0) + chain.price)
    assert made(added=0).price == 0.0
    assert np.isfinite(made(added=0, error=(0.0, 0.0)).score)


def test_a_part_counts_by_its_samples_and_by_its_error_not_by_the_error_s_square():
    # Root mean squares of 1 over three samples, and of 9 over one.
    assert made(added=0, error=(3.0, 81.0), counts=(3.0, 1.0)).mean_square == pytest.approx(9.0)
    quiet, hard = (
        made(error=(0.75, 81.0), counts=(3.0, 1.0)),
        made(error=(3.0, 72.25), counts=(3.0, 1.0)),
    )
    # Half of the noise of three quarters is worth more than half an ampere of nine in one.
    assert quiet.mean_square < hard.mean_square
    assert quiet.error.sum() > hard.error.sum()


def test_a_gain_is_a_share_of_the_other_s_error_and_its_t():
    before, after = made(error=(16.0, 16.0, 16.0), added=0), made(error=(1.0, 4.0, 9.0), added=0)
    # Root mean squares fall by 3, 2, 1, which have a variance of 1, their sum one of 3.
    assert after.gain_over(before) == pytest.approx((0.75, 6 / np.sqrt(3)))
    assert before.gain_over(after) == pytest.approx((-3.0, -6 / np.sqrt(3)))
    share, t_value = before.gain_over(before)
    assert (share, t_value) == (0.0, 0.0)


def test_beside_drift_or_smoothing_a_gain_is_that_of_the_errors_there():
    before = made(drift_free_error=np.array([2.0, 4.0]), unsmoothed_error=np.array([5.0, 5.0]))
    after = made(drift_free_error=np.array([1.0, 2.0]), unsmoothed_error=np.array([4.0, 4.0]))
    # Drops of 1 and 2.
    assert after.gain_beside_drift(before) == pytest.approx((0.5, 3.0))
    assert after.gain_beside_smoothing(before) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("beside", "left", "is_drift"),
    [
        (1.9, 3.2, True),  # nothing more beside the offsets, which alone leave 2
        (1.9, 2.8, False),  # it explains more than nine tenths of what they do
        (1.7, 3.2, False),  # it helps beside them
    ],
)
def test_a_change_that_offsets_explain_as_well_is_drift(beside, left, is_drift):
    sums = [SimpleNamespace(held_out=lambda one=one: np.full(2, one / 2)) for one in (12.0, left)]
    other = made(drift_free_error=np.array([1.0, 1.0]), sums=sums[0])
    chain = made(drift_free_error=np.array([1.0, beside - 1]), sums=sums[1])
    assert chain.no_more_than_drift(other, 0.1) is is_drift


def test_an_added_term_has_to_have_its_sign():
    start = made(effect("declared"), added=0)
    assert made(effect("declared"), effect("new")).plausible_beside(start)
    assert not made(effect("declared"), effect("new", plausible=False)).plausible_beside(start)


def test_a_place_may_have_less_friction_down_to_none():
    start = made(effect("coulomb"), added=0)
    for share, plausible in ((-0.9, True), (-1.1, False)):
        easy = effect("easy", plausible=False)
        easy.at_a_place = True
        chain = made(effect("coulomb"), easy)
        chain.fit.coefficients[1] = np.array([share])
        assert chain.plausible_beside(start) is plausible


@pytest.mark.parametrize(
    ("directions", "offset", "plausible"),
    [
        ((1.0, 1.0), 1.0, True),
        ((-1.0, -1.0), -1.0, True),
        ((1.0, 1.0), -1.0, False),
        ((1.0, -1.0), 1.0, False),
    ],
)
def test_what_never_turns_round_may_have_its_dry_friction_in_the_offset(
    directions, offset, plausible
):
    easy = effect("easy", plausible=False)
    easy.at_a_place = True
    declared = effect("coulomb"), effect("offset")
    start = made(*declared, added=0)
    chain = made(*declared, easy, dataset=moves(*directions))
    chain.fit.coefficients[1:] = np.array([offset]), np.array([-1.9])
    assert chain.plausible_beside(start) is plausible


@pytest.mark.parametrize(
    ("name", "before", "now", "follows_load", "plausible"),
    [
        ("coulomb", True, False, True, False),
        ("viscous", True, False, True, True),  # something else that lacks may have turned it
        ("coulomb", True, False, False, True),  # only what follows the load may not turn it
        ("coulomb", False, False, True, True),  # it was so before
        ("coulomb", True, True, True, True),
    ],
)
def test_dry_friction_may_not_be_turned_by_what_follows_the_load(
    name, before, now, follows_load, plausible
):
    start = made(effect(name, before), added=0)
    start.fit.coefficients[0] = np.array([1.0 if before else -1.0])
    longer = made(effect(name, now), effect("new", follows_load=follows_load))
    longer.fit.coefficients[0] = np.array([1.0 if now else -1.0])
    assert longer.plausible_beside(start) is plausible


@pytest.mark.parametrize(("per_speed", "plausible"), [(22.0, True), (4.0, False)])
def test_at_one_speed_dry_friction_is_judged_together_with_viscous(per_speed, plausible):
    """A weight of 15 times the noise that rubs, to and fro at 0.02 rad/s, was refused for it."""
    declared = effect("coulomb"), effect("viscous")
    turned = effect("coulomb", plausible=False), effect("viscous")
    following = effect("new", follows_load=True)
    longer = made(*turned, following, dataset=moves(-1.0, 1.0, speed=0.02))
    longer.fit.coefficients[:2] = np.array([-0.1]), np.array([per_speed])
    assert longer.plausible_beside(made(*declared, added=0)) is plausible


@pytest.mark.parametrize("name", ["unnamed_presliding", "hysteresis"])
@pytest.mark.parametrize(("built_up", "plausible"), [(0.3, True), (0.1, False)])
def test_dry_friction_is_judged_together_with_what_builds_up_after_a_reversal(
    name, built_up, plausible
):
    """Friction with the load of 5 times the noise lost its name beside presliding."""
    declared = effect("coulomb"), effect(name)
    turned = effect("coulomb", plausible=False), effect(name)
    longer = made(*turned, effect("new", follows_load=True))
    longer.fit.coefficients[:2] = np.array([-0.2]), np.array([built_up])
    assert longer.plausible_beside(made(*declared, added=0)) is plausible


def test_chains_are_the_same_by_two_digits_of_their_parameters_in_any_order():
    def term(name, keep=None, **parameters):
        return SimpleNamespace(effect=effect(name), parameters=parameters, keep=keep)

    one = signature_of((term("a", x=1.234, y=2.0), term("b")), None)
    assert one == signature_of((term("b"), term("a", y=2.0, x=1.22)), None)
    assert one != signature_of((term("b"), term("a", y=2.0, x=1.26)), None)
    assert one != signature_of((term("a", x=1.234, y=2.0),), None)
    assert one != signature_of((term("a", x=1.234, y=2.0), term("b", keep=(0,))), None)


def test_lines_are_the_same_where_the_travel_cannot_tell_them_apart(chain):
    """Two digits made one line of 320 and 322 per turn: the second was never tried."""
    track = chain.fit.dataset.fine.track
    apart = track.order_resolution

    def line(order, **flags):
        return signature_of((Term(LIBRARY["ripple"], {"order": order, **flags}),), track)

    one = 300 * apart
    assert line(one) == line(one + 0.3 * apart)
    assert line(one) != line(one + apart)
    assert line(one) != line(one, load=1.0)
    assert line_of(Term(LIBRARY["spring"], {}), track) == 0


def test_a_user_s_lines_need_no_step(chain):
    class Lines(Effect):
        name, several = "lines", True

    track = chain.fit.dataset.fine.track
    assert line_of(Term(Lines(), {}), track) == 0
    places = [line_of(Term(Lines(), {"order": order}), track) for order in (2.0, 2.001, 2.02)]
    assert places == [2.0, 2.0, 2.02]


def test_what_is_put_in_can_be_taken_out_again(chain):
    spring, speed = (
        Term(LIBRARY["spring"], {}),
        Term(LIBRARY["stribeck"], {"stribeck_speed": 0.1, "exponent": 2.0}),
    )
    longer = extended(extended(chain, spring), speed)
    assert (longer.added, longer.terms) == (2, (spring, speed))
    assert longer.signature == signature_of((spring, speed), longer.fit.dataset.fine.track)
    for place, kept in ((0, speed), (1, spring)):
        shorter, direct = without(longer, place), extended(chain, kept)
        assert (shorter.added, shorter.terms) == (1, (kept,))
        np.testing.assert_allclose(shorter.error, direct.error)
    assert extended(chain, spring, speed).error == pytest.approx(longer.error)


def test_a_drive_s_answer_is_held_and_let_go_of_where_that_predicts_better(chain):
    offset = Term(LIBRARY["offset"], {})
    assert released(extended(chain, offset)).fit.dataset.held
    form = {"order": 40.0, "direction": 1.0, "answer": 2.0, "top_hz": 20.0}
    held = extended(chain, Term(LIBRARY["ripple"], form))
    sizes = [values.size for values in held.fit.coefficients]
    assert set(held.fit.sums.ridge[: -sizes[-1]]) == {0.0}
    assert set(held.fit.sums.ridge[-sizes[-1] :]) == {1e-3}
    free = fit_terms(replace(held.fit.dataset, held=False), held.fit.terms)
    assert not free.sums.ridge.any()
    # Nothing repeats at this order: filters that cancel one another only fit the noise.
    answer, unheld = (fit.coefficients[-1] for fit in (held.fit, free))
    assert np.linalg.norm(answer) < 0.5 * np.linalg.norm(unheld)
    better = min(held, chain_of(free, held.added), key=lambda one: one.score)
    assert released(held).score == better.score


def test_on_one_grid_the_error_is_that_of_the_parts_that_are_judged():
    recording = joint_of("cyclic", stribeck, strength=5.0, rate=100.0)
    chain = chain_of(plain_fit(recording, averaged=False), 0)
    dataset = chain.fit.dataset
    parts, sums = dataset.parts[0], chain.fit.sums
    assert dataset.coarse is dataset.fine
    np.testing.assert_allclose(chain.error, sums.held_out()[parts.judged])
    judged = parts.rows[np.repeat(parts.judged, [b - a for a, b in parts.slices])]
    assert chain.counts.sum() == judged.size


def test_on_two_grids_what_is_not_clear_is_judged_on_the_coarse_one():
    recording = joint_of("cyclic", stribeck, rate=1000.0, seconds=40.0)
    track, grouping = grouped_track([recording], Joint())
    spoilt = np.arange(track.size) % 1000 < 100
    dataset = dataset_of(replace(track, clear=track.clear & ~spoilt), grouping)
    fit = fit_terms(dataset, tuple(Term(LIBRARY[name], {}) for name in DECLARED))
    fine, coarse = dataset.parts
    assert dataset.factor > 1
    assert not fine.judged.all()
    chain = chain_of(fit, 0)
    clear = fit.sums.held_out()[fine.judged]
    rest = fit_terms(dataset, fit.terms).coarse_sums[0].held_out()[~coarse.judged]
    np.testing.assert_allclose(chain.error, [*clear, *dataset.factor * rest])
    counts = [
        sum(b - a for (a, b), kept in zip(grid.slices, chosen, strict=True) if kept)
        for grid, chosen in ((fine, fine.judged), (coarse, ~coarse.judged))
    ]
    assert chain.counts.sum() == counts[0] + dataset.factor * counts[1]
    # Every moving sample once, but for those at the ends of blocks.
    assert chain.counts.sum() == pytest.approx(np.count_nonzero(dataset.fine.fit), rel=0.1)
