"""Trained discriminants by order, in one JSON file that grows with every labelled diagnosis."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pyarrow as pa
from pydantic import Field

from opamc_cli.config.reading import read_text
from opamc_cli.decision.divergence.discriminant import FEATURE_NAMES, LinearDiscriminant, fit
from opamc_cli.errors import InputError
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.files.json_documents import LARGEST, MOST_BYTES, Document, parsed
from opamc_cli.storage.runs.hashes import file_sha256

CONDITIONS = ("f_max_hz",)


@dataclass(frozen=True)
class LatentModels:
    """Discriminants of (Δμ, Δσ², KS), one for each order."""

    path: Path
    """The file they came from or go to."""
    rows: tuple[Mapping[str, Any], ...]
    """Labelled training rows: features, order, conditions, `fault`, and `source`."""
    by_order: Mapping[int, LinearDiscriminant]
    """Trained discriminants; orders that lack one of the two classes have none."""

    def project(self, row: Mapping[str, Any]) -> float | None:
        """Project a row of features; None if a feature is unknown or the order untrained.

        Raises
        ------
        InputError
            If the row's conditions lie outside those of the training.
        """
        model = self.by_order.get(int(row["order"]))
        if model is None or any(row[name] is None for name in FEATURE_NAMES):
            return None
        outside = model.outside_training({name: row[name] for name in CONDITIONS})
        if outside:
            msg = (
                f"{self.path}: cannot judge axis {row['axis']}, {outside[0]} of its training; "
                "leave out --lda, or train it on labelled recordings of this condition (--learn)"
            )
            raise InputError(msg)
        return float(model.project([row[name] for name in FEATURE_NAMES]))

    def with_rows(
        self, features: Iterable[Mapping[str, Any]], fault_axes: Sequence[int], source: str
    ) -> "LatentModels":
        """Add the labelled rows of one diagnosis and train again.

        Parameters
        ----------
        features
            Rows of the feature table; those of all motions pooled are used.
        fault_axes
            Axes known to be at fault; the others are taken as normal.
        source
            What tells this diagnosis from others; rows of the same source are replaced.
        """
        kept = [row for row in self.rows if row["source"] != source]
        added = [
            {
                **{name: row[name] for name in (*FEATURE_NAMES, *CONDITIONS, "axis", "order")},
                "fault": row["axis"] in fault_axes,
                "source": source,
            }
            for row in features
            if row["motion"] == -1 and all(row[name] is not None for name in FEATURE_NAMES)
        ]
        return train(self.path, [*kept, *added])

    def summary(self) -> str:
        """Return in one line what was learned."""
        n_fault = sum(bool(row["fault"]) for row in self.rows)
        orders = ", ".join(str(order) for order in self.by_order)
        trained = f"trained for order {orders}" if orders else "not trained yet: one class is empty"
        return f"{self.path}: {len(self.rows) - n_fault} normal and {n_fault} fault rows, {trained}"

    def write(self) -> None:
        """Write the file atomically."""
        content = {
            "kind": "opamc latent axis",
            "version": 1,
            "orders": {str(order): model.as_dict() for order, model in self.by_order.items()},
            "rows": list(self.rows),
        }
        write_text(self.path, json.dumps(content, indent=2, sort_keys=True) + "\n")


def learn(
    path: Path, features: pa.Table, fault_axes: Sequence[int], patterns: Sequence[Path]
) -> LatentModels:
    """Add one diagnosis with known outcome to a model file's rows and train again.

    Parameters
    ----------
    path
        The model file; need not exist yet.
    features
        Feature table of the diagnosis.
    fault_axes
        Axes known to be at fault; all others count as normal.
    patterns
        The pattern tables it was made from: learning the same ones twice replaces their rows.

    Raises
    ------
    InputError
        If the file exists and is not a model file, or an axis has no features.
    """
    rows = features.to_pylist()
    unknown = sorted(set(fault_axes) - {row["axis"] for row in rows})
    if unknown:
        msg = f"--fault-axis {unknown[0]}: there is no such axis in {patterns[1]}"
        raise InputError(msg)
    known = read_models(path) if path.exists() else LatentModels(path, (), {})
    source = hashlib.sha256("".join(file_sha256(p) for p in patterns).encode()).hexdigest()
    return known.with_rows(rows, fault_axes, source)


def train(path: Path, rows: Sequence[Mapping[str, Any]]) -> LatentModels:
    """Train one discriminant for each order that has rows of both classes.

    Few rows make the within-class covariance unreliable: its correlations are shrunk by the
    share that the rows themselves call for.
    """
    by_order = {}
    for order in sorted({int(row["order"]) for row in rows}):
        own = [row for row in rows if row["order"] == order]
        labels = [bool(row["fault"]) for row in own]
        if len(own) < 3 or all(labels) or not any(labels):
            continue
        by_order[order] = fit(
            [[row[name] for name in FEATURE_NAMES] for row in own],
            labels,
            shrinkage=None,
            conditions={
                name: (min(row[name] for row in own), max(row[name] for row in own))
                for name in CONDITIONS
            },
        )
    return LatentModels(path, tuple(rows), by_order)


def read_models(path: Path) -> LatentModels:
    """Read a model file.

    Raises
    ------
    InputError
        If it is missing or not a model file.
    """
    advice = "train it with --learn first"
    raw = read_text(path, InputError, MOST_BYTES).encode()
    content = parsed(_ModelFile, raw, f"{path}:", advice)
    try:
        orders = {
            int(order): LinearDiscriminant.from_dict(model.model_dump())
            for order, model in content.orders.items()
        }
    except ValueError as error:
        msg = f"{path}: is not a model file of opamc ({error}); {advice}"
        raise InputError(msg) from error
    return LatentModels(path, tuple(row.model_dump() for row in content.rows), orders)


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]


Interval = Annotated[list[Number], Field(min_length=2, max_length=2)]


class _Row(Document):
    """One labelled row; see `LatentModels.rows`."""

    delta_mu: Number
    delta_var: Number
    ks: Number
    f_max_hz: Number
    axis: int
    order: Annotated[int, Field(ge=2, le=8)]
    fault: bool
    source: str


class _Class(Document):
    count: Annotated[int, Field(ge=0, le=10**9)]
    mean: Number


class _Discriminant(Document):
    """A trained discriminant; see `LinearDiscriminant.as_dict`."""

    kind: str
    version: int
    feature_names: list[str]
    weights: list[Number]
    centre: list[Number]
    classes: dict[str, _Class]
    shrinkage: Number
    conditions: dict[Literal["f_max_hz"], Interval]


class _ModelFile(Document):
    """The whole file."""

    kind: Literal["opamc latent axis"]
    version: Literal[1]
    orders: dict[Annotated[str, Field(pattern="^[2-8]$")], _Discriminant]
    rows: list[_Row]
