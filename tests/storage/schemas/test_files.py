"""Every name of a file is written once, and documented."""

import re
from pathlib import Path

from opamc_cli.storage.schemas import files

ROOT = Path(__file__).parents[3]
NAMES = {name: value for name, value in vars(files).items() if name.isupper()}


def test_no_file_name_is_written_twice():
    for path in (ROOT / "opamc_cli").rglob("*.py"):
        if path.name == "files.py":
            continue
        text = re.sub(r'""".*?"""', "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        written = set(re.findall(r'"([\w.]+)"', text)) & set(NAMES.values())
        assert not written, f"{path.name}: {written}"


def test_every_file_is_documented_by_its_name():
    docs = (ROOT / "docs").glob("*.md")
    said = set(re.findall(r"\w+\.[a-z]+\b", "\n".join(p.read_text("utf-8") for p in docs)))
    assert set(NAMES.values()) <= said
