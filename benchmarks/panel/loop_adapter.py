"""The one place where the panel calls the package's loop."""

from dataclasses import dataclass
from typing import Any

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from panel.case import Logged


class RefusedError(Exception):
    """The loop says that it cannot serve a recording."""


@dataclass(frozen=True)
class Closed:
    """What the loop said; errors on its sealed data, in ampere."""

    before: float
    after: float
    r2_before: float
    r2_after: float
    added: list[dict[str, Any]]
    verdict: str
    ceiling: float | None


def close(
    recordings: list[Logged],
    declared: tuple[str, ...],
    gear: tuple[float, int] | None,
    seed: int,
    without_rules: tuple[str, ...] = (),
) -> Closed:
    """Close the loop on one joint's recordings.

    Raises
    ------
    RefusedError
        If too little moves.
    """
    laid = [
        Recording(
            f"run {k}",
            r.rate_hz,
            current_a=r.current,
            phases_a=r.phases,
            position_rad=r.position,
            velocity_rad_s=r.velocity,
            temperature_c=r.temperature,
            others_rad=r.others,
        )
        for k, r in enumerate(recordings)
    ]
    library = built_in_library()
    terms = tuple((library[name], None) for name in declared)
    joint = Joint(*gear) if gear else Joint()
    ways = Ways(laid, joint, lambda _: terms)
    fit = ways.best_fit(without_rules)
    if fit is None:
        msg = "moves too little"
        raise RefusedError(msg)
    ways = None if "windows" in without_rules else ways
    loop = close_loop(fit, library, seed, without_rules, ways)
    return Closed(
        loop.rmse_before_a,
        loop.rmse_after_a,
        loop.r2_before,
        loop.r2_after,
        [
            {
                "name": step.term.effect.name,
                "ties": list(step.ties),
                "parameters": dict(step.term.parameters),
                "gain": step.trial.gain,
                "t_value": step.trial.t_value,
            }
            for step in loop.steps
            if step.named
        ],
        loop.verdict,
        loop.ceiling.share,
    )
