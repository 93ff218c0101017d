"""Tables of an output folder: their columns, types, units, and what values are possible."""

from collections.abc import Mapping

import pyarrow as pa

from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.channels import MOST_HZ

PLACE = ("run", "axis", "cycle", "motion", "segment", "start", "stop")
"""Columns that say what a row is of."""

SEGMENTS = pa.schema(
    [
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("segment", pa.int32()),
        ("start", pa.int64()),
        ("stop", pa.int64()),
        ("sampling_rate_hz", pa.float64()),
        ("f_max_hz", pa.float64()),
        ("direction", pa.int8()),
        ("variance", pa.float64()),
        ("edge", pa.bool_()),
        ("kind", pa.string()),
        ("signal", pa.string()),
        ("temperature_c", pa.float64()),
    ]
)
MOTIONS = pa.schema(
    [
        *SEGMENTS,
        pa.field("cycle", pa.int32()),
        pa.field("motion", pa.int32()),
        pa.field("similarity", pa.float64()),
        pa.field("lag", pa.int64()),
        pa.field("reference", pa.bool_()),
        pa.field("reference_f_max_hz", pa.float64()),
        pa.field("reference_samples", pa.int64()),
    ]
)
PATTERNS = pa.schema(
    [
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("cycle", pa.int32()),
        ("motion", pa.int32()),
        ("segment", pa.int32()),
        ("start", pa.int64()),
        ("stop", pa.int64()),
        ("order", pa.int8()),
        ("tau", pa.int32()),
        ("gamma", pa.float64()),
        ("f_max_hz", pa.float64()),
        ("n_patterns", pa.int64()),
        ("n_masked", pa.int64()),
        ("counts", pa.list_(pa.int64())),
        ("signal", pa.string()),
        ("temperature_c", pa.float64()),
    ]
)
_PLACE = pa.schema([PATTERNS.field(name) for name in PLACE])
SPECTRA = pa.schema(
    [
        *_PLACE,
        pa.field("frames", pa.int32()),
        pa.field("bins", pa.int32()),
        pa.field("bin_hz", pa.float64()),
        pa.field("log_power", pa.list_(pa.float32())),
    ]
)
PROFILES = pa.schema(
    [
        *_PLACE,
        pa.field("parts", pa.int32()),
        pa.field("current_a", pa.list_(pa.float32())),
    ]
)
SCORES = pa.schema(
    [
        ("role", pa.string()),
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("cycle", pa.int32()),
        ("motion", pa.int32()),
        ("segment", pa.int32()),
        ("order", pa.int8()),
        ("tau", pa.int32()),
        ("n_patterns", pa.int64()),
        ("n_pool", pa.int64()),
        ("left_out", pa.string()),
        ("jsd", pa.float64()),
        ("chance", pa.float64()),
        ("excess", pa.float64()),
        ("base", pa.float64()),
    ]
)
FEATURES = pa.schema(
    [
        ("axis", pa.int16()),
        ("motion", pa.int32()),
        ("order", pa.int8()),
        ("delta_mu", pa.float64()),
        ("delta_var", pa.float64()),
        ("ks", pa.float64()),
        ("n_baseline", pa.int64()),
        ("n_target", pa.int64()),
        ("f_max_hz", pa.float64()),
        ("lda", pa.float64()),
        ("base", pa.float64()),
    ]
)
SWEEP = pa.schema(
    [
        ("role", pa.string()),
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("cycle", pa.int32()),
        ("motion", pa.int32()),
        ("order", pa.int8()),
        ("tau", pa.int32()),
        ("n_patterns", pa.int64()),
        ("jsd", pa.float64()),
        ("tau_opt", pa.int32()),
    ]
)
SELECTION = pa.schema(
    [
        ("axis", pa.int16()),
        ("order", pa.int8()),
        ("gamma", pa.float64()),
        ("self_consistency", pa.float64()),
        ("patterns_per_cell", pa.float64()),
    ]
)
FIT = pa.schema(
    [
        ("axis", pa.int16()),
        ("effect", pa.string()),
        ("parameters", pa.string()),
        ("regressor", pa.int16()),
        ("coefficient", pa.float64()),
        ("unit", pa.string()),
        ("standard_error", pa.float64()),
        ("low", pa.float64()),
        ("high", pa.float64()),
        ("condition_number", pa.float64()),
        ("rmse_a", pa.float64()),
    ]
)
CANDIDATES = pa.schema(
    [
        ("axis", pa.int16()),
        ("round", pa.int16()),
        ("effect", pa.string()),
        ("domain", pa.string()),
        ("parameters", pa.string()),
        ("score", pa.float64()),
        ("p_value", pa.float64()),
        ("gain", pa.float64()),
        ("t_value", pa.float64()),
        ("added", pa.bool_()),
        ("why_not", pa.string()),
    ]
)
RESIDUALS = pa.schema(
    [
        ("axis", pa.int16()),
        ("time_s", pa.float64()),
        ("position_rad", pa.float64()),
        ("velocity_rad_s", pa.float64()),
        ("residual_before_a", pa.float64()),
        ("residual_after_a", pa.float64()),
    ]
)
ORDER_SPECTRUM = pa.schema(
    [
        ("axis", pa.int16()),
        ("order", pa.float64()),
        ("before_a", pa.float64()),
        ("after_a", pa.float64()),
    ]
)

TABLES: Mapping[str, pa.Schema] = {
    files.SEGMENTS: SEGMENTS,
    files.MOTIONS: MOTIONS,
    files.PATTERNS: PATTERNS,
    files.SPECTRA: SPECTRA,
    files.PROFILES: PROFILES,
    files.SCORES: SCORES,
    files.FEATURES: FEATURES,
    files.SWEEP: SWEEP,
    files.SELECTION: SELECTION,
    files.FIT: FIT,
    files.CANDIDATES: CANDIDATES,
    files.RESIDUALS: RESIDUALS,
    files.ORDER_SPECTRUM: ORDER_SPECTRUM,
}

UNITS: Mapping[str, str] = {
    "hz": "Hz",
    "a": "A",
    "s": "s",
    "rad": "rad",
    "rad_s": "rad/s",
    "c": "°C",
}
"""By the end of a column's name; numbers without one have none, or theirs is in docs/formats.md."""

MAY_BE_NULL = frozenset(
    {
        *("temperature_c", "gamma", "lda"),
        *("jsd", "chance", "excess", "delta_mu", "delta_var", "ks"),
    }
)
"""Columns of stage tables in which null means unknown."""

LIMITS: Mapping[str, tuple[float, float]] = {
    "axis": (1, 999),
    "segment": (0, 1e9),
    "cycle": (-1, 1e9),
    "motion": (-1, 1e9),
    "start": (0, 1e15),
    "stop": (1, 1e15),
    "sampling_rate_hz": (1e-9, MOST_HZ),
    "direction": (-1, 1),
    "variance": (0, 1e15),
    "order": (2, 8),
    "tau": (1, 1e9),
    "n_patterns": (0, 1e15),
    "n_masked": (0, 1e15),
    "n_pool": (0, 1e15),
    "f_max_hz": (0, MOST_HZ),
    "base": (1, 1e15),
    "jsd": (0, 1e3),
    "ks": (0, 1),
    "frames": (0, 1e6),
    "bins": (0, 1e6),
}
"""Of the values of stage tables, both included; other columns have to be within `LARGEST`."""
