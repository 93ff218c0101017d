"""The one place where the panel calls the package's loop."""

import inspect
from dataclasses import dataclass
from typing import Any

from opamc_cli.joint.declared import declared_fit
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.model import open_session
from opamc_cli.joint.recordings import grouped_track, is_moving
from opamc_cli.joint.track import Joint
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
        )
        for k, r in enumerate(recordings)
    ]
    track, grouping = grouped_track(laid, Joint(*gear) if gear else Joint())
    if grouping is None or not is_moving(track):
        msg = "moves too little"
        raise RefusedError(msg)
    library = built_in_library()
    terms = tuple((library[name], None) for name in declared)
    options: dict[str, Any] = {}
    if without_rules:
        if "without_rules" not in inspect.signature(close_loop).parameters:
            msg = "the loop has no rules that can be left out"
            raise RefusedError(msg)
        options["without_rules"] = without_rules
    loop = close_loop(declared_fit(open_session(track, grouping), terms), library, seed, **options)
    ceiling = loop.ceiling_before.share
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
            }
            for step in loop.steps
        ],
        loop.verdict,
        float(ceiling),
    )
