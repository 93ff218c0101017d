"""Effects as a user declares them in model.yaml, made ready for the fit."""

import difflib
from collections.abc import Mapping

import numpy as np

from opamc_cli.config.joint_model import DeclaredEffect
from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import Track

SPANS = (("since_s", "until_s"), ("gripped_s", "released_s"))
"""When a payload is taken and put down: once, or in every cycle; the first one need never end."""


def declared_term(effect: Effect, declared: DeclaredEffect, track: Track) -> Term | None:
    """Return the term of a declared effect, or None where its parameters are to be found.

    Parameters that were not declared take the effect's first guess; forms are off.

    Raises
    ------
    ConfigError
        If a parameter is unknown, an exponent is not above 0, a payload is put down before it was
        taken, or a parameter that the data would decide is missing beside others.
    """
    given = declared.parameters
    form = effect.form_of(given)
    searched = {} if form else effect.limits(track)
    if not given and (searched or declared.columns is None):
        return None
    guesses = [] if form else effect.guesses(track, np.zeros(track.size))
    defaults = {**(guesses[0] if guesses else {}), **dict.fromkeys(effect.forms, 0.0)}
    # What a closed model says of a smaller form goes with the columns that it keeps.
    smaller = [] if declared.columns is None else effect.variants(defaults)
    known = sorted(
        {
            *searched,
            *defaults,
            *(() if form else effect.searches),
            *(k for form, _ in smaller for k in form),
        }
    )
    for name in given:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
            msg = f"Effect {effect.name!r} in the model has no parameter {name!r}; {hint}"
            raise ConfigError(msg)
    if given.get("exponent", 1.0) <= 0:
        msg = (
            f"Effect {effect.name!r} in the model has exponent {given['exponent']:g}; it has to be "
            "above 0"
        )
        raise ConfigError(msg)
    _check_spans(effect, given)
    # What is placed by other parameters, as a payload by the rests of a cycle, needs none of these.
    otherwise = {*given} & {*effect.searches} - {*searched}
    if otherwise:
        searched, defaults = {}, dict.fromkeys(effect.forms, 0.0)
    for name in searched:  # a payload that is never put down is a guess without its end
        if name not in given and all(name in guess for guess in guesses):
            msg = (
                f"Effect {effect.name!r} in the model is declared without {name!r}; give it too, "
                "or leave out all its parameters to have them found"
            )
            raise ConfigError(msg)
    return Term(effect, {**defaults, **given}, declared.columns)


def _check_spans(effect: Effect, given: Mapping[str, float]) -> None:
    """Refuse a payload without one of its ends, or that is put down before it was taken."""
    for first, last in SPANS:
        lacking = [name for name in (first, last) if name not in given]
        if len(lacking) == 1 and lacking != ["until_s"]:
            msg = f"Effect {effect.name!r} in the model is declared without {lacking[0]!r}; "
            raise ConfigError(msg + "give it too")
        if not lacking and given[last] <= given[first]:
            msg = (
                f"Effect {effect.name!r} in the model has {last} {given[last]:g}; it has to be "
                f"above {first}, {given[first]:g}"
            )
            raise ConfigError(msg)
