"""The rules beside the search: every one that is asked for is documented, and the reverse."""

import re
from pathlib import Path

import opamc_cli

PACKAGE = Path(opamc_cli.__file__).parent
BEGIN, END = "### The rules beside the search", "`close_loop(..., without_rules"


def test_every_rule_that_is_asked_for_is_documented_and_every_other_way_round():
    asked = set()
    for file in (PACKAGE / "joint").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        asked |= set(re.findall(r'"(\w+)" (?:not )?in (?:\w+\.)?without\w*', text))
    page = (PACKAGE.parent / "docs" / "loop.md").read_text(encoding="utf-8")
    table = page.split(BEGIN)[1].split(END)[0]
    rows = re.findall(r"^\| (\w+) \|", table, flags=re.MULTILINE)
    assert asked == set(rows) - {"rule"}
