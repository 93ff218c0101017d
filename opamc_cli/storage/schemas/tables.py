"""Tables of an output folder: their columns, types, units, and what values are possible."""

from collections.abc import Mapping

import pyarrow as pa

from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.channels import MOST_HZ

COLUMNS: Mapping[pa.DataType, str] = {
    pa.string(): "run kind signal role left_out effect parameters unit domain why_not",
    pa.bool_(): "edge reference added",
    pa.int8(): "direction order",
    pa.int16(): "axis regressor round",
    pa.int32(): "segment cycle motion tau tau_opt frames bins parts",
    pa.int64(): "start stop lag reference_samples n_patterns n_masked n_pool n_baseline n_target",
    pa.float64(): "sampling_rate_hz f_max_hz reference_f_max_hz variance similarity temperature_c "
    "gamma bin_hz jsd chance excess base delta_mu delta_var ks lda self_consistency "
    "patterns_per_cell coefficient standard_error low high condition_number rmse_a score p_value "
    "gain t_value time_s position_rad velocity_rad_s residual_before_a residual_after_a before_a "
    "after_a",
    pa.list_(pa.int64()): "counts",
    pa.list_(pa.float32()): "log_power current_a log_amplitude",
}
"""A column is of one type in all tables but one, see `ORDER_SPECTRUM`."""

_TYPES = {name: kind for kind, names in COLUMNS.items() for name in names.split()}


def _table(columns: str) -> pa.Schema:
    return pa.schema([(name, _TYPES[name]) for name in columns.split()])


_PLACE = "run axis cycle motion segment start stop"
PLACE = tuple(_PLACE.split())
"""Columns that say what a row is of."""

SEGMENTS = _table(
    "run axis segment start stop sampling_rate_hz f_max_hz direction variance edge kind signal "
    "temperature_c"
)
MOTIONS = _table(
    " ".join(SEGMENTS.names)
    + " cycle motion similarity lag reference reference_f_max_hz reference_samples"
)
PATTERNS = _table(
    f"{_PLACE} order tau gamma f_max_hz n_patterns n_masked counts signal temperature_c"
)
SPECTRA = _table(f"{_PLACE} frames bins bin_hz log_power")
PROFILES = _table(f"{_PLACE} parts current_a")
AMPLITUDES = _table(f"{_PLACE} parts log_amplitude")
SCORES = _table(
    "role run axis cycle motion segment order tau n_patterns n_pool left_out jsd chance excess base"
)
FEATURES = _table("axis motion order delta_mu delta_var ks n_baseline n_target f_max_hz lda base")
SWEEP = _table("role run axis cycle motion order tau n_patterns jsd tau_opt")
SELECTION = _table("axis order gamma self_consistency patterns_per_cell")
FIT = _table(
    "axis effect parameters regressor coefficient unit standard_error low high condition_number "
    "rmse_a"
)
CANDIDATES = _table("axis round effect domain parameters score p_value gain t_value added why_not")
RESIDUALS = _table("axis time_s position_rad velocity_rad_s residual_before_a residual_after_a")
ORDER_SPECTRUM = pa.schema(
    [("axis", pa.int16()), ("order", pa.float64()), *_table("before_a after_a")]
)
"""Its order is a line's, periods per motor turn."""

TABLES: Mapping[str, pa.Schema] = {
    files.SEGMENTS: SEGMENTS,
    files.MOTIONS: MOTIONS,
    files.PATTERNS: PATTERNS,
    files.SPECTRA: SPECTRA,
    files.PROFILES: PROFILES,
    files.AMPLITUDES: AMPLITUDES,
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
    "reference_f_max_hz": (1e-9, MOST_HZ),
    "base": (1, 1e15),
    "jsd": (0, 1e3),
    "ks": (0, 1),
    "frames": (0, 1e6),
    "bins": (0, 1e6),
}
"""Of the values of stage tables, both included; other columns have to be within `LARGEST`."""
