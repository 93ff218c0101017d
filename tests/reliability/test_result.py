"""A result appears at once: the new one whole, the last one, or none."""

import hashlib
import json
import os

import pytest

from opamc_cli.errors import InputError, UsageError
from opamc_cli.stages import diagnose as stage
from opamc_cli.stages.report import assemble
from opamc_cli.storage.files import result as storage
from opamc_cli.storage.files.result import clear, published, result

NAMES = ("verdict.json", "tables/a", "tables/b")


def put(folder, text, names=NAMES, **options):
    with result(folder, *NAMES, **options) as staged:
        for name in names:
            (staged / name).parent.mkdir(exist_ok=True)
            (staged / name).write_text(text)


def fail(folder, error):
    with result(folder, *NAMES) as staged:
        (staged / "verdict.json").write_text("half")
        msg = "the run cannot be used"
        raise error(msg)


def seen(folder):
    return {name: (folder / name).read_text() for name in NAMES if (folder / name).exists()}


def tree(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("linked", [True, False])
def test_a_result_replaces_the_last_one(tmp_path, linked):
    put(tmp_path, "old", linked=linked)
    before = tree(tmp_path)
    put(tmp_path, "new", linked=linked)
    assert seen(tmp_path) == dict.fromkeys(NAMES, "new")
    assert tree(tmp_path) == before


def test_what_the_new_result_lacks_goes_with_the_old_one(tmp_path):
    put(tmp_path, "old")
    put(tmp_path, "new", NAMES[:2])
    assert seen(tmp_path) == dict.fromkeys(NAMES[:2], "new")
    assert not os.path.lexists(tmp_path / NAMES[2])


def test_files_of_others_stay(tmp_path):
    with result(tmp_path, "loop.json") as staged:
        (staged / "loop.json").write_text("loop")
    (tmp_path / "mine.txt").write_text("mine")
    put(tmp_path, "new")
    assert (tmp_path / "loop.json").read_text() == "loop"
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_plain_files_of_an_earlier_version_are_taken_over(tmp_path):
    (tmp_path / "tables").mkdir()
    for name in NAMES:
        (tmp_path / name).write_text("plain")
    with pytest.raises(UsageError):
        fail(tmp_path, UsageError)
    assert seen(tmp_path) == dict.fromkeys(NAMES, "plain")
    put(tmp_path, "new")
    assert seen(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_failure_keeps_the_last_result_and_says_so(tmp_path):
    put(tmp_path, "old")
    with pytest.raises(InputError, match="is still that of the last result"):
        fail(tmp_path, InputError)
    assert seen(tmp_path) == dict.fromkeys(NAMES, "old")
    assert not (tmp_path / storage.STAGED).exists()


class Killed(BaseException):
    """What the process would not survive."""


def test_a_kill_at_any_step_leaves_one_whole_result(tmp_path, monkeypatch):
    """Every call that changes the disk is once the last one."""
    calls = {
        "opamc_cli.storage.files.result.Path": ("hardlink_to", "symlink_to", "replace", "rename"),
        "opamc_cli.storage.files.result": ("_exchange", "flush"),
        "opamc_cli.storage.files.result.shutil": ("rmtree",),
    }
    states = set()
    for start in ("plain", "linked"):
        for step in range(60):
            folder = tmp_path / f"{start}-{step}"
            (folder / "tables").mkdir(parents=True)
            if start == "linked":
                put(folder, "old")
            else:
                for name in NAMES:
                    (folder / name).write_text("old")
            left = [step]

            def counted(function, left=left):
                def call(*arguments, **named):
                    if left[0] == 0:
                        raise Killed
                    left[0] -= 1
                    return function(*arguments, **named)

                return call

            with monkeypatch.context() as patched:
                for owner, names in calls.items():
                    for name in names:
                        original = _get(f"{owner}.{name}")
                        patched.setattr(f"{owner}.{name}", counted(original))
                try:
                    put(folder, "new")
                    ended = True
                except Killed:
                    ended = False
            found = set(seen(folder).values())
            assert found in ({"old"}, {"new"}), (start, step, found)
            assert len(seen(folder)) == len(NAMES)
            states |= found
            clear(folder)
            put(folder, "next")
            assert seen(folder) == dict.fromkeys(NAMES, "next")
            assert not [p for p in tree(folder) if p.endswith((".part", ".old"))]
            if ended:
                break
        else:
            pytest.fail("60 steps do not suffice")
    assert states == {"old", "new"}


def _get(name):
    import importlib

    module, _, attribute = name.rpartition(".")
    try:
        owner = importlib.import_module(module)
    except ModuleNotFoundError:
        outer, _, inner = module.rpartition(".")
        owner = getattr(importlib.import_module(outer), inner)
    return getattr(owner, attribute)


def test_where_folders_cannot_be_exchanged(tmp_path, monkeypatch):
    put(tmp_path, "old")
    monkeypatch.setattr(storage, "_NO_EXCHANGE", (22, 38, 95))

    class Libc:
        @staticmethod
        def renameat2(*_):
            storage.ctypes.set_errno(22)
            return -1

    monkeypatch.setattr(storage.ctypes, "CDLL", lambda *_, **__: Libc())
    put(tmp_path, "new")
    assert seen(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_result_that_was_being_replaced_is_found_again(tmp_path):
    put(tmp_path, "old")
    (tmp_path / storage.CURRENT).rename(tmp_path / storage.REPLACED)
    assert seen(tmp_path) == {}
    clear(tmp_path)
    assert seen(tmp_path) == dict.fromkeys(NAMES, "old")


def test_where_a_result_is_seen(tmp_path):
    for hidden in (storage.CURRENT, storage.STAGED):
        assert published(tmp_path / hidden / "baseline" / "x") == tmp_path / "baseline" / "x"


# -- a diagnosis -----------------------------------------------------------------------------


def test_the_verdict_vouches_for_its_tables(diagnosed):
    verdict = json.loads((diagnosed / "verdict.json").read_text())
    assert set(verdict["tables"]) == {n for n in stage.FILES if n.endswith(".parquet")}
    for name, digest in verdict["tables"].items():
        assert hashlib.sha256((diagnosed / name).read_bytes()).hexdigest() == digest


def test_no_verdict_is_seen_before_the_last_one(baseline, tonight, tmp_path, monkeypatch):
    """The cause may still change it: nothing is published while it is sought."""
    from opamc_cli.config import load_config

    seen_files = []
    monkeypatch.setattr(
        assemble,
        "run",
        lambda out, **_: seen_files.append(tree(tmp_path / "out")) or pytest.fail("stop"),
    )
    with pytest.raises(pytest.fail.Exception):
        stage.run(
            [baseline], [tonight], load_config(None, ["joint.explain=false"]), tmp_path / "out"
        )
    assert seen_files
    assert all(name.startswith(storage.STAGED) for name in seen_files[0])
    assert not (tmp_path / "out" / "verdict.json").exists()
