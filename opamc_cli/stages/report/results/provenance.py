"""Where the page comes from: configuration, versions, files and recordings."""

import json
from collections.abc import Mapping
from typing import Any

from opamc_cli.stages.report.results.inputs import ROLES, ReportInputs, merged_config
from opamc_cli.storage.schemas import files
from opamc_cli.storage.tables import library_versions

LOOP_TABLES = (files.RESIDUALS, files.ORDER_SPECTRUM)


def provenance(inputs: ReportInputs) -> dict[str, Any]:
    """Return what the page says of its own making, with nothing of this machine in it."""
    records = {file.name: file.record for file in inputs.files if file.record is not None}
    config = merged_config([r for name, r in records.items() if name not in LOOP_TABLES])
    model = [record for name, record in records.items() if name in LOOP_TABLES]
    if model:
        config["model"] = model[0].get("config")
    versions = [record["versions"] for record in records.values() if "versions" in record]
    return {
        "config": json.dumps(config, indent=2, sort_keys=True),
        "config_hash": (inputs.verdict or {}).get("config_hash"),
        "versions": versions[0] if versions else library_versions(),
        "files": inputs.files,
        "runs": [(role, source) for role in ROLES for source in inputs.roles[role].sources],
        "base": _base(inputs, config),
    }


def _base(inputs: ReportInputs, config: Mapping[str, Any]) -> str:
    base = (inputs.verdict or {}).get("base", config.get("score", {}).get("base"))
    return f"{base:g}" if isinstance(base, int | float) else "not recorded"
