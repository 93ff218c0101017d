"""One recording of six joints, written as the loggers of this world write it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq

JOINTS = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


@dataclass(frozen=True)
class Recording:
    """Stamps in s, angles in rad, speeds in rad/s, currents in A, each of shape (samples, 6)."""

    time_s: np.ndarray
    angle: np.ndarray
    speed: np.ndarray
    current: np.ndarray


def recording(rate_hz=125.0, seconds=20.0, jitter=0.0, seed=0) -> Recording:
    """Return six joints that move to and fro, with the clock of a logger that comes late."""
    rng = np.random.default_rng(seed)
    n = int(rate_hz * seconds)
    time_s = (np.arange(n) + jitter * rng.uniform(-0.5, 0.5, n)) / rate_hz
    place = 2 * np.pi * 0.25 * time_s[:, None] + np.arange(6)
    angle = 1.2 * np.sin(place)
    speed = 1.2 * 2 * np.pi * 0.25 * np.cos(place)
    current = 0.5 * np.sign(speed) + 0.8 * speed + 0.02 * rng.normal(size=speed.shape)
    return Recording(time_s, angle, speed, current)


def ur_csv(path: Path, r: Recording, start=1000.0) -> Path:
    """Write what the recorder of Universal Robots' client writes."""
    names = ["timestamp"]
    for kind in ("target_q", "actual_q", "actual_qd", "actual_current", "joint_temperatures"):
        names += [f"{kind}_{k}" for k in range(6)]
    names += ["actual_TCP_pose_0", "runtime_state"]
    n = len(r.time_s)
    columns = [r.time_s + start, *r.angle.T, *r.angle.T, *r.speed.T, *r.current.T]
    columns += [np.full(n, 31.0 + k) for k in range(6)] + [r.angle[:, 0], np.ones(n)]
    rows = "\n".join(" ".join(f"{v:.9g}" for v in row) for row in np.column_stack(columns))
    path.write_text(" ".join(names) + "\n" + rows + "\n")
    return path


def foreign_parquet(path: Path, r: Recording) -> Path:
    """Write lists per sample, angles in degrees, currents in mA, dates as time stamps."""
    stamps = np.datetime64("2026-03-01T08:00:00", "us") + (r.time_s * 1e6).astype("m8[us]")
    table = pa.table(
        {
            "ts": pa.array(stamps),
            "motor_current": list((r.current * 1000).astype(np.float32)),
            "joint_angle": list(np.rad2deg(r.angle)),
            "joint_speed": list(np.rad2deg(r.speed)),
            "cell": ["west"] * len(stamps),
        }
    ).replace_schema_metadata({"robot": "arm 7"})
    write = pyarrow.feather.write_feather if path.suffix == ".feather" else pq.write_table
    write(table, path)
    return path


def bag(path: Path, r: Recording, joints=JOINTS, topic="/joint_states", storage="sqlite3") -> Path:
    """Write a ROS 2 bag of joint states."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header, stamp = (
        store.types[name]
        for name in (
            "sensor_msgs/msg/JointState",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
        )
    )
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection(topic, state.__msgtype__, typestore=store)
        for k, t in enumerate(r.time_s):
            nanoseconds = 1_772_000_000_000_000_000 + round(t * 1e9)
            message = state(
                header=header(stamp(*divmod(nanoseconds, 10**9)), ""),
                name=list(joints),
                position=r.angle[k],
                velocity=r.speed[k],
                effort=r.current[k],
            )
            raw = store.serialize_cdr(message, state.__msgtype__)
            writer.write(connection, nanoseconds, raw)
    return path


def mdf(path: Path, r: Recording) -> Path:
    """Write an MDF 4 file with units."""
    from asammdf import MDF, Signal

    signals = []
    for k in range(6):
        for name, unit, values in (
            (f"Axis{k + 1}_Iq", "A", r.current),
            (f"Axis{k + 1}_Angle", "deg", np.rad2deg(r.angle)),
        ):
            signals.append(Signal(values[:, k], r.time_s, unit=unit, name=name))
    with MDF(version="4.10") as file:
        file.append(signals)
        file.save(path, overwrite=True)
    return path
