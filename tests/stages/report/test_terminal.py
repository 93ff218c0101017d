import io
import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console, RenderableType
from rich.text import Text

from opamc_cli import __main__
from opamc_cli.commands.model.shown import headline, loop_tables
from opamc_cli.commands.terminal.tables import verdict_lines, verdict_table
from opamc_cli.joint.explain.saturated import Ceiling
from opamc_cli.joint.name.chain import PRICE
from opamc_cli.stages.report.wording.loop import (
    LEAST_CEILING,
    STEP_COLUMNS,
    ceiling_phrase,
    far_from_noise,
    loop_phrase,
    remains,
    unreliable,
)


def shown(item: RenderableType, width: int = 120) -> str:
    console = Console(file=StringIO(), width=width)
    console.print(item)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert isinstance(text, str)
    return text


def axis(number: int, state: str, **more: Any) -> dict[str, Any]:
    entry = {
        "axis": number,
        "state": state,
        "health_index": 0.5 * number,
        "p_value": 0.3,
        "features": {"delta_mu": 0.01, "delta_var": None, "ks": 0.2},
        "motions": [],
        "cause": None,
        "reasons": [],
    }
    return entry | more


def test_all_healthy_is_one_line() -> None:
    text = shown(verdict_table({"axes": [axis(n, "healthy") for n in range(1, 7)]}))
    assert text == "Axes 1-6 healthy (largest health index 3, axis 6)\n"


def test_a_healthy_axis_that_has_changed_has_a_line() -> None:
    axes = [
        axis(n, "healthy", reasons=[f"reason {n}"], p_adjusted=p)
        for n, p in enumerate((0.009, 0.011), 1)
    ]
    said = [line.plain for line in verdict_lines({"axes": axes})]
    assert said == ["Axes 1 and 2 healthy", "axis 1: reason 1"]
    axes[0]["excused"] = True  # its line stands above
    assert [line.plain for line in verdict_lines({"axes": axes})].count("axis 1: reason 1") == 1


def test_an_unhealthy_axis_is_explained() -> None:
    verdict = {
        "axes": [
            axis(1, "healthy", reasons=["nothing to see"]),
            axis(3, "fault", p_value=1e-9, reasons=["worse than before"]),
            axis(4, "insufficient-data", health_index=None, p_value=None),
        ]
    }
    text = shown(verdict_table(verdict))
    assert text.startswith("Axis 3 at fault; axis 4 not judged; axis 1 healthy\n")
    assert "✕ fault" in text
    assert "< 0.0001" in text
    assert "axis 3:\n  worse than before" in text
    assert "Record more cycles" in text
    assert "nothing to see" not in text
    assert "None" not in text
    assert "nan" not in text


def test_what_several_axes_share_is_said_once() -> None:
    verdict = {
        "axes": [axis(n, "fault", reasons=[f"only axis {n}", "inspect the gear"]) for n in (2, 5)]
    }
    text = shown(verdict_table(verdict))
    assert text.count("inspect the gear") == 1
    assert "axes 2 and 5:\n  inspect the gear" in text
    assert "only axis 5" in text


def test_text_from_files_steers_no_terminal_and_is_no_markup() -> None:
    evil = "[red]x[/red] [/nonsense] \x1b[2J\x07"
    verdict = {"axes": [axis(1, "fault", reasons=[evil], cause={"effect": evil})]}
    text = shown(verdict_table(verdict))
    assert "\x1b" not in text
    assert "\x07" not in text
    assert text.count("[red]x[/red] [/nonsense]") == 2


@pytest.mark.parametrize("gone", ["before", "steps", "unit", "ceiling", "domain", "verdict"])
def test_a_loop_that_lacks_a_field_has_a_headline(gone: str) -> None:
    entry = {
        "axis": 2, "unit": "A", "before": {"rmse_a": 0.1}, "after": {"rmse_a": 0.05},
        "steps": [{"effect": "ripple", "interpretation": "kinematic error (order 2): look"}],
        "ceiling": {"share": 0.9}, "explained_share": 0.8, "verdict": "partial",
        "domain": "motor-angle",
    }  # fmt: skip
    whole = (
        "Axis 2 lacks kinematic error (ripple): error 0.1 → 0.05 A, 80% of what can be explained"
    )
    assert headline(entry) == whole
    function = {"effect": "unnamed_shift", "interpretation": "a function of time"}
    beside = headline(entry | {"steps": [*entry["steps"], function]})
    assert "80% of what can be explained has a name" in beside
    del entry[gone]
    told = "Axis 2: loop.json does not say" if gone == "steps" else "Axis 2 lacks "
    assert headline(entry).startswith(told)
    assert "None" not in headline(entry)


def test_joints_that_load_another_are_told_once() -> None:
    pairs = [{"axis": 3.0, "beside": 4.0}, {"axis": 2.0}, {"axis": 2.0, "beside": 3.0}]
    said = "torque from the motion of axis 3: no fault"
    steps = [{"effect": "coupling", "interpretation": said, "parameters": one} for one in pairs]
    entry = {"axis": 1, "before": {"rmse_a": 0.3}, "after": {"rmse_a": 0.2}, "steps": steps}
    told = headline(entry)
    assert told.startswith("Axis 1 lacks torque from the motion of axes 2, 3 and 4 (coupling): ")
    alone = headline(entry | {"steps": [steps[1] | {"interpretation": said.replace("3", "2")}]})
    assert alone.startswith("Axis 1 lacks torque from the motion of axis 2 (coupling): error")


def left_alone(error: float, noise: float) -> dict[str, Any]:
    return {
        "axis": 2, "unit": "A", "before": {"rmse_a": error}, "after": {"rmse_a": error},
        "steps": [], "verdict": "nothing-missing", "noise_a": noise,
    }  # fmt: skip


def test_what_is_left_beyond_the_noise_is_said_first() -> None:
    entry = left_alone(0.05181, 0.0292)
    assert headline(entry) == (
        "Axis 2: nothing of the library explains the 0.043 A that are left beyond noise: "
        "error 0.05181 A, of which 0.029 A is noise between samples; the rest is slower noise, or "
        "something that no effect describes"
    )
    assert "neither explained nor noise" in loop_phrase(entry)
    assert "what could be explained" not in remains(entry | {"explained_share": 1.0})
    far = left_alone(0.69, 0.06)
    assert headline(far).endswith("; check how its motion was logged, units and gear ratio, "
                                  "or record more motion")  # fmt: skip


@pytest.mark.parametrize(("logged", "told"), [(0.07, None), (0.7, "sample by sample 12 times")])
def test_what_corners_alone_show_is_far_from_noise_too(logged: float, told: str | None) -> None:
    """Backlash, of which smooth corners left 2.8 times the noise, ended with exit code 0."""
    entry = left_alone(0.17, 0.06)
    entry["after"] |= {"as_logged_a": logged}
    found = far_from_noise(entry)
    assert found is None if told is None else (found or "").startswith(told)


@pytest.mark.parametrize(("share", "said"), [(0.0, True), (0.8, False)])
def test_a_part_that_was_found_does_not_hide_what_is_left(share: float, said: bool) -> None:
    """Friction that grows while a joint rests: a fifth had a name, 8 times the noise were left."""
    entry = left_alone(0.2115, 0.0253) | {"verdict": "partial", "ceiling": {"share": share}}
    entry |= {"steps": [{"named": True}]}
    told = [why for why in unreliable(entry) if "8 times the noise" in why]
    assert bool(told) == said


@pytest.mark.parametrize("error", [0.0204, 0.0216, 0.028])
def test_an_error_that_is_mostly_noise_lacks_nothing_worth_naming(error: float) -> None:
    entry = left_alone(error, 0.02)
    assert headline(entry).startswith(f"Axis 2 lacks nothing worth naming: error {error:.4g} A")
    assert loop_phrase(entry) == "nothing worth naming is missing"


def test_noise_larger_than_the_smoothed_error_is_no_part_of_it() -> None:
    """Phases beside sharp corners: 0.1684 A, "of which 0.23 A is noise"."""
    entry = left_alone(0.1684, 0.23) | {"after": {"rmse_a": 0.1684, "as_logged_a": 0.2435}}
    entry["before"] |= {"as_logged_a": 0.2435}
    assert headline(entry) == (
        "Axis 2 lacks nothing worth naming: error 0.1684 A (sample by sample 0.2435); "
        "noise between samples 0.23 A"
    )


def test_what_the_sealed_data_do_not_bear_out_is_said_where_nothing_was_added() -> None:
    rejected = [{"effect": "inertia", "gain": 0.59, "why": "does not hold on the sealed data"}]
    entry = left_alone(0.0204, 0.02) | {"unconfirmed": ["inertia"], "rejected": rejected}
    assert headline(entry).startswith("Axis 2 lacks nothing for certain: error 0.0204 A")
    assert headline(entry).endswith(
        "; the data that were searched show inertia (59% of the error), the sealed ones do not: "
        "record more motion to tell"
    )
    assert "the sealed ones do not" in remains(entry)


@pytest.mark.parametrize(("logged", "said"), [(0.036, False), (0.038, True)])
def test_an_error_that_is_far_larger_sample_by_sample_is_told(logged: float, said: bool) -> None:
    """Beside sharp corners it was up to 2.7 times the one told, in a document alone."""
    entry = left_alone(0.1, 0.02) | {"verdict": "closed", "steps": [step("ripple", "wear: look")]}
    entry["before"] |= {"as_logged_a": 0.11}
    entry["after"] = {"rmse_a": 0.03, "as_logged_a": logged}
    told = "error 0.1 → 0.03 A (sample by sample 0.11 → 0.038)"
    assert (told in headline(entry)) is said
    alone = left_alone(0.03, 0.02) | {"after": {"rmse_a": 0.03, "as_logged_a": logged}}
    alone["before"] |= {"as_logged_a": logged}
    assert ("error 0.03 A (sample by sample 0.038)" in headline(alone)) is said


def step(effect: str, interpretation: str) -> dict[str, Any]:
    return {"effect": effect, "interpretation": interpretation}


SPEED = step("unnamed_speed", "a function of speed; no effect of the library has its form")
LOAD = step("unnamed_load", "a function of load; no effect of the library has its form")
TONE = step("unnamed_tone", "a line over time")
PRESLIDING = step("unnamed_presliding", "presliding: friction builds up over a short way")


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ([SPEED], "a function of speed"),
        ([TONE, PRESLIDING], "a line over time, presliding"),
        ([SPEED, TONE, LOAD, SPEED], "functions of speed, of load, a line over time"),
    ],
)
def test_the_first_line_names_functions_without_a_name(
    steps: list[dict[str, Any]], told: str
) -> None:
    entry = left_alone(0.1, 0.02) | {"verdict": "closed", "after": {"rmse_a": 0.03}}
    ripple = step("ripple", "kinematic error: look")
    named = headline(entry | {"steps": [ripple, *steps]})
    assert named.startswith(f"Axis 2 lacks kinematic error (ripple) and, without a name, {told}: ")
    alone = headline(entry | {"steps": steps, "verdict": "not-in-library"})
    assert alone.startswith(f"Axis 2 lacks {told}, which no effect of the library describes: ")
    assert "without a name" not in headline(entry | {"steps": [ripple]})


def test_the_first_line_explains_three_effects_and_names_the_rest() -> None:
    lines = [step("ripple", f"source of order {order}: look") for order in (1, 2, 3)]
    known = {"share": 0.8, "standard_error": 0.05}
    entry = left_alone(0.1, 0.02) | {"verdict": "partial", "explained_share": 0.9, "ceiling": known}
    entry["steps"] = [step("mains_hum", "pick-up: check"), *lines, step("offset", "zero: check")]
    told = headline(entry)
    assert "pick-up (mains_hum); source of order 1 (ripple); source of order 2 (ripple); " in told
    assert "; 2 more (ripple, offset): error " in told
    # a share of what can be explained means nothing where the model fails
    assert "90% of what" in told
    assert "%" not in headline(entry | {"fails": "the fit fails there"})


@pytest.mark.parametrize(("sealed", "said"), [(0.0639, False), (0.107, True)])
def test_sealed_data_that_are_explained_far_worse_are_told(sealed: float, said: bool) -> None:
    entry = left_alone(0.17, 0.05) | {"verdict": "not-in-library", "steps": [SPEED]}
    entry["after"] = {"rmse_a": sealed, "searched_rmse_a": 0.059}
    told = "the sealed data are left with 1.8 times the error of those searched: something changes"
    assert (told in headline(entry)) is said
    assert (told in remains(entry)) is said
    # it is said once
    fails = headline(entry | {"fails": "the sealed part's error is 2.1 times that of the rest"})
    assert fails.count("the sealed") == 1


@pytest.mark.parametrize(
    ("share", "error", "steps", "known"),
    [
        (0.95, 0.07, [TONE], True),
        (0.0, 0.0, [], True),
        (0.03, 0.02, [], True),
        (0.0, 2.77, [], False),
        (0.0, 2.77, [TONE], False),
        (0.0, 0.0, [TONE], False),
        (0.97, 0.58, [TONE], False),
    ],
)
def test_a_ceiling_that_is_not_known_is_said_to_be_none(
    share: float, error: float, steps: list[dict[str, Any]], known: bool
) -> None:
    entry = {
        "ceiling": {"share": share, "standard_error": error},
        "steps": steps, "floor_a": 0.016, "unit": "A",
    }  # fmt: skip
    told = ceiling_phrase(entry)
    assert told == (
        f"ceiling {share:.0%} ± {error:.0%} of the mean square, floor 0.016 A"
        if known
        else "ceiling not known"
    )


def test_a_table_of_steps_says_what_its_columns_are() -> None:
    entry = left_alone(0.1, 0.02) | {
        "verdict": "closed", "ceiling": {"share": 0.9, "standard_error": 0.1}, "floor_a": 0.03,
        "domain": None, "rejected": [], "untestable": [], "sealed": ["run:3"],
        "before": {"rmse_a": 0.1, "r2": 0.5}, "after": {"rmse_a": 0.03, "r2": 0.9},
    }  # fmt: skip
    added = TONE | {
        "ties": [], "parameters": {}, "gain": 0.175, "fit_of_name": 0.0, "rmse_before_a": 0.1,
        "rmse_after_a": 0.03, "separating_experiment": None,
    }  # fmt: skip
    assert STEP_COLUMNS in loop_tables(entry | {"steps": [added]})
    assert STEP_COLUMNS not in loop_tables(entry | {"steps": []})


@pytest.mark.parametrize(("share", "error", "known"), [(0.03, 0.01, True), (0.03, 0.02, False),
                                                       (0.015, 0.001, False)])  # fmt: skip
def test_words_know_a_ceiling_where_the_verdict_does(
    share: float, error: float, known: bool
) -> None:
    assert Ceiling(share, error).certain == known
    entry = {
        "axis": 2, "unit": "A", "before": {"rmse_a": 0.2}, "after": {"rmse_a": 0.1},
        "steps": [{"effect": "ripple", "interpretation": "kinematic error (order 2): look"}],
        "ceiling": {"share": share, "standard_error": error}, "explained_share": 1.0,
        "verdict": "closed",
    }  # fmt: skip
    assert ("100% of what can be explained" in headline(entry)) == known
    assert ("what is left is noise" in headline(entry)) != known


def test_words_take_the_verdict_s_limit_of_a_ceiling() -> None:
    assert LEAST_CEILING == PRICE


@pytest.mark.usefixtures("undrawn")
def test_report_command_prints_verdict_and_loop(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder
    with pytest.raises(SystemExit) as ended:
        __main__.main(["report", "--out", str(out)])
    captured = capsys.readouterr()
    assert ended.value.code == 0
    assert "Axis 3 at fault" in captured.out
    assert "Axis 3 lacks " in captured.out
    assert "error 0.065 → 0.021 A" in " ".join(captured.out.split())
    assert str(out / "report.html") in captured.out.replace("\n", "")
    assert captured.err == ""
    with pytest.raises(SystemExit):
        __main__.main(["report", "--out", str(out), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert result["verdict"]["axes"][2]["state"] == "fault"


def test_report_of_no_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        __main__.main(["report", "--out", str(tmp_path / "nowhere")])
    assert ended.value.code == 3
    assert "nowhere: no such folder" in capsys.readouterr().err
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("width", [40, 60, 79, 100, 140])
def test_a_narrow_terminal_leaves_out_columns_and_never_digits(width: int) -> None:
    from rich.console import Console

    from opamc_cli.commands.terminal.tables import verdict_table

    axes = [
        {
            "axis": axis,
            "state": state,
            "health_index": 113.673,
            "p_value": 0.0123,
            "p_adjusted": 0.0369,
            "features": {"delta_mu": -0.00061, "delta_var": -1.94e-6, "ks": 0.125},
            "reasons": [],
        }
        for axis, state in ((1, "insufficient-data"), (2, "fault"))
    ]
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(verdict_table({"axes": axes}))
    shown = console.export_text()
    assert "…" not in shown
    rows = [line for line in shown.splitlines() if "✕" in line]
    assert len(rows) == 1
    assert "0.037" in rows[0]
    assert ("−1.94e−6" in shown) == (width >= 100)


def test_piped_text_has_no_trailing_blanks(capsys) -> None:
    from opamc_cli.commands.terminal.output import Output
    from opamc_cli.commands.terminal.tables import verdict_table

    axes = [{"axis": 1, "state": "fault", "reasons": ["It has changed. " * 20]}]
    Output().result({}, verdict_table({"axes": axes}), "a line")
    shown = capsys.readouterr().out
    assert shown.endswith("a line\n")
    assert not [line for line in shown.splitlines() if line != line.rstrip()]


@pytest.mark.parametrize("terminal", [False, True])
def test_sentences_alone_are_printed_as_beside_a_table(capsys, monkeypatch, terminal) -> None:
    """They are printed without what tables need, which takes a hundredth of a night to load."""
    from opamc_cli.commands.terminal.output import Output

    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal)
    sentences = ["r1 [b]axis 3[/b]: ALARM :bell: 0.79", "see " + "a/long/path/" * 20, "trailing  "]
    Output().result({}, *sentences)
    alone = capsys.readouterr().out
    Output().result({}, *sentences, Text("a table"))
    assert capsys.readouterr().out == f"{alone}a table\n"


def test_a_faulty_joint_takes_few_lines() -> None:
    known = {"inspect": "Look at the gear.", "evidence": ["one", "two"], "against": "little"}
    verdict = {
        "axes": [
            axis(1, "healthy"),
            axis(2, "healthy"),
            axis(3, "fault", p_adjusted=1e-9, distance={"ratio": 4.03}, brief=known),
        ]
    }
    lines = [line.plain for line in verdict_lines(verdict)]
    assert len(lines) == 5
    assert lines[0].startswith("Axis 3 at fault: p < 0.0001, 4.03 times as far")
    assert "2 other axes healthy" in lines[0]
    assert [line.strip() for line in lines[1:]] == [
        "do first: Look at the gear.",
        "seen: one",
        "seen: two",
        "against: little",
    ]


def test_the_joint_to_look_at_first_comes_first() -> None:
    known = {"inspect": "Look.", "evidence": [], "against": "little"}
    pair = [
        axis(number, "fault", p_adjusted=1e-9, distance={"ratio": 4.0}, brief=known, health_index=i)
        for number, i in ((1, 9.0), (2, 901.0))
    ]
    titles = [line.plain for line in verdict_lines({"axes": pair}) if "as far" in line.plain]
    assert [title[:6] for title in titles] == ["Axis 2", "Axis 1"]
    # not the farthest, if not by far: the other's current has changed more
    pair[1]["health_index"] = 800.0
    for entry, changed in zip(pair, (0.1, 0.05), strict=True):
        entry["distance"] = {"ratio": 4.0, "changed_a": changed}
    titles = [line.plain for line in verdict_lines({"axes": pair}) if "as far" in line.plain]
    assert [title[:6] for title in titles] == ["Axis 1", "Axis 2"]


def test_what_is_not_judged_says_why_in_a_line() -> None:
    verdict = {"axes": [axis(1, "healthy"), axis(2, "insufficient-data", reasons=["too short"])]}
    lines = [line.plain for line in verdict_lines(verdict)]
    assert lines == ["Axis 2 not judged; axis 1 healthy", "axis 2: too short"]


def test_few_baseline_sessions_are_no_proof_of_health() -> None:
    for n, said in ((1, "1 baseline session says"), (3, "3 baseline sessions say"), (4, "")):
        verdict = {"axes": [axis(1, "healthy")], "baseline": {"sessions": n}}
        lines = [line.plain for line in verdict_lines(verdict)]
        assert len(lines) == 1 + bool(said)
        assert lines[-1].startswith(said)
