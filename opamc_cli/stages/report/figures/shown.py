"""Which figures a report has, in their order; who draws none does not load matplotlib."""

from opamc_cli.stages.report.figures import (
    envelopes,
    feature_space,
    jsd_histogram,
    jsd_scatter,
    latent_axis,
    motion_signal,
    order_spectrum,
    ordinal_distribution,
    partial_residuals,
    residual,
    similarity,
)

EVIDENCE = (
    ("divergence of every segment", jsd_scatter.figure),
    ("distribution of the divergences", jsd_histogram.figure),
    ("ordinal patterns", ordinal_distribution.figure),
    ("envelope", envelopes.figure),
    ("feature space", feature_space.figure),
    ("latent axis", latent_axis.figure),
    ("motion signal", motion_signal.figure),
    ("identification", similarity.figure),
)
"""The thesis's figures: first what the verdict rests on, then how the segments were found."""

LOOP = (
    ("partial residuals", partial_residuals.figure),
    ("residual", residual.figure),
    ("order spectrum", order_spectrum.figure),
)
