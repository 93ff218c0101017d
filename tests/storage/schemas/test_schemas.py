"""docs/formats.md says of every table what storage/schemas does."""

import re
from pathlib import Path

import pyarrow as pa
import pytest

from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import LIMITS, MAY_BE_NULL, TABLES, UNITS

ROOT = Path(__file__).parents[3]
FORMATS = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
HEADINGS = re.compile(r"^### (.*parquet.*)$", re.MULTILINE)
UNITLESS = {
    *("similarity", "gamma", "jsd", "chance", "excess", "base", "delta_mu", "delta_var", "ks"),
    *("lda", "self_consistency", "patterns_per_cell", "coefficient", "standard_error", "low"),
    *("high", "condition_number", "score", "p_value", "gain", "t_value", "order"),
}
SAID = {"variance": "A²", "log_power": "power in A²", "log_amplitude": "each in A"}
"""Units that no name ends in."""


def sections() -> dict[str, str]:
    """Return the text of each table, by its file's name."""
    parts = re.split(r"^(?=#{2,3} )", FORMATS, flags=re.MULTILINE)
    found = {}
    for part in parts:
        heading = HEADINGS.match(part)
        for name in re.findall(r"\w+\.parquet", heading[1]) if heading else ():
            found[name] = part
    return found


def documented(text: str) -> set[str]:
    """Return the columns of a section's table."""
    cells = re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
    return {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}


@pytest.mark.parametrize("name", TABLES)
def test_every_column_stands_in_its_table_s_section(name):
    text = sections()[name]
    inherited = set()
    if "The columns of segments.parquet" in text:
        inherited = set(TABLES[files.SEGMENTS].names)
    missing = [c for c in TABLES[name].names if f"`{c}`" not in text and c not in inherited]
    assert missing in ([], ["axis"])  # residuals and order_spectrum share a sentence with fit


@pytest.mark.parametrize("name", TABLES)
def test_no_section_tells_of_a_column_that_there_is_not(name):
    text = sections()[name]
    known = {c for other, own in TABLES.items() if sections()[other] == text for c in own.names}
    assert documented(text) <= known


@pytest.mark.parametrize("name", TABLES)
def test_every_number_has_a_unit_or_none(name):
    for field in TABLES[name]:
        kind = field.type.value_type if pa.types.is_list(field.type) else field.type
        if not pa.types.is_floating(kind) or field.name in UNITLESS:
            continue
        unit = SAID.get(field.name) or next(
            (u for end, u in UNITS.items() if field.name.endswith(f"_{end}")), None
        )
        assert unit, field.name
        if field.name in SAID:
            assert unit in FORMATS


def test_limits_are_of_columns():
    columns = {name for table in TABLES.values() for name in table.names}
    assert set(LIMITS) | MAY_BE_NULL <= columns
