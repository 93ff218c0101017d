"""The rules beside the search: every one that is asked for has a name, and every name is asked."""

import re
from pathlib import Path

import opamc_cli
from opamc_cli.joint.name.rules import RULES


def test_every_rule_that_is_asked_for_is_in_the_list_and_every_other_way_round():
    asked = set()
    for file in (Path(opamc_cli.__file__).parent / "joint").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        asked |= set(re.findall(r'"(\w+)" (?:not )?in (?:\w+\.)?without\w*', text))
    assert asked == set(RULES)


def test_every_rule_says_what_it_asks():
    assert all(RULES.values())
    assert len(set(RULES.values())) == len(RULES)
