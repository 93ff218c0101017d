"""docs/architecture.md: its rooms are there, and its recipes do what they say."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ONE = ROOT / "data" / "samples" / "normal" / "session-000.parquet"


def test_every_room_stands_in_the_picture_and_every_path_is_there():
    picture = re.search(r"```\n(.*?)```", PAGE, re.DOTALL)[1]
    rooms = {path.parent for path in (ROOT / "opamc_cli").glob("*/__init__.py")}
    assert [room.name for room in rooms if f"{room.name}/" not in picture] == []
    stages = {path.parent for path in (ROOT / "opamc_cli" / "stages").glob("*/__init__.py")}
    assert [room.name for room in stages if f"{room.name}/" not in picture] == []


def followed(section: str, folder: Path) -> Path:
    """Follow a recipe in a copy of the package."""
    package = folder / "opamc_cli"
    shutil.copytree(ROOT / "opamc_cli", package)
    for name in ("configs", "data"):
        (folder / name).symlink_to(ROOT / name)
    text = re.search(rf"^## {section}\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)[1]
    steps = re.findall(r"```python\n# (new|in) ?:? ?([\w./]+)(?:, below: ([^\n]*))?\n(.*?)```", text, re.DOTALL)  # fmt: skip  # noqa: E501
    assert len(steps) >= 2
    for kind, place, line, code in steps:
        path = folder / place
        if kind == "new":
            path.write_text(code)
            continue
        before = path.read_text().split("\n")
        assert before.count(line) == 1, (place, line)
        at = before.index(line) + 1
        path.write_text("\n".join([*before[:at], code.rstrip("\n"), *before[at:]]))
    return folder


def python(folder: Path, *arguments: object) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    ended = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=folder,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.long
def test_an_effect_is_added(tmp_path):
    folder = followed("Add an effect", tmp_path)
    shown = python(folder, "-m", "opamc_cli", "model", "effects", "cubic_friction", "--json")
    assert "starved bearing" in shown
    code = (
        "import sys; sys.path.insert(0, 'studies')\n"
        "from closing import close_recording, fit_declared, joint_of\n"
        "from opamc_cli.joint.effects.library import built_in_library\n"
        "assert 'cubic_friction' in built_in_library()\n"
        "recording = joint_of('cyclic', lambda q, v, a, t: v**3, strength=5.0, rate=100.0)\n"
        "base = ('inertia', 'gravity', 'coulomb', 'viscous', 'cubic_friction')\n"
        "without, beside = (fit_declared([recording], None, b) for b in (base[:-1], base))\n"
        "assert beside.residual_a.std() < 0.5 * without.residual_a.std()\n"
    )
    (folder / "studies").mkdir()
    for source in (ROOT / "tests" / "joint" / "closing.py", *sources("simulator.py")):
        shutil.copy(source, folder / "studies")
    python(folder, "-c", code)


def sources(*names: str) -> list[Path]:
    return [ROOT / "benchmarks" / "sources" / name for name in names]


@pytest.mark.long
def test_a_witness_is_added(tmp_path):
    folder = followed("Add a witness", tmp_path)
    # four sessions of eight, and no figures: the witness has its say all the same
    for role, n in (("normal", 3), ("fault", 1)):
        (folder / role).mkdir()
        for path in sorted((ROOT / "data" / "samples" / role).glob("*.parquet"))[:n]:
            (folder / role / path.name).symlink_to(path)
    code = (
        "from opamc_cli import diagnose, read_table\n"
        "from opamc_cli.stages.report.figures import shown\n"
        "shown.EVIDENCE = ()\n"
        "found = diagnose('normal', 'fault', settings={'joint.explain': False})\n"
        "import json; print(json.dumps([axis['witnesses'] for axis in found.verdict['axes']]))\n"
        "assert read_table('opamc-out/target/peaks.parquet').table.num_rows\n"
    )
    witnesses = json.loads(python(folder, "-c", code).splitlines()[-1])
    assert all("peaks" in axis for axis in witnesses)


@pytest.mark.long
def test_a_channel_is_added(tmp_path):
    folder = followed("Add a channel", tmp_path)
    rows = [f"{k / 100},{0.5 * k},{0.001 * (k % 7)},{k / 1000}" for k in range(500)]
    (folder / "log.csv").write_text("\n".join(["time,q_1,current_1,gear_vib_1", *rows]))
    code = (
        "from pathlib import Path\n"
        "import opamc_cli\n"
        "from opamc_cli.stages.recordings.axis_recording import read_recording\n"
        "from opamc_cli.stages.recordings.ingest import run\n"
        "from opamc_cli.storage.ingest.guess.write import guess_map\n"
        "from opamc_cli.storage.ingest.map.load import load_map\n"
        "guessed = guess_map([Path('log.csv')])\n"
        "assert 'axis1_vibration: {source: gear_vib_1, unit: m/s2}' in guessed, guessed\n"
        "Path('map.yaml').write_text(guessed.replace('unit: m/s2}', 'unit: gn}'))\n"
        "assert run([Path('log.csv')], load_map(Path('map.yaml')), Path('runs')).errors == ()\n"
        "with opamc_cli.storage.runs.run.Run(Path('runs/log.parquet')) as found:\n"
        "    print(read_recording(found, 1).vibration_m_s2[[0, -1]].tolist())\n"
    )
    assert json.loads(python(folder, "-c", code)) == pytest.approx([0.0, 0.499 * 9.80665])


@pytest.mark.long
def test_a_format_is_added(tmp_path):
    folder = followed("Add a format", tmp_path)
    log = [{"i": 0.001 * (k % 7), "q": 0.5} for k in range(500)]
    (folder / "log.jsonl").write_text("\n".join(map(json.dumps, log)))
    (folder / "map.yaml").write_text(
        "sampling_rate_hz: 100\ncolumns:\n  axis1_current: {source: i, unit: A}\n"
    )
    python(
        folder, *["-m", "opamc_cli", "ingest", "log.jsonl", "--map", "map.yaml", "--out", "runs"]
    )
    code = "from opamc_cli import read_run; print(read_run('runs/log.parquet').table.num_rows)"
    assert python(folder, "-c", code).strip() == "500"
