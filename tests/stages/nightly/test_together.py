"""What is wrong with several recordings alike is said once."""

from opamc_cli.stages.nightly.alarms.not_judged import failed
from opamc_cli.stages.nightly.alarms.together import kind, together
from opamc_cli.storage.history.rows import NightRow

UNFIT = "of axis 2 fit no motion of the baseline's cycle: another program or speed"


def test_recordings_that_lack_the_same_are_one_sentence():
    reasons = [f"logs/n/{n}.parquet: all {n + 10} segments {UNFIT}" for n in range(5)]
    assert together(reasons) == [
        f"5 recordings (n/0.parquet, n/1.parquet, n/2.parquet and 2 more): all 14 segments {UNFIT}"
    ]
    assert together(reasons[:1]) == [f"n/0.parquet: all 10 segments {UNFIT}"]


def test_recordings_that_differ_in_a_share_alone_are_one_sentence():
    reasons = [f"n/{n}.parquet: column axis3_current is clipped in {n}% of it" for n in (6, 7)]
    said = "2 recordings (n/6.parquet, n/7.parquet): column axis3_current is clipped in 7% of it"
    assert together(reasons) == [said]


def test_joints_of_a_recording_that_lack_the_same_are_one_sentence():
    """An edited program was a sentence for each joint."""
    reasons = [f"n/1.parquet: {n} of 6 motions of axis {n} lead elsewhere" for n in (3, 4, 6)]
    said = "n/1.parquet: 3 of 6 motions of axis 3 (axes 4 and 6 likewise) lead elsewhere"
    assert together([*reasons, "no more"]) == [said, "no more"]


def test_other_joints_and_other_reasons_are_not_thrown_together():
    reasons = [f"logs/n/1.parquet: all 9 segments {UNFIT}", "1 recording where each night has 2"]
    other = f"logs/n/2.parquet: all 9 segments {UNFIT.replace('axis 2', 'axis 3')}"
    said = [one.removeprefix("logs/") for one in (*reasons, other)]
    assert together([*reasons, other]) == said


def test_a_sentence_has_its_kind_however_many_recordings_it_is_of():
    assert kind(f"2 recordings (n/1 (copy).parquet, n/2.parquet): all 9 segments {UNFIT}") == kind(
        f"logs/m/7.parquet: all 14 segments {UNFIT}"
    )


def test_nights_with_the_same_to_say_are_short_however_many_they_are():
    """Lines of 4800 characters said one sentence 18 times."""
    late = "holds 1 cycle where the baseline's recordings hold 2"
    rows = []
    for night in range(1, 29):
        reasons = [f"logs/{night}/{n}.parquet: all {n} segments {UNFIT}" for n in (13, 14)]
        reasons += [f"logs/{night}/9.parquet: {late}"] * (night == 9)
        why = "; ".join(together(reasons))
        rows.append(NightRow("r1", f"2026-03-{night:02d}", "{}", "partial", 0, why))
    text = [*failed("r1", rows, 7)][-1].text
    assert text.count("fit no motion") == text.count(late) == 1
    assert f"; 2026-03-09: 9/9.parquet: {late}" in text
    assert len(text) < 400
