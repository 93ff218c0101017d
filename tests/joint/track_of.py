"""A simulated joint's track."""

from simulator import simulate

from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint


def track_of(joint=None, **options):
    made = simulate(3, rate=500.0, cycles=4, kind="quintic", **options)
    joint = joint or Joint(made.gear_ratio, made.pole_pairs)
    recording = Recording(
        "run",
        made.rate_hz,
        current_a=made.current,
        position_rad=made.position,
        temperature_c=made.temperature,
        others_rad={2: made.position[::-1].copy()},
    )
    return made, build_track([recording], joint)
