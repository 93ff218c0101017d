"""Linear discriminant on (Δμ, Δσ², KS), with the scaling of the thesis's tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

FEATURE_NAMES = ("delta_mu", "delta_var", "ks")


@dataclass(frozen=True)
class LinearDiscriminant:
    """A trained two-class discriminant."""

    weights: tuple[float, ...]
    """Direction, scaled so that the pooled within-class variance along it is one."""
    centre: tuple[float, ...]
    """Grand mean of the training rows."""
    n_normal: int
    n_fault: int
    """With `n_normal`: training rows of each class."""
    mean_normal: float
    mean_fault: float
    """With `mean_normal`: projected class means."""
    shrinkage: float
    """Share by which the within-class correlations were shrunk, 0..1."""
    conditions: Mapping[str, tuple[float, float]]
    """Closed range of each operating condition in the training rows."""
    feature_names: tuple[str, ...] = FEATURE_NAMES
    """Names of the features, in the order of `weights`."""

    def project(self, rows: ArrayLike) -> FloatArray:
        """Project rows of features onto the discriminant.

        Parameters
        ----------
        rows : array_like, shape (..., F)
            Features in the order of `feature_names`.

        Returns
        -------
        ndarray, shape (...)
            Zero is the grand mean of the training rows; faults are positive; the unit is the
            within-class standard deviation.
        """
        centred = np.asarray(rows, dtype=np.float64) - np.asarray(self.centre)
        return np.asarray(centred @ np.asarray(self.weights))

    def outside_training(self, conditions: Mapping[str, float]) -> list[str]:
        """Conditions that lie outside those of the training rows.

        By more than a twentieth of the larger bound's magnitude.

        Parameters
        ----------
        conditions : mapping of str to float
            Operating conditions of the rows to be judged; names the model does not know count
            as outside, names it knows but that are missing do not.

        Returns
        -------
        list of str
            One clause for each violation; empty if the model may be used.
        """
        clauses = []
        for name, value in conditions.items():
            if name not in self.conditions:
                clauses.append(f"{name} = {value:g} is unknown to the model")
                continue
            low, high = self.conditions[name]
            slack = 0.05 * max(abs(low), abs(high))
            if not low - slack <= value <= high + slack:
                clauses.append(f"{name} = {value:g} lies outside {low:g}..{high:g}")
        return clauses

    def as_dict(self) -> dict[str, Any]:
        """Plain data for a JSON file.

        Returns
        -------
        dict
            What `from_dict` accepts.
        """
        return {
            "kind": "opamc linear discriminant",
            "version": 1,
            "feature_names": list(self.feature_names),
            "weights": list(self.weights),
            "centre": list(self.centre),
            "classes": {
                "normal": {"count": self.n_normal, "mean": self.mean_normal},
                "fault": {"count": self.n_fault, "mean": self.mean_fault},
            },
            "shrinkage": self.shrinkage,
            "conditions": {name: list(bounds) for name, bounds in self.conditions.items()},
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "LinearDiscriminant":
        """Rebuild a model from `as_dict`.

        Parameters
        ----------
        content : mapping
            Parsed JSON.

        Returns
        -------
        LinearDiscriminant

        Raises
        ------
        ValueError
            If a field is missing or of the wrong form.
        """
        try:
            if content["kind"] != "opamc linear discriminant" or content["version"] != 1:
                message = f"kind {content['kind']!r}, version {content['version']!r}"
                raise ValueError(message)
            names = tuple(str(name) for name in content["feature_names"])
            weights = tuple(float(x) for x in content["weights"])
            centre = tuple(float(x) for x in content["centre"])
            if not len(names) == len(weights) == len(centre):
                message = "feature_names, weights and centre differ in length"
                raise ValueError(message)
            if not np.isfinite(weights + centre).all():
                message = "weights or centre hold numbers that are not finite"
                raise ValueError(message)
            classes = content["classes"]
            return cls(
                weights=weights,
                centre=centre,
                n_normal=int(classes["normal"]["count"]),
                n_fault=int(classes["fault"]["count"]),
                mean_normal=float(classes["normal"]["mean"]),
                mean_fault=float(classes["fault"]["mean"]),
                shrinkage=float(content["shrinkage"]),
                conditions={
                    str(name): (float(low), float(high))
                    for name, (low, high) in content["conditions"].items()
                },
                feature_names=names,
            )
        except (KeyError, TypeError, AttributeError) as error:
            message = f"field {error} is missing or malformed"
            raise ValueError(message) from error


def correlation_shrinkage(residuals: ArrayLike, divisor: int) -> float:
    """Share by which correlations should be shrunk towards none.

    Parameters
    ----------
    residuals : array_like, shape (n, F)
        Rows less their class means.
    divisor : int
        Degrees of freedom, n - K.

    Returns
    -------
    float
        0 (many rows) to 1 (hardly any).

    Notes
    -----
    Estimated risk-optimal intensity of J. Schäfer and K. Strimmer (Stat. Appl. Genet. Mol.
    Biol. 4, 2005, equation 8) for the correlation matrix.
    """
    rows = np.asarray(residuals, dtype=np.float64)
    n = len(rows)
    if divisor < 2:
        return 1.0
    spread = np.sqrt((rows**2).sum(axis=0) / divisor)
    z = np.divide(rows, spread, out=np.zeros_like(rows), where=spread > 0)
    products = z[:, :, np.newaxis] * z[:, np.newaxis, :]
    mean = products.mean(axis=0)
    variance = n / divisor**3 * ((products - mean) ** 2).sum(axis=0)
    off = ~np.eye(rows.shape[1], dtype=bool)
    squared = float(((n / divisor * mean)[off] ** 2).sum())
    if squared <= 0:
        return 1.0
    return float(np.clip(variance[off].sum() / squared, 0.0, 1.0))


def fit(
    rows: ArrayLike,
    is_fault: Sequence[bool] | NDArray[np.bool_],
    *,
    shrinkage: float | None = 0.0,
    conditions: Mapping[str, tuple[float, float]] | None = None,
) -> LinearDiscriminant:
    """Train the discriminant on labelled rows.

    Parameters
    ----------
    rows : array_like, shape (n, F)
        Features, finite.
    is_fault : sequence of bool, shape (n,)
        Labels; both classes must occur.
    shrinkage : float or None, default 0
        Share by which within-class correlations are shrunk, 0..1; None estimates it from the
        rows (`correlation_shrinkage`), which is what few rows need.
    conditions : mapping of str to (low, high), optional
        Ranges of the operating conditions of the rows.

    Returns
    -------
    LinearDiscriminant

    Raises
    ------
    ValueError
        If a class is missing, there are fewer than three rows or entries are not finite.

    Notes
    -----
    Thesis (2021), equations (2-11)..(2-14). The pooled within-class covariance has the divisor
    n-K, rows are centred on the grand mean, fault is positive: with these three conventions the
    LDA columns of Tables 5-3 and 5-4 come out within 0.001 of features that round to the printed
    ones (from the printed digits themselves within 0.0214 and 0.0146). Those of Tables 5-6 and
    5-7 stay 3 and 8 units off under any rounding, although the columns themselves have the same
    scaling: a misprint in the features.
    """
    x = np.asarray(rows, dtype=np.float64)
    fault = np.asarray(is_fault, dtype=bool)
    if x.ndim != 2 or len(x) != len(fault):
        message = f"rows have shape {x.shape}, labels {fault.shape}"
        raise ValueError(message)
    if not np.isfinite(x).all():
        message = "rows hold numbers that are not finite"
        raise ValueError(message)
    if fault.all() or not fault.any() or len(x) < 3:
        message = (
            f"{int((~fault).sum())} normal and {int(fault.sum())} fault rows: "
            "at least one of each and three in all are needed"
        )
        raise ValueError(message)
    mean_fault, mean_normal = x[fault].mean(axis=0), x[~fault].mean(axis=0)
    residuals = x - np.where(fault[:, np.newaxis], mean_fault, mean_normal)
    divisor = len(x) - 2
    share = correlation_shrinkage(residuals, divisor) if shrinkage is None else float(shrinkage)
    spread = np.sqrt((residuals**2).sum(axis=0) / divisor)
    # A feature that never varies within a class (KS = 1 in every row) would get infinite weight:
    # its spread is floored at a millionth of the largest magnitude.
    floor = 1e-6 * np.maximum(np.abs(x).max(axis=0), 1e-300)
    spread = np.maximum(spread, floor)
    scaled = residuals / spread
    correlation = scaled.T @ scaled / divisor
    correlation = (1 - share) * correlation + share * np.eye(x.shape[1])
    np.fill_diagonal(correlation, 1.0)
    difference = (mean_fault - mean_normal) / spread
    direction = np.linalg.pinv(correlation, hermitian=True) @ difference
    length = float(np.sqrt(direction @ correlation @ direction))
    weights = direction / spread / length if length > 0 else np.zeros(x.shape[1])
    centre = x.mean(axis=0)
    projected = (x - centre) @ weights
    return LinearDiscriminant(
        weights=tuple(float(w) for w in weights),
        centre=tuple(float(c) for c in centre),
        n_normal=int((~fault).sum()),
        n_fault=int(fault.sum()),
        mean_normal=float(projected[~fault].mean()),
        mean_fault=float(projected[fault].mean()),
        shrinkage=share,
        conditions=dict(conditions or {}),
    )
