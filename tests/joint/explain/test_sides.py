"""Strokes of phases alone that the first model puts on the wrong side of the torque axis."""

import numpy as np
import pytest
from closing import terms_of
from simulator import simulate

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint

DECLARED = ("inertia", "gravity", "coulomb", "viscous")


def phases_of(seed, effect, size):
    """Ways to fit a joint of which the phases alone are logged, and its true current."""
    hidden = (effect,) if effect else ()
    made, true = (
        simulate(seed, hidden, size, rate=2000.0, declared=DECLARED, phase_errors=errors)
        for errors in (True, False)
    )
    laid = Recording("run", 2000.0, phases_a=made.phases, temperature_c=made.temperature)
    joint = Joint(made.gear_ratio, made.pole_pairs)
    return Ways([laid], joint, terms_of(DECLARED)), joint, laid, true.current


def strokes_wrong(recording, joint, current):
    """Share of the moving samples whose current has the wrong sign, but for all of them."""
    track = build_track([recording], joint)
    works = (track.current_a * current)[track.moving]
    return min(np.mean(works < 0), np.mean(works > 0))


@pytest.mark.parametrize(("seed", "effect", "size"), [(65600054, "hysteresis", 15.0)])
def test_strokes_are_turned_by_the_effect_that_put_them_on_the_wrong_side(seed, effect, size):
    """It was no name: 1.20 -> 0.96 A, for the whole current's fourth power held what was turned."""
    ways, joint, laid, current = phases_of(seed, effect, size)
    assert strokes_wrong(laid, joint, current) > 0.02
    loop = close_loop(ways.best_fit(), built_in_library(), seed, ways=ways)
    (turned,) = ways._laid[0]
    assert strokes_wrong(turned, joint, current) < 0.005
    assert ways.strokes_turned >= 4
    assert [step.term.effect.name for step in loop.steps] == [effect]
    assert loop.verdict == "closed"
    assert loop.rmse_after_a < 0.1 * loop.rmse_before_a


def test_where_sides_are_right_nothing_is_turned():
    ways, _, _, _ = phases_of(65500054, "hysteresis", 15.0)
    fitted = ways.best_fit()
    close_loop(fitted, built_in_library(), 0, ways=ways)
    assert ways.strokes_turned == 0


def test_a_logged_motion_has_its_sides():
    made = simulate(3, (), 0.0, rate=500.0, declared=DECLARED)
    laid = Recording("run", made.rate_hz, current_a=made.current, position_rad=made.position)
    ways = Ways([laid], Joint(), terms_of(DECLARED))
    assert ways.turned(ways.best_fit()) is None
