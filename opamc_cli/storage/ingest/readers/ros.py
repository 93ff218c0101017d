"""ROS 1 bags, ROS 2 bags and MCAP files: messages of type sensor_msgs/JointState.

Channels are named ``TOPIC/JOINT/position`` (`velocity`, `effort`), or ``TOPIC/position`` with the
joint's place in the messages as `index`. Time stamps are ``TOPIC/stamp`` (of the header; of the
recorder where the header has none), all in seconds since 1970. Where there is one topic, its name
may be left out: ``position``, ``stamp``. A joint that some messages leave out has a sample for
each message that holds it.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.formats import is_ros2_bag
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Array,
    Block,
    Listed,
    Name,
    Selection,
    check_lengths,
    missing_channel,
    missing_library,
)

JOINT_STATES = frozenset({"sensor_msgs/msg/JointState", "sensor_msgs/JointState"})
FIELDS = ("position", "velocity", "effort")
STAMP = "stamp"


@contextmanager
def open_ros(path: Path) -> Iterator["RosSource"]:
    """Open a bag: a folder (ROS 2) or a file (ROS 1, MCAP, SQLite).

    Raises
    ------
    InputError
        If rosbags is not installed, or it is no bag, or holds no joint states.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise missing_library(path, "rosbags", "ros") from error
    if path.is_dir() and not is_ros2_bag(path):
        msg = f"{path}: is a folder without metadata.yaml, so it is no ROS 2 bag"
        raise InputError(msg)
    try:
        # bags of older recorders do not hold the definitions of their messages
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except AnyReaderError as error:
        msg = f"{path}: cannot be opened as a ROS bag ({_reason(error)}); record it again"
        raise InputError(msg) from error
    try:
        yield RosSource(path, _read(path, reader))
    except AnyReaderError as error:
        msg = f"{path}: its messages cannot be read ({_reason(error)}); the bag is damaged"
        raise InputError(msg) from error
    finally:
        reader.close()


class RosSource:
    """The joint states of a bag: arrays by channel."""

    def __init__(self, path: Path, topics: Mapping[str, "_Topic"]) -> None:
        self.path = path
        self._topics = topics

    def channels(self) -> list[Listed]:
        """Return stamps, then every joint's fields, in the order of the messages."""
        listed: list[Listed] = []
        for topic, states in self._topics.items():
            listed.append(Listed(f"{topic}/{STAMP}", unit="s"))
            for field in FIELDS:
                listed += [
                    Listed(f"{topic}/{joint}/{field}", unit={"position": "rad"}.get(field))
                    for joint in states.joints
                    if np.isfinite(states.values[joint, field]).any()
                ]
            place = "" if len(self._topics) == 1 else f"{topic}/"
            for field in FIELDS:
                known = [j for j in states.joints if np.isfinite(states.values[j, field]).any()]
                if known:
                    labels = tuple(states.joints)
                    listed.append(Listed(place + field, width=len(labels), labels=labels))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected channels block by block."""
        columns = {name: self._column(selection) for name, selection in selections.items()}
        lengths: dict[Name, int] = {
            selections[name].source: len(values) for name, values in columns.items()
        }
        n_samples = check_lengths(self.path, lengths)
        for start in range(0, n_samples, BLOCK_ROWS):
            yield {name: values[start : start + BLOCK_ROWS] for name, values in columns.items()}

    def value(self, source: Name) -> object:
        """Return ``@started_at``, the first stamp as a date, or a channel's first value."""
        if source == "@started_at":
            first = min(float(states.stamps_s[0]) for states in self._topics.values())
            return np.datetime64(round(first * 1e6), "us")
        return self._column(Selection(source))[0]

    def _column(self, selection: Selection) -> Array:
        place, _, field = str(selection.source).rpartition("/")
        states = self._topics.get(place)
        if not place and len(self._topics) == 1:
            states = next(iter(self._topics.values()))
        if states is not None and field == STAMP:
            return np.asarray(states.stamps_s)
        if states is not None and field in FIELDS and selection.index is not None:
            if selection.index >= len(states.joints):
                msg = (
                    f"{self.path}: {selection.source!r} has joints 0..{len(states.joints) - 1} "
                    f"({', '.join(states.joints)}), index is {selection.index}"
                )
                raise InputError(msg)
            return np.asarray(states.values[states.joints[selection.index], field])
        topic, _, joint = place.rpartition("/")
        states = self._topics.get(topic)
        if states is None or (joint, field) not in states.values:
            raise missing_channel(
                self.path, selection.source, [str(c.name) for c in self.channels()]
            )
        return np.asarray(states.values[joint, field])


class _Topic:
    """What the messages of one topic hold."""

    def __init__(self) -> None:
        self.joints: list[str] = []
        self.values: dict[tuple[str, str], Any] = {}
        self.stamps_s: Any = []

    def add(self, message: Any, received_ns: int) -> None:
        stamp = message.header.stamp
        seconds = stamp.sec + stamp.nanosec * 1e-9
        self.stamps_s.append(seconds if seconds > 0 else received_ns * 1e-9)
        n = len(message.name)
        rows = {field: getattr(message, field) for field in FIELDS}
        for place, joint in enumerate(message.name):
            if joint not in self.joints:
                self.joints.append(joint)
                self.values.update({(joint, field): [] for field in FIELDS})
            for field, row in rows.items():
                # a driver that does not know a field leaves it empty
                self.values[joint, field].append(row[place] if len(row) == n else np.nan)

    def done(self) -> None:
        self.stamps_s = np.asarray(self.stamps_s, dtype=np.float64)
        self.values = {key: np.asarray(v, dtype=np.float64) for key, v in self.values.items()}


def _read(path: Path, reader: Any) -> dict[str, _Topic]:
    wanted = [c for c in reader.connections if c.msgtype in JOINT_STATES]
    if not wanted:
        kinds = sorted({c.msgtype for c in reader.connections})
        msg = (
            f"{path}: holds no sensor_msgs/JointState ({', '.join(kinds[:6]) or 'no messages'}); "
            "record the topic of the joint states"
        )
        raise InputError(msg)
    topics: dict[str, _Topic] = {}
    for connection, received_ns, raw in reader.messages(connections=wanted):
        message = reader.deserialize(raw, connection.msgtype)
        topics.setdefault(connection.topic, _Topic()).add(message, received_ns)
    if not topics:
        msg = f"{path}: topic {wanted[0].topic} holds no message; record it again"
        raise InputError(msg)
    for states in topics.values():
        states.done()
    return topics


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
