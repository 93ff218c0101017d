"""Pictures of benchmarks/chain/thesis_cases.py, after the thesis's Figures 5-4 to 5-14."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from opamc_cli.decision.divergence.discriminant import fit

mpl.use("Agg")
from matplotlib import pyplot as plt

SPEEDS = (20, 50, 100)
NORMAL, FAULT = "#3b6ea5", "#c0392b"


def draw_all(study: Any, folder: Path, normal_axis: int, fault_axis: int) -> None:
    """Draw every picture of the study into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})
    tau_sweep(study, folder / "tau_sweep.png", fault_axis)
    jsd_scatter(study, folder / "jsd_scatter.png", fault_axis)
    feature_space(study, folder / "feature_space.png", normal_axis, fault_axis)
    latent_axis(study, folder / "latent_axis.png", normal_axis, fault_axis)


def _save(figure: Any, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=80, pil_kwargs={"optimize": True})
    plt.close(figure)


def tau_sweep(study: Any, path: Path, axis: int) -> None:
    """JSD of every segment over the delay, one seed, order 5; lines join the means."""
    figure, panels = plt.subplots(1, 3, figsize=(9.5, 2.8), sharey=True)
    for panel, speed in zip(panels, SPEEDS, strict=True):
        case = study.of(speed, 0)[0]
        for role, colour, shift in (("baseline", NORMAL, -0.12), ("target", FAULT, 0.12)):
            rows = np.array(
                [(t, j) for r, a, o, t, j in case["jsd"] if (r, a, o) == (role, axis, 5)]
            )
            panel.plot(rows[:, 0] + shift, rows[:, 1], ".", ms=2, alpha=0.5, color=colour)
            taus = np.unique(rows[:, 0])
            means = [rows[rows[:, 0] == t, 1].mean() for t in taus]
            label = "before" if role == "baseline" else "after grinding"
            panel.plot(taus, means, "-", lw=1.2, color=colour, label=label)
        panel.axvline(case["tau_opt"][5], ls="--", lw=0.8, color="grey")
        panel.set_title(f"{speed} % (dashed: (4-2), γ = 2)")
        panel.set_xlabel("τ, samples")
    panels[0].set_ylabel("JSD of axis 3, bits")
    panels[0].legend(frameon=False)
    _save(figure, path)


def jsd_scatter(study: Any, path: Path, axis: int) -> None:
    """JSD of every segment of all seeds at the delay of (4-2), and its histogram; order 5."""
    figure, panels = plt.subplots(2, 3, figsize=(9.5, 4.4), sharey="row")
    for column, speed in enumerate(SPEEDS):
        values = {"baseline": [], "target": []}
        for case in study.of(speed, 0):
            tau = case["tau_opt"][5]
            for role, a, o, t, jsd in case["jsd"]:
                if (a, o, t) == (axis, 5, tau) and jsd is not None:
                    values[role].append(jsd)
        top = max(map(max, values.values()))
        for role, colour in (("baseline", NORMAL), ("target", FAULT)):
            label = "before" if role == "baseline" else "after grinding"
            panels[0, column].plot(values[role], ".", ms=2.5, color=colour, label=label)
            panels[1, column].hist(
                values[role], bins=np.linspace(0, top, 50), color=colour, alpha=0.7
            )
        panels[0, column].set_title(f"{speed} %")
        panels[0, column].set_xlabel("segment")
        panels[1, column].set_xlabel("JSD, bits")
    panels[0, 0].set_ylabel("JSD of axis 3, bits")
    panels[1, 0].set_ylabel("segments")
    panels[0, 0].legend(frameon=False)
    _save(figure, path)


def _rows(
    study: Any, order: int, normal_axis: int, fault_axis: int
) -> tuple[np.ndarray, np.ndarray]:
    rows, labels = [], []
    for case in study.cases:
        for row in case["features"]:
            if row["order"] == order and row["axis"] in (normal_axis, fault_axis):
                rows.append([row["delta_mu"], row["delta_var"], row["ks"]])
                labels.append(row["axis"] == fault_axis)
    return np.array(rows), np.array(labels)


def feature_space(study: Any, path: Path, normal_axis: int, fault_axis: int) -> None:
    """Δμ, Δσ² and KS of every seed and condition."""
    figure = plt.figure(figsize=(9.0, 3.8))
    for position, order in enumerate((4, 5), 1):
        panel = figure.add_subplot(1, 2, position, projection="3d")
        rows, fault = _rows(study, order, normal_axis, fault_axis)
        for mask, colour, label in ((~fault, NORMAL, "normal axis"), (fault, FAULT, "faulty axis")):
            panel.scatter(*rows[mask].T, s=10, color=colour, label=label)
        panel.set_xlabel("Δμ")
        panel.set_ylabel("Δσ²")
        panel.set_zlabel("KS")
        panel.set_title(f"order {order}")
        panel.locator_params(nbins=4)
    panel.legend(frameon=False)
    _save(figure, path)


def latent_axis(study: Any, path: Path, normal_axis: int, fault_axis: int) -> None:
    """Project the same rows by the discriminant."""
    figure, panels = plt.subplots(2, 1, figsize=(8.0, 2.6), sharex=True)
    for panel, order in zip(panels, (4, 5), strict=True):
        rows, fault = _rows(study, order, normal_axis, fault_axis)
        latent = fit(rows, fault).project(rows)
        for mask, colour in ((~fault, NORMAL), (fault, FAULT)):
            panel.plot(latent[mask], np.zeros(mask.sum()), "|", ms=16, color=colour)
        panel.axhline(0, lw=0.6, color="grey", zorder=0)
        panel.set_yticks([])
        panel.set_ylabel(f"order {order}", rotation=0, ha="right", va="center")
    panels[-1].set_xlabel("latent axis, within-class standard deviations")
    _save(figure, path)
