"""Simulate a joint and close the loop on it."""

from simulator import DECLARED, simulate

from opamc_cli.joint.declared import declared_fit
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.model import open_session
from opamc_cli.joint.recordings import grouped_track
from opamc_cli.joint.track import Joint


def close_on(seed, effects, ratio=0.8, without=(), **options):
    base = tuple(name for name in DECLARED if name not in effects)
    made = simulate(seed, effects, ratio, declared=base, **options)
    return close_recording(made, made.current, base, without, seed)


def close_recording(made, current, base=DECLARED, without=(), seed=0):
    recording = Recording(
        "run",
        made.rate_hz,
        current_a=current,
        position_rad=made.position,
        temperature_c=made.temperature,
    )
    track, grouping = grouped_track([recording], Joint(made.gear_ratio, made.pole_pairs))
    library = built_in_library()
    fitted = declared_fit(
        open_session(track, grouping), tuple((library[name], None) for name in base)
    )
    return made, close_loop(fitted, built_in_library(without), seed)
