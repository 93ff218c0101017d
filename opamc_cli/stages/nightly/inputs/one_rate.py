"""Recordings whose rates are one clock's, as measured anew each night, are of one condition."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from opamc_cli.stages.nightly.inputs.baseline_name import rate_in
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.storage.schemas.channels import same_clock


def named_rates(conditions: Iterable[str], recordings: Iterable[Recording]) -> list[float]:
    """Return the rates that a robot's conditions are called by, the older one first.

    The first recording of a clock names its rate, however near the next ones are to another: a
    night that is added at the end moves none. Those of baselines that were complete come before
    all, as their names stay when earlier nights are filled in.

    Parameters
    ----------
    conditions
        Of baselines that were complete before.
    recordings
        All of the robot's.
    """
    told = [rate for rate in map(rate_in, conditions) if rate]
    for one in sorted(recordings, key=lambda one: (one.night, one.log.path)):
        if one.facts.sampling_rate_hz:
            # as a condition's name has it
            told.append(float(f"{one.facts.sampling_rate_hz:g}"))
    rates: list[float] = []
    for rate in dict.fromkeys(told):
        if not any(same_clock(rate, known) for known in rates):
            rates.append(rate)
    return rates


def at_named_rates(recordings: Sequence[Recording], rates: Sequence[float]) -> list[Recording]:
    """Return recordings that say the first of some rates that is their clock's."""
    found = []
    for one in recordings:
        own = one.facts.sampling_rate_hz
        named = next((rate for rate in rates if own and same_clock(own, rate)), own)
        if named != own:
            one = replace(one, facts=replace(one.facts, sampling_rate_hz=named))
        found.append(one)
    return found
