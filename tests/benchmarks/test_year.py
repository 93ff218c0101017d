"""The year's figures of nights that were made up: its hour of recordings is none of CI's."""

import numpy as np
import year


def test_a_joint_that_wears_is_alarmed_by_the_commands_own_rule():
    rng = np.random.default_rng(3)
    wearing, healthy = year.lives(2, 120, 5)
    cell = []
    for life in (wearing, healthy):
        rows = []
        for night in range(6, 120):
            for axis in year.AXES:
                severity = life.severity(night) if axis == life.wearing_axis else 0.0
                p = 1e-6 if severity > 0.1 else rng.uniform(0.02, 1)
                rows.append(
                    year.Measured(
                        night,
                        axis,
                        "fault" if severity > 0.1 else "healthy",
                        p,
                        rng.normal(0, 0.1) + 2 * severity,
                        0.0,
                        0.05 + severity,
                        25.0,
                        0.0,
                        severity,
                    )
                )
        cell.append((life, rows))
    text = year.report(cell)
    assert "| wearing joints alarmed | 1 of 1 | 1 of 1 | 1 of 1 |" in text
    assert "| false alarms (per robot-year) | 0 (0.00) | 0 (0.00) | 0 (0.00) |" in text
    assert "forecasts of the fault level: " in text
