"""Sessions of the baseline that are left out: their order in time, and what is said of them."""

from types import SimpleNamespace

import pytest

from opamc_cli.stages.recordings.sessions import Sessions
from opamc_cli.stages.verdict.decision import Decided, in_time


def side(**started_at: str | None) -> SimpleNamespace:
    sources = [
        SimpleNamespace(name=name, info=SimpleNamespace(started_at=time))
        for name, time in started_at.items()
    ]
    return SimpleNamespace(sources=sources)


@pytest.mark.parametrize(
    ("told_by", "last", "order"),
    [
        ("session", "2026-03-01T02:00", ["of ten", "of nine"]),
        ("session", None, ["of nine", "of ten"]),
        # its clock may be wrong: the folder's name came before it
        ("folder", "2026-03-01T02:00", ["of nine", "of ten"]),
    ],
)
def test_sessions_are_in_the_order_of_their_recordings(told_by, last, order):
    recorded = side(a="2026-03-01T01:00", b="2026-03-01T03:00", c=last)
    of_run = {"a": "of ten", "b": "of nine", "c": "of ten"}
    assert in_time(recorded, Sessions(of_run, (told_by,))) == order


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (("1",), "night 1 of the baseline differs from the others on axis 2 as no healthy one "),
        (("4", "5"), "night 4 and night 5 of the baseline differ from those before them on axis 2"),
        (("3", "4", "5"), "night 3, night 4 and night 5 of the baseline differ from those before "),
    ],
)
def test_sessions_that_are_left_out_are_named(odd, said):
    nights = [str(n) for n in range(6)]
    own = Sessions(dict(zip(nights, nights, strict=True)), ("night",))
    sides = SimpleNamespace(
        sessions=(own, own), baseline=side(**dict.fromkeys(nights)), target=side(**{"9": None})
    )
    decided = Decided(sides, {}, {}, odd={2: odd})
    (sentence,) = decided.odd_ones()
    assert str(sentence).startswith(said)
    kept = [source.name for source in decided.baseline_sources(2)]
    assert kept == [night for night in nights if night not in odd]
    assert len(decided.baseline_sources(1)) == 6
