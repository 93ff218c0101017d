"""What a run says of itself: the JSON of its schema metadata key `opamc`."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from opamc_cli.errors import InputError
from opamc_cli.storage.files.json_documents import Document, parsed
from opamc_cli.storage.schemas.channels import (
    LEAST_HZ,
    MOST_HZ,
)

METADATA_KEY = b"opamc"


@dataclass(frozen=True)
class RunInfo:
    """What a run says of itself in the schema metadata key `opamc`."""

    sampling_rate_hz: float
    """Samples per second; required, positive."""
    robot: str | None = None
    program: str | None = None
    """With `robot`: names; runs of different program or robot are not comparable."""
    speed_percent: float | None = None
    payload_kg: float | None = None
    """With `speed_percent`: conditions of the recording."""
    started_at: str | None = None
    """ISO 8601, UTC."""
    session: str | None = None
    """Name of the recording session; runs of one session are not independent."""
    source_sha256: str | None = None
    map_sha256: str | None = None
    """With `source_sha256`: of the file that the run was made from, and of the map that it was read
    by."""
    current_unit: str = "A"
    """"A", or "Nm" where a joint's torque stands for its motor's current."""

    def to_json(self) -> str:
        """Return canonical JSON without the unknown fields and an ordinary unit."""
        known = {key: value for key, value in asdict(self).items() if value is not None}
        if self.current_unit == "A":
            del known["current_unit"]
        return json.dumps(known, sort_keys=True)


def _as_text(value: object) -> object:
    # a program called 7 in one run and "7" in another is the same program
    return str(value) if isinstance(value, int | float) else value


def _as_moment(text: str) -> str:
    # one that no session can be told by is worse than none; loggers write "" for none
    try:
        if text:
            datetime.fromisoformat(text)
    except ValueError as error:
        kind, needed = "time", "an ISO 8601 time such as 2026-03-01T22:00:00Z is needed, or none"
        raise PydanticCustomError(kind, needed) from error
    return text


Text = Annotated[str, Field(max_length=1000), BeforeValidator(_as_text)]


Speed = Annotated[float, Field(gt=0, le=1e6)]
Payload = Annotated[float, Field(ge=0, le=1e6)]


class RunMetadata(Document):
    """The JSON of the metadata key `opamc`; see `RunInfo`."""

    sampling_rate_hz: Annotated[float, Field(ge=LEAST_HZ, le=MOST_HZ)]
    robot: Text | None = None
    program: Text | None = None
    speed_percent: Speed | None = None
    payload_kg: Payload | None = None
    started_at: Annotated[Text, AfterValidator(_as_moment)] | None = None
    session: Text | None = None
    source_sha256: Text | None = None
    map_sha256: Text | None = None
    current_unit: Literal["A", "Nm"] = "A"


def parse_info(path: Path, metadata: Mapping[bytes, bytes] | None) -> RunInfo:
    """Read what a file's schema metadata say of the run.

    Raises
    ------
    InputError
        If they say nothing, or what is out of bounds.
    """
    raw = (metadata or {}).get(METADATA_KEY)
    if raw is None:
        what = "is a stage table" if b"opamc_table" in (metadata or {}) else "is not a run"
        msg = (
            f"{path}: {what}: its schema metadata has no key 'opamc' with sampling_rate_hz; "
            "make a run of it with `opamc ingest`"
        )
        raise InputError(msg)
    document = parsed(RunMetadata, raw, f"{path}: metadata key 'opamc'", "write the run again")
    return RunInfo(**document.model_dump())
