"""Whether an output folder holds one whole result."""

import hashlib
import json
from pathlib import Path

import pyarrow.parquet as pq


def broken(out: Path) -> str | None:
    """Return what is half or mixed in an output folder, or None."""
    for path in sorted(out.rglob("*.parquet")):
        if ".result.part" in path.parts or path.name.startswith("."):
            continue
        if not path.exists():
            continue  # a name whose result is not there yet
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                file.read()
        except Exception as error:  # noqa: BLE001 - whatever a reader makes of it
            return f"{path.name} cannot be read: {error}"
    for name in ("verdict.json", "truth.json"):
        path = out / name
        if path.exists():
            try:
                content = json.loads(path.read_text())
            except ValueError:
                return f"{name} is no JSON"
            for table, digest in (content.get("tables") or {}).items():
                if not (out / table).exists():
                    return f"{table} of the verdict is not there"
                if hashlib.sha256((out / table).read_bytes()).hexdigest() != digest:
                    return f"{table} is not the verdict's"
            for run in content.get("runs") or []:
                if isinstance(run, dict) and not (out / run["run"]).exists():
                    return f"{run['run']} of the truth is not there"
    return None


def leftovers(out: Path) -> list[str]:
    """Return what a command should not leave behind."""
    return [
        path.name
        for path in out.rglob(".*")
        if path.name.endswith((".part", ".old")) or (path.is_symlink() and not path.exists())
    ]
