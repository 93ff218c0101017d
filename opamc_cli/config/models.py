"""Every option of every stage, with its default, its bounds and what it does.

The descriptions are the documentation: `configs/default.yaml` is made from them.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticKnownError

Positive = Annotated[float, Field(gt=0, le=1e15, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Tolerance = Annotated[float, Field(gt=0, le=1)]
"""Of relative differences: more was meant in per cent."""
Short = Annotated[float, Field(gt=0, le=60)]
"""Of parts of a motion, seconds: more was meant in milliseconds."""
LEAST_RATE = 1e-6
"""Of false alarms: once in three thousand years of nights; less silences what it is to watch."""


class Section(BaseModel):
    """Options of one stage; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="wrap")
    @classmethod
    def _is_no_switch(cls, value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        """Refuse `yes` where a number is asked: it would count as 1."""
        taken = handler(value)
        if _counts_as_number(value, taken):
            asked: Literal["float_type"] = "float_type"
            raise PydanticKnownError(asked)
        return taken


def _counts_as_number(value: Any, taken: Any) -> bool:
    """Tell whether a yes or no was taken for a number, by itself or among others."""
    if isinstance(value, dict) and isinstance(taken, dict):
        return any(_counts_as_number(one, taken.get(name)) for name, one in value.items())
    if isinstance(value, list) and isinstance(taken, tuple):
        return any(map(_counts_as_number, value, taken))
    return isinstance(value, bool) and isinstance(taken, int | float) and taken is not value


# below, the ratio upside down; above, no gear of one joint's, but a comma lost
Ratio = Annotated[float, Field(ge=0.1, le=10_000)]
Poles = Annotated[int, Field(ge=1, le=1000)]
Axis = Annotated[int, Field(ge=1)]


class JointConfig(Section):
    """Constants of the joints, where known."""

    gear_ratio: Ratio | dict[Axis, Ratio] | None = Field(
        None,
        description="Motor revolutions per joint revolution, of all joints or by axis "
        "({1: 160, 2: 100}); null if unknown.",
    )
    pole_pairs: Poles | dict[Axis, Poles] | None = Field(
        None, description="Pole pairs of the motor, likewise; null if unknown."
    )
    explain: bool = Field(
        True, description="Whether a diagnosis traces the change of an unhealthy joint to a cause."
    )
    explain_minutes: Positive = Field(
        2.0, description="Most minutes of recordings of each side that the cause is sought in."
    )
    library: tuple[Path, ...] = Field(
        (),
        description="Python files with effects of your own that may be a cause, too; their paths "
        "are absolute or count from the working directory.",
    )

    @property
    def axes_named(self) -> set[int]:
        """Axes of which something is given by themselves."""
        by_axis = [one for one in (self.gear_ratio, self.pole_pairs) if isinstance(one, dict)]
        return {axis for one in by_axis for axis in one}

    def ratio_of(self, axis: int) -> float | None:
        """Return an axis' gear ratio, None if unknown."""
        given = self.gear_ratio
        return given.get(axis) if isinstance(given, dict) else given

    def poles_of(self, axis: int) -> int | None:
        """Return an axis' pole pairs, None if unknown."""
        given = self.pole_pairs
        return given.get(axis) if isinstance(given, dict) else given


class SegmentConfig(Section):
    """Motion segmentation (thesis 3.2)."""

    engine: Literal["band-limited", "ssqueezepy"] = Field(
        "band-limited",
        description="Wavelet transform: our streaming one, or the full one of ssqueezepy.",
    )
    gamma: Annotated[float, Field(gt=0, le=20)] = Field(
        3.0, description="Symmetry of the generalised Morse wavelet."
    )
    beta: Annotated[float, Field(gt=0, le=500)] = Field(
        20.0,
        description="Compactness of the Morse wavelet: 20 is the thesis's time-bandwidth of 60; "
        "ssqueezepy's own default is 60.",
    )
    voices_per_octave: Annotated[int, Field(ge=2, le=64)] = Field(
        16, description="Scales per octave of the wavelet transform."
    )
    f_min_hz: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = Field(
        8.0, description="Slowest carrier that counts as motion, Hz; slower ones cost time."
    )
    f_max_hz: Positive | None = Field(
        None,
        description="Fastest carrier, Hz; null: 0.4 times the sampling rate, at most 1000.",
    )
    noise_floor: Positive = Field(
        3.0,
        description="Current below this many standard deviations of the noise has no carrier.",
    )
    threshold_on: Fraction = Field(0.5, description="A motion has to reach this value of S(t).")
    threshold_off: Fraction = Field(
        0.3, description="A motion lasts while S(t) stays above this value."
    )
    min_motion_s: Short = Field(0.1, description="Shorter motions are dropped.")
    min_still_s: Short = Field(
        0.06, description="Shorter standstills belong to the motion around them."
    )
    max_dip_s: Short = Field(
        2.0,
        description="Longest dip of S(t) that is bridged because the joint is fast before and "
        "after it, as while braking.",
    )
    min_speed_rad_s: Positive = Field(
        0.01, description="A joint that never gets faster stands still (reported current only)."
    )
    windows: Annotated[int, Field(ge=1, le=1000)] = Field(
        4, description="Windows into which a recording that never stands still is cut."
    )
    min_window_samples: Annotated[int, Field(ge=10, le=10**9)] = Field(
        1200,
        description="Least samples of such a window: ten for each pattern of order 5; fewer "
        "windows are made otherwise.",
    )

    @model_validator(mode="after")
    def _thresholds_make_a_hysteresis(self) -> Self:
        if self.threshold_off > self.threshold_on:
            msg = (
                f"threshold_off is {self.threshold_off:g}, threshold_on {self.threshold_on:g}; "
                "a motion has to reach more than it has to keep"
            )
            raise ValueError(msg)
        return self


class IdentifyConfig(Section):
    """Identification of cycles and motions (thesis 3.3)."""

    segments_per_cycle: Annotated[int, Field(ge=1, le=10_000)] | None = Field(
        None, description="Motions in a cycle; null: found from the repetition in the reference."
    )
    min_similarity: Fraction = Field(
        0.9, description="Least cosine similarity of variance vectors for a cycle to be one."
    )
    duration_tolerance: Tolerance = Field(
        0.35,
        description="Largest relative difference of a segment's duration from the reference's.",
    )
    speed_tolerance: Tolerance = Field(
        0.01,
        description="Largest relative difference of how long a recording's motions last, the "
        "middle one, from the baseline's; of another speed nothing can be compared.",
    )
    f_max_tolerance: Tolerance = Field(
        0.25, description="Largest relative difference of f_d,max from the reference's."
    )
    use_direction: bool = Field(
        True, description="A segment that turns the other way than the reference's does not match."
    )
    max_lag_s: Short = Field(
        0.5, description="Largest lag that the synchronisation with the reference looks at."
    )


class PatternsConfig(Section):
    """Ordinal pattern analysis of the envelope (thesis 4.2)."""

    orders: tuple[Annotated[int, Field(ge=3, le=7)], ...] = Field(
        (4, 5), min_length=1, description="Orders of the ordinal patterns, 3..7."
    )
    gamma: Positive = Field(
        2.0, description="Periods of the fastest carrier that the pattern window spans (4-2)."
    )
    tau: Annotated[int, Field(ge=1, le=10**6)] | None = Field(
        None, description="Fixed time delay in samples; null: from (4-2) for each motion."
    )
    envelope: Literal["auto", "clarke", "hilbert", "reported"] = Field(
        "auto",
        description="Where the envelope comes from: Clarke vector of three phases, Hilbert "
        "transform of the first phase, or the modulus of the reported current.",
    )
    remove_offset: bool = Field(
        True,
        description="Take the current sensors' offset, found from whole turns of the current "
        "vector, off before the envelope; it drifts between sessions. The thesis does not.",
    )
    frames: Annotated[int, Field(ge=0, le=256)] = Field(
        16,
        description="Parts of a motion, overlapping by half, of which the envelope's spectrum is "
        "kept for the decision beside the patterns; 0: patterns alone, as the thesis.",
    )
    bins: Annotated[int, Field(ge=2, le=256)] = Field(
        16, description="Lowest frequencies of each part that are kept, in periods per part."
    )
    parts: Annotated[int, Field(ge=0, le=1024)] = Field(
        32,
        description="Equal parts of a motion whose mean current is kept, for the decision by its "
        "course; 0: none.",
    )


class ScoreConfig(Section):
    """Divergence, features and decision (thesis 4.3)."""

    base: Annotated[float, Field(gt=1, allow_inf_nan=False)] = Field(
        2.0, description="Base of the logarithm in the Jensen-Shannon divergence."
    )
    false_alarm_rate: Annotated[float, Field(ge=LEAST_RATE, lt=0.5)] = Field(
        0.01,
        description="Largest accepted probability of any false alarm over all joints of one "
        "diagnosis.",
    )
    minimum_effect: Fraction = Field(
        0.1,
        description="Least relative change of the pattern probabilities (root mean square) that "
        "is reported, however certain it is.",
    )
    fault_effect: Fraction = Field(
        0.3, description="Relative change from which a change of unknown cause is called a fault."
    )
    permutations: Annotated[int, Field(ge=100, le=100_000)] = Field(
        1000, description="Most ways of exchanging sessions or cycles that are evaluated."
    )
    seed: Annotated[int, Field(ge=0, le=2**63)] = Field(
        0, description="Seed of the draw where there are more ways."
    )
    day_starts_at: Annotated[float, Field(ge=0, lt=24)] = Field(
        12.0,
        description="Hour of the day, UTC, at which one night of recordings ends and the next "
        "begins; noon, so that a night shift is one session.",
    )


class ReportConfig(Section):
    """The report."""

    title: Annotated[str, Field(max_length=200)] = Field(
        "Joint health", description="Heading of the HTML report."
    )


class Config(Section):
    """All options of a diagnosis."""

    joint: JointConfig = JointConfig()
    segment: SegmentConfig = SegmentConfig()
    identify: IdentifyConfig = IdentifyConfig()
    patterns: PatternsConfig = PatternsConfig()
    score: ScoreConfig = ScoreConfig()
    report: ReportConfig = ReportConfig()

    def canonical(self, *sections: str) -> dict[str, Any]:
        """Return the values of some sections (all by default) as plain JSON types."""
        values = self.model_dump(mode="json")
        return {name: values[name] for name in sorted(sections or values)}

    def digest(self) -> str:
        """Return the SHA-256 of all canonical values."""
        return digest(self.canonical())


def digest(values: Mapping[str, Any]) -> str:
    """Return the SHA-256 of configuration values of plain JSON types, whatever their order."""
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
