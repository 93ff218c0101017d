"""metrics.prom: the cell for the node exporter's textfile collector."""

from collections.abc import Iterator
from datetime import UTC, datetime

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.summary import Summary
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.schemas import files

STATES = ("healthy", "changed", "fault", "insufficient-data")


def write_metrics(cell: CellConfig, summary: Summary) -> None:
    """Write the cell's metrics, unless they are as they were."""
    path = cell.out / files.METRICS
    text = "\n".join(_lines(summary)) + "\n"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def _lines(summary: Summary) -> Iterator[str]:
    """Yield Prometheus' text format; the file's own time tells when the cell was looked at."""
    robots = [(_labels(robot=robot.name), robot) for robot in summary.robots]
    joints = [
        (_labels(robot=robot.name, program=joint.program, axis=str(joint.axis)), joint)
        for robot in summary.robots
        for joint in robot.joints
    ]
    yield from _family("opamc_joint_alarm", "1: an alarm stands, 2: it was acknowledged.")
    codes = {"alarm": 1, "known": 2}
    yield from (f"opamc_joint_alarm{of} {codes.get(one.shown, 0)}" for of, one in joints)
    yield from _family(
        "opamc_joint_state", "In the last night, 0 healthy, 1 changed, 2 fault, 3 not judged."
    )
    yield from (
        f"opamc_joint_state{of} {STATES.index(one.state)}"
        for of, one in joints
        if one.state in STATES  # its baseline may be recorded anew
    )
    yield from _family("opamc_joint_health_index", "Of the last night; 0 healthy, larger is worse.")
    yield from (
        f"opamc_joint_health_index{of} {one.health_index:g}"
        for of, one in joints
        if one.health_index is not None
    )
    yield from _family("opamc_robot_failed", "1: its last night is missing or not wholly judged.")
    yield from (f"opamc_robot_failed{of} {int(one.unwatched)}" for of, one in robots)
    yield from _family("opamc_robot_last_night_seconds", "Last night of the robot, Unix time.")
    yield from (
        f"opamc_robot_last_night_seconds{of} {_unix(one.last_night)}"
        for of, one in robots
        if one.last_night
    )


def _family(name: str, help_text: str) -> Iterator[str]:
    yield f"# HELP {name} {help_text}"
    yield f"# TYPE {name} gauge"


def _labels(**values: str) -> str:
    pairs = (f'{name}="{_escaped(value)}"' for name, value in values.items())
    return "{" + ",".join(pairs) + "}"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _unix(night: str) -> int:
    return int(datetime.fromisoformat(night).replace(tzinfo=UTC).timestamp())
