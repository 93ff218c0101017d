"""What every effect in the library says of itself."""

from collections.abc import Callable

import numpy as np

from opamc_cli.joint.motion.track import Floats, Ints, Track

Parameters = dict[str, float]
ByLoad = Callable[[Floats], tuple[Floats, Floats]]
"""Regressor, (rows,), beside the load of some coefficients, (c,), and how it grows with each."""

CHANNEL_REASONS = {
    "position": "no position, and the phases give no angle",
    "scale": "the joint angle's scale is unknown: log the position, or give gear_ratio and "
    "pole_pairs",
    "temperature": "no temperature channel",
    "returns": "no place is passed twice the same way, so time cannot be told from place",
    "revisits": "the arm passes no place twice the same way, so time cannot be told from place",
    "logged": "the motion comes from the phase currents themselves: log the position",
    "others": "no other joint is logged to move beside",
    "electrical": "no phase currents, and no pole_pairs to tell the electrical angle",
}


class Effect:
    """One thing that adds to a joint's motor current.

    A subclass in a file of its own is a complete effect: name, domain, meaning to a maintainer,
    what it needs, and its regressors. A user's effect is the same.
    """

    name: str = ""
    domain: str = ""
    meaning: str = ""
    origin: str = "joint"
    """Where it comes from: the "joint" itself, where more of it is a fault; or from outside of its
    mechanics: "environment" (temperature), "load" (tool, work piece), "measurement" (sensors,
    drive, logger)."""
    needs: tuple[str, ...] = ("position",)
    """Channels, by name, without which nothing shows it."""
    fast: bool = False
    """True where the regressors change too fast for a decimated grid."""
    several: bool = False
    """True where a joint can have the effect more than once (several ripple orders)."""
    static: bool = True
    """True where the effect takes part in the load or friction that other effects scale."""
    unnamed: bool = False
    """True for functions that claim nothing but their domain."""
    changes_in_time: bool = False
    """True where the effect is a change while the joint goes on as before: slow noise is, too."""
    as_smoothing: bool = False
    """True where it delays the motion or rounds it off: smoothing what was measured does, too."""
    searches: tuple[str, ...] = ()
    """Parameters that the data decide."""
    forms: tuple[str, ...] = ()
    """Parameters that switch regressors on (not 0); never searched, off where not declared."""
    flags_choose_columns: bool = False
    """True where parameters say which columns `columns` returns."""
    whole: bool = False
    """True where the coefficients are one, and the parameters alone say how large the effect is."""
    carries_load: bool = False
    """True where the effect is load: what gravity, inertia and springs ask of the motor."""
    follows_load: bool = False
    """True where the regressors are in proportion to the load's magnitude."""
    resists: bool = False
    """True for friction: its first coefficient is above 0, or it would drive the joint."""
    builds_up: bool = False
    """True for friction that is dry friction once the joint has gone some way from a reversal."""
    at_a_place: bool = False
    """True for friction that is more at some place, or less, down to none."""
    per: tuple[str, ...] | None = None
    """Unit of each regressor, "" for a bare number and "current" for one in the current's own; the
    last one is that of all further ones. A coefficient is the current's unit by it."""
    of_its_recordings: bool = False
    """True where regressors are of the recordings that they were fitted to (a time since they
    began, a place among their quantiles): their coefficients mean nothing elsewhere."""
    from_motion: bool = False
    """True where regressors never look at what was fitted (load, model, static columns): they
    are computed once and kept from one fit to the next."""
    from_terms: bool = False
    """True where they look at the static columns alone: at which terms there are, not how large."""

    def untestable(self, track: Track) -> str | None:
        """Why the recording cannot show this effect, or None where it can."""
        for channel in self.needs:
            if channel not in track.channels:
                return CHANNEL_REASONS.get(channel, f"no {channel}")
        return None

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Non-linear parameters to start from; one empty guess where there are none.

        The residual, shape (n,), is zero where samples do not count.
        """
        return [{}]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Bounds of the non-linear parameters that may be refined."""
        return {}

    def searched(self, parameters: Parameters) -> int:
        """Count the parameters that were searched: each costs as much as a coefficient."""
        return len([name for name in self.searches if name in parameters])

    def first_steps(self, track: Track, parameters: Parameters) -> dict[str, float]:
        """How far from a guess the search first looks: half a decade of the limits, or less."""
        steps = {}
        for name, (low, high) in self.limits(track).items():
            value = parameters.get(name, low)
            ratio = high / low if low > 0 else 0.0
            steps[name] = value * 0.4 if ratio > 5 else 0.05 * (high - low)
        return steps

    def form_of(self, parameters: Parameters) -> str:
        """Tell which of its forms a guess is; what has a name is nothing that smoothing does."""
        return ""

    def is_constant(self, parameters: Parameters) -> bool:
        """Tell whether the regressors stay the same whatever the fitted model is."""
        return self.from_motion

    def ridge(self, parameters: Parameters) -> float:
        """Share of its size that a fit adds to each regressor, where many are nearly alike."""
        return 0.0

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Regressors, shape (n, m), for given non-linear parameters."""
        return self.columns_at(track, parameters, np.arange(track.size))

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Regressors at some samples, shape (rows, m)."""
        if type(self).columns is Effect.columns:
            raise NotImplementedError
        return np.asarray(np.take(self.columns(track, parameters).T, rows, axis=-1).T)

    def beside(self, track: Track, parameters: Parameters, carriers: Floats, rows: Ints) -> ByLoad:
        """Regressor, at some samples, of one that follows the load of some `carriers`, (n, c)."""
        raise NotImplementedError

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Smaller forms of the effect: parameters and the columns that they keep."""
        return []

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Tell whether coefficients have the sign that physics gives this effect."""
        return not self.resists or bool(coefficients[0] > 0)

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Parameters moved to a value with a meaning where the data cannot tell the difference."""
        return parameters

    def decoys(self, parameters: Parameters, track: Track) -> list[Parameters]:
        """Lines that are surely not this one; none of an effect that is no line."""
        return []

    def ties(self, parameters: Parameters, track: Track) -> tuple[str, ...]:
        """Effects that look the same on any such recording, whatever fits best."""
        return ()

    def drawn_over(self, track: Track) -> tuple[str, Floats, Floats] | None:
        """Return what its curve is drawn over, where that is not its domain's covariate.

        A name, values in the domain's unit and the sign to take the curve by, (n,) each.
        """
        return None

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Say what the effect with these parameters means to a maintainer."""
        return self.meaning

    def coefficient_units(self, parameters: Parameters, count: int, unit: str = "A") -> list[str]:
        """Return the units of some coefficients, where the current's is `unit`."""
        if self.per is None:
            return [f"{unit} per regressor"] * count
        each = [*self.per, *self.per[-1:] * count][:count]
        return [{"": unit, "current": ""}.get(per, f"{unit} per {per}") for per in each]


def stack(*columns: Floats) -> Floats:
    """Put regressors side by side, each contiguous in memory: they are filtered one by one."""
    return np.asarray(np.stack(columns, axis=0).T)


def geometric(low: float, high: float, count: int) -> list[float]:
    """Values from low to high at a constant ratio."""
    return [float(value) for value in np.geomspace(low, high, count)]
