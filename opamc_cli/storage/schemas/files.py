"""Names of the files in an output folder; nobody writes one of them a second time."""

SEGMENTS = "segments.parquet"
MOTIONS = "motions.parquet"
PATTERNS = "patterns.parquet"
SPECTRA = "spectra.parquet"
PROFILES = "profiles.parquet"
AMPLITUDES = "amplitudes.parquet"
SCORES = "scores.parquet"
FEATURES = "features.parquet"
VERDICT = "verdict.json"
FINDINGS = "findings.json"
REPORT = "report.html"

SWEEP = "sweep.parquet"
SWEEP_FIGURE = "sweep.png"
SELECTION = "selection.parquet"

FIT = "fit.parquet"
CANDIDATES = "candidates.parquet"
RESIDUALS = "residuals.parquet"
ORDER_SPECTRUM = "order_spectrum.parquet"
LOOP = "loop.json"
EVALUATION = "evaluation.json"
MODEL = "model.yaml"

TRUTH = "truth.json"

HISTORY = "history.sqlite"
PAGE = "index.html"
METRICS = "metrics.prom"

OF_NIGHT = frozenset({VERDICT, REPORT})
"""All that a night's folder holds."""
