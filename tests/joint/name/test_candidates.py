"""What a candidate would take off the held-out error, against fitting it."""

from dataclasses import replace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.candidates import Beside, batches_of, best_forms
from opamc_cli.joint.name.chain import PRICE, chain_of, extended, price_of
from opamc_cli.joint.name.search import guessed
from opamc_cli.signal.motion.smoothing import averaged, block_mean
from tests.marks import long

LIBRARY = built_in_library()
MOTION = ("offset", "spring", "stribeck", "quadratic_friction", "asymmetric_friction",
          "position_drag", "hysteresis")  # fmt: skip


def stribeck(q, v, a, t):
    return np.sign(v) * np.exp(-((v / 0.15) ** 2))


@pytest.fixture(scope="module")
def slow_chain():
    """One grid for all: 100 Hz."""
    return chain_of(plain_fit(joint_of("cyclic", stribeck, rate=100.0), averaged=False), 0)


@pytest.fixture(scope="module")
def fast_chain():
    """Two grids, and an effect that is fast in the model."""
    fit = plain_fit(joint_of("steps of torque", stribeck, rate=2000.0, seconds=24.0))
    forms = {"speed": 1.0, "direction": 1.0, "load": 0.0}
    return extended(chain_of(fit, 0), Term(LIBRARY["ripple"], {"order": 20.0, **forms}))


@pytest.mark.parametrize("name", MOTION)
def test_the_gain_of_a_guess_is_that_of_the_chain_with_it(slow_chain, name):
    dataset = slow_chain.fit.dataset
    assert dataset.coarse is dataset.fine
    terms = guessed(LIBRARY[name], dataset)
    for fine in (True, False):
        beside = Beside(slow_chain, fine)
        for batch in batches_of(dataset, terms, fine):
            gains = beside.gains(batch)
            for place in range(0, len(batch.terms), 7):
                slow, _ = extended(slow_chain, batch.terms[place]).gain_over(slow_chain)
                assert gains[place] == pytest.approx(slow, rel=2e-3, abs=1e-4)


def slow_gain(chain, columns, fine):
    """Leave units out one by one, with all regressors, by least squares."""
    dataset = chain.fit.dataset
    parts = dataset.parts[0 if fine else 1]
    current = dataset.grid_of(fine).track.current_a
    known = list(zip(chain.fit.terms, chain.fit.coefficients, strict=True))
    blocks = []
    for term, values in known:
        if term.effect.fast and not fine:
            on = dataset.fine.track
            smooth = averaged(term.columns(on), on.bounds, on.kernel)
            current = current - block_mean(smooth, on.bounds, dataset.factor) @ values
        else:
            blocks.append(term.columns(dataset.grid_of(fine).track))
    base = np.concatenate(blocks, axis=1)[parts.rows]
    both = np.concatenate([base, columns], axis=1)
    target = current[parts.rows]
    unit = np.repeat(parts.unit, [b - a for a, b in parts.slices])
    deviation = [0.0, 0.0]
    for (start, stop), number, judged in zip(parts.slices, parts.unit, parts.judged, strict=True):
        rest, mine = unit != number, slice(start, stop)
        for place, design in enumerate((base, both)):
            scale = np.linalg.norm(design[rest], axis=0)
            values = np.linalg.lstsq(design[rest] / scale, target[rest], rcond=1e-6)[0] / scale
            if judged or not fine:
                error = target[mine] - design[mine] @ values
                deviation[place] += (stop - start) * float(np.sqrt(np.mean(error**2)))
    return 1 - (deviation[1] / deviation[0]) ** 2


@pytest.mark.parametrize("fine", [long(True), False])
@pytest.mark.parametrize("name", ["stribeck", "spring", "position_drag"])
def test_the_gain_is_that_of_least_squares_unit_by_unit_on_either_grid(fast_chain, name, fine):
    dataset = fast_chain.fit.dataset
    assert dataset.factor > 1
    terms = guessed(LIBRARY[name], dataset)[:: 40 if name == "position_drag" else 9]
    for batch in batches_of(dataset, terms, fine):
        gains = Beside(fast_chain, fine).gains(batch)
        for columns, gain in zip(np.split(batch.columns, len(gains), axis=1), gains, strict=True):
            slow = slow_gain(fast_chain, columns, fine)
            assert gain == pytest.approx(slow, rel=2e-3, abs=1e-5)


@pytest.mark.parametrize("name", ["stribeck", "position_drag"])
def test_a_slow_guess_promises_no_more_than_it_takes_at_the_full_rate(name):
    """What smooths a coarse encoder's motion takes a ripple out of the averaged current, too."""
    rippling = joint_of("cyclic", lambda q, v, a, t: np.sin(100 * q) + 0.3 * stribeck(q, v, a, t))
    coarse = replace(rippling, position_rad=np.round(rippling.position_rad, 3))
    chain = chain_of(plain_fit(coarse), 0)
    dataset, beside = chain.fit.dataset, Beside(chain, False)
    found = beside.candidates(batches_of(dataset, guessed(LIBRARY[name], dataset), False))
    best = max(found, key=lambda one: one.gain)
    taken, _ = extended(chain, best.term).gain_over(chain)
    assert best.gain > taken + 0.05
    own_price = best.score - np.log(1 - best.gain)
    assert best.promise > np.log(1 - taken - 0.02) + own_price


def test_what_the_model_holds_already_takes_nothing(slow_chain):
    dataset = slow_chain.fit.dataset
    for name in ("coulomb", "inertia"):
        (batch,) = batches_of(dataset, [Term(LIBRARY[name], {})], True)
        assert abs(Beside(slow_chain, True).gains(batch)[0]) < 1e-3


def test_the_best_form_is_the_one_with_the_best_score(slow_chain):
    dataset = slow_chain.fit.dataset
    beside = Beside(slow_chain, True)
    full = Term(LIBRARY["asymmetric_friction"], LIBRARY["asymmetric_friction"].guesses(
        dataset.fine.track, np.zeros(dataset.fine.track.size))[0])  # fmt: skip
    (found,) = best_forms(dataset, beside, full)
    forms = [full] + [
        Term(full.effect, parameters, keep)
        for parameters, keep in full.effect.variants(full.parameters)
    ]
    scores = {}
    for form in forms:
        longer = extended(slow_chain, form)
        width = longer.fit.coefficients[-1].size
        error = np.log(longer.mean_square / slow_chain.mean_square)
        scores[form.key] = error + PRICE * (1 + width + form.effect.searched(form.parameters))
        price = price_of(form, width, dataset.fine.track)
        assert price == pytest.approx(scores[form.key] - error)
    assert len(scores) > 1
    assert found.score == pytest.approx(min(scores.values()), abs=1e-4)
    assert scores[found.term.key] == min(scores.values())


@pytest.mark.parametrize("follows", [True, False])
def test_beside_a_form_that_follows_the_model_the_best_that_does_not_is_tried(follows):
    """Where the model's current passes zero changes as soon as the line is part of it."""

    def line(q, v, a, t):
        model = np.stack([a, np.sin(q), np.cos(q), np.sign(v), v], axis=1) @ [0.2, 1, 0.4, 0.5, 0.3]
        return np.sign(model if follows else v) * np.cos(33 * q)

    chain = chain_of(plain_fit(joint_of("cyclic", line), averaged=False), 0)
    switches = dict.fromkeys(("speed", "direction", "load", "current"), 1.0)
    full = Term(LIBRARY["ripple"], {"order": 33.0, **switches})
    found = best_forms(chain.fit.dataset, Beside(chain, True), full)
    forms = [one.term.parameters for one in found]
    assert [bool(form.get("load")) for form in forms] == [True, False][not follows :]
    assert forms[-1].get("direction")
    assert found[-1].term.is_constant


def test_a_smaller_form_of_the_same_parameters_keeps_its_columns(slow_chain):
    class Padded(type(LIBRARY["stribeck"])):
        """A regressor, and one of noise that a smaller form leaves out."""

        def columns(self, track, parameters):
            noise = np.random.default_rng(0).normal(size=(track.size, 1))
            return np.concatenate([super().columns(track, parameters), noise], axis=1)

        def variants(self, parameters):
            return [(parameters, (0,))]

    full = Term(Padded(), {"stribeck_speed": 0.15, "exponent": 2.0})
    (found,) = best_forms(slow_chain.fit.dataset, Beside(slow_chain, True), full)
    assert found.term.keep == (0,)
