"""Stage simulate: record sessions of the virtual testbed as runs, with the truth beside them."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.config.models import digest
from opamc_cli.config.testbed import TestbedConfig
from opamc_cli.errors import ConfigError
from opamc_cli.stages.processes.parallel import Outcome, Watch, map_items, unwatched
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.tables import write_table
from opamc_cli.testbed.effects import KINDS
from opamc_cli.testbed.robot import AxisRecording, Recording, simulate

STAGE = "simulate"
TRUTH_FOLDER = "truth"
DAMAGE = ("severity", "share", "gap_rad", "stiffness_loss")
_FIRST_DAY = datetime(2021, 1, 1, tzinfo=UTC)
"""Sessions are one day apart from here: a recording's bytes must not depend on the clock."""


@dataclass(frozen=True)
class SessionOrder:
    """One run to be recorded."""

    config: TestbedConfig
    seed: int
    session: int
    out: Path
    truth_signals: bool


def run(
    config: TestbedConfig,
    seed: int,
    out: Path,
    *,
    truth_signals: bool = True,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome[dict[str, Any]]:
    """Record the sessions of a configuration.

    Parameters
    ----------
    config
        Robot, program, faults, effects, what is recorded.
    seed
        Seed of everything random.
    out
        Output folder.
    truth_signals
        Whether to write i_q, joint angle and temperature beside each run.
    jobs
        Worker processes; 0: one per core.
    watch
        Called as the work gets done.

    Returns
    -------
    Outcome
        Per run its entry in `truth.json`.

    Raises
    ------
    ConfigError
        If no session can be recorded.
    """
    sessions = range(
        config.recording.first_session,
        config.recording.first_session + config.recording.sessions,
    )
    orders = [SessionOrder(config, seed, session, out, truth_signals) for session in sessions]
    outcome = map_items(record_session, orders, jobs, watch)
    if not outcome.results:
        raise outcome.errors[0]
    truth = {
        "seed": seed,
        "robot": config.robot.name,
        "config_hash": digest(config.model_dump(mode="json")),
        "sampling_rate_hz": config.recording.sampling_rate_hz,
        "runs": list(outcome.results),
    }
    write_text(out / files.TRUTH, json.dumps(truth, indent=1, sort_keys=True, allow_nan=False))
    return outcome


def record_session(order: SessionOrder) -> dict[str, Any]:
    """Record one session: write its run and truth signals, return its entry in `truth.json`.

    Raises
    ------
    ConfigError
        If the program, a fault or an effect does not fit the robot.
    """
    config = order.config
    faults = {
        fault.axis: replace(
            config.robot.damage,
            severity=fault.severity,
            share=config.robot.damage.share if fault.share is None else fault.share,
        )
        for fault in config.faults
    }
    try:
        recording = simulate(
            config.robot,
            config.program,
            seed=order.seed,
            session=order.session,
            sampling_rate_hz=config.recording.sampling_rate_hz,
            faults=faults,
            effects=config.effects,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from error
    name = f"session-{order.session:03d}.parquet"
    info = RunInfo(
        sampling_rate_hz=recording.sampling_rate_hz,
        robot=config.robot.name,
        program=_program_name(config),
        speed_percent=config.program.speed_percent,
        payload_kg=config.program.payload_kg,
        started_at=(_FIRST_DAY + timedelta(days=order.session)).isoformat(),
    )
    columns: dict[str, Any] = {}
    for axis, signals in recording.axes.items():
        columns |= _columns(axis, signals, config.recording.columns)
    save_run(order.out / name, info, columns)
    entry = truth_entry(name, order.session, recording)
    if order.truth_signals:
        path = order.out / TRUTH_FOLDER / name
        write_table(
            path,
            truth_table(recording),
            stage=STAGE,
            config={"seed": order.seed, "session": order.session},
            inputs=[],
        )
        entry["signals"] = f"{TRUTH_FOLDER}/{name}"
    return entry


def truth_entry(name: str, session: int, recording: Recording) -> dict[str, Any]:
    """Return what was on in a run, and its true segments, as plain JSON types."""
    return {
        "run": name,
        "session": session,
        "n_samples": len(next(iter(recording.axes.values())).iq_a),
        "faults": [
            {"axis": axis, **{name: getattr(damage, name) for name in DAMAGE}}
            for axis, damage in sorted(recording.faults.items())
        ],
        "effects": [
            {
                "axis": effect.axis,
                "name": effect.name,
                "magnitude": effect.magnitude,
                "unit": KINDS[effect.name].unit,
                "parameters": dict(effect.parameters),
            }
            for effect in recording.effects
        ],
        "segments": [asdict(segment) for segment in recording.segments],
        "start_temperature_c": {
            str(axis): round(session_.temperature_c, 3)
            for axis, session_ in recording.sessions.items()
        },
    }


def truth_table(recording: Recording) -> pa.Table:
    """Return i_q, joint angle, motor angle and temperature of every axis, one row per sample."""
    columns: dict[str, Any] = {}
    for axis, signals in recording.axes.items():
        columns[f"axis{axis}_iq_a"] = signals.iq_a.astype(np.float32)
        columns[f"axis{axis}_joint_angle_rad"] = signals.joint_angle_rad
        columns[f"axis{axis}_motor_angle_rad"] = signals.motor_angle_rad
        columns[f"axis{axis}_temperature_c"] = signals.true_temperature_c.astype(np.float32)
    return pa.table(columns)


def _columns(axis: int, signals: AxisRecording, wanted: Sequence[str]) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    if "phases" in wanted:
        for index, phase in enumerate("abc"):
            columns[f"axis{axis}_{phase}"] = np.ascontiguousarray(signals.phases_a[:, index])
    if "current" in wanted:
        columns[f"axis{axis}_current"] = signals.reported_a
    if "position" in wanted:
        columns[f"axis{axis}_position"] = signals.position_rad
    if "velocity" in wanted:
        columns[f"axis{axis}_velocity"] = signals.velocity_rad_s.astype(np.float32)
    if "temperature" in wanted:
        columns[f"axis{axis}_temperature"] = signals.temperature_c
    return columns


def _program_name(config: TestbedConfig) -> str:
    """Name what the robot was taught: speed and payload are conditions, not the program."""
    taught = {
        "waypoints_rad": list(config.program.waypoints_rad),
        "axes": list(config.program.axes),
        "order": config.program.order,
    }
    return f"{config.program.order}-{digest(taught)[:8]}"
