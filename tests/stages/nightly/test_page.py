"""The cell's page: what it holds, how large it gets, and what a real browser makes of it."""

import json
import re
from pathlib import Path

import cell_logs
import pytest
from browser import browse, needs_browser

from opamc_cli.stages.nightly.publish.page import render
from opamc_cli.stages.nightly.summary import JointSummary, RobotSummary, Summary, summarise
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import AlarmRow, Event, MeasureRow, NightRow, VerdictRow

NIGHTS = [cell_logs.night(index) for index in range(30)]
NASTY = '</script><b>"r&1'
SINGLE = f"axis 2: at fault in {NIGHTS[20]} alone (effect 0.40)"


def write_history(path: Path, names: list[str]) -> History:
    """Write a history: axis 3 of the first robot wears, the second is unknown, the third gone."""
    history = History(path)
    for number, name in enumerate(names):
        status = "failed" if number == 1 else "done"
        for night in NIGHTS[: -1 if number == 2 else None]:
            verdicts, measures = [], []
            for axis in range(1, 7):
                worn = number == 0 and axis == 3
                distance = 0.05 * NIGHTS.index(night) if worn else 0.02 * ((axis * 7) % 5 - 2)
                verdicts.append(
                    VerdictRow(
                        *(name, "pick", axis, night, "fault" if worn else "healthy"),
                        *(distance, 0.5, None, int(worn), 25.0, 1.0, 100.0, 4),
                        *(f"{name}/{night}/report.html", "hash", "0.1"),
                    )
                )
                measures.append(
                    MeasureRow(name, "pick", axis, night, "b", distance, 0.0, 0.1, 0, "")
                )
            key = {"version": "1", "config": "c", "baseline": "b", "files": []}
            row = NightRow(name, night, json.dumps(key), status, why="no <b>")
            history.record_night(row, verdicts, measures)
    alarm = AlarmRow(
        *(names[0], "pick", 3, NIGHTS[12], NIGHTS[9], None, None, "at fault, effect 0.41", "{}")
    )
    history.settle(names[0], [alarm], [("pick", 3, NIGHTS[-1])], [])
    history.settle(names[2], [], [], [Event(NIGHTS[20], names[2], 2, "fault", SINGLE)])
    return history


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    with write_history(folder / "history.sqlite", [NASTY, "r2", "r3"]) as history:
        path = folder / "index.html"
        path.write_text(render(history, summarise(history)), encoding="utf-8")
    return path


def test_what_needs_a_look_stands_in_the_page_itself(page):
    text = page.read_text(encoding="utf-8")
    assert "1 joint of 1 robot with an alarm" in text
    assert f"alarm since {NIGHTS[9]}" in text
    card = text.partition("r3, axis 2</h2>")[2].partition("</article>")[0]
    assert "at fault in single nights, no alarm" in card
    assert SINGLE in card
    assert NASTY not in text
    assert not re.search(r"(src|href)=\"https?:", text)
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    assert [robot for robot, _ in data["robots"]] == sorted([NASTY, "r2", "r3"])
    assert all(len(row[5]) == len(NIGHTS) for _, rows in data["robots"] for row in rows)


def test_two_thousand_robots_are_less_than_two_megabytes(page):
    with History(page.parent / "history.sqlite") as history:
        text = render(history, summarise(history))
    data = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1]
    # one robot of a plain name, with its six joints
    (entry,) = [part for part in json.loads(data)["robots"] if part[0] == "r3"]
    per_robot = len(json.dumps(entry, separators=(", ", ": "))) + len("cell-0000") * 13
    assert len(text) - len(data) + 2000 * per_robot < 2_000_000


def in_browser(page: Path, folder: Path, width: int, dark: bool) -> tuple[str, bytes]:
    # a window is never narrower than 500: a phone is a frame in it
    framed = folder / "framed.html"
    framed.write_text(
        f"<!doctype html><style>body{{margin:0}}iframe{{border:0;width:{width}px;height:900px}}"
        f"</style><iframe src='{page.as_uri()}'></iframe>"
    )
    shot = folder / f"{width}-{dark}.png"
    window = f"--window-size={max(width, 500)},900"
    browse(folder, framed, window, f"--screenshot={shot}", dark=dark)
    dumped = browse(folder, page, f"--window-size={width},900", "--dump-dom", dark=dark)
    return dumped, shot.read_bytes()


@pytest.mark.long
@needs_browser
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, True)])
def test_a_browser_draws_every_joint(page, tmp_path, width, dark):
    dom, shot = in_browser(page, tmp_path, width, dark)
    body = dom.partition('<tbody id="rows">')[2].partition("</tbody>")[0]
    assert body.count("<tr>") == 18
    assert body.count('class="spark"') == 18
    assert "! alarm" in body.partition("</tr>")[0]  # the worst first
    assert "18 of 18 joints" in dom
    assert body.count('class="night changed"') == 6  # the robot without the cell's last night
    from matplotlib.image import imread

    path = tmp_path / f"{width}-{dark}.png"
    pixels = imread(path)[..., :3]
    assert shot
    assert pixels.std() > 0.02  # something is drawn
    assert (pixels[5, 5].mean() < 0.5) == dark


@pytest.mark.long
@needs_browser
def test_a_joint_of_two_programs_is_not_counted_as_two(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    head, data, rest = re.split(r'(?<=id="data">)(.*?)(?=</script>)', text, maxsplit=1)
    found = json.loads(data)
    found["robots"][0][1][0][6] = "pick"
    copy, data = tmp_path / "index.html", json.dumps(found).replace("<", "\\u003c")
    copy.write_text(f"{head}{data}{rest}", encoding="utf-8")
    assert "18 of 18 joints, each program's by itself<" in browse(tmp_path, copy, "--dump-dom")


@pytest.mark.long
@needs_browser
def test_a_phone_shows_since_when_of_alarms_alone(page, tmp_path):
    told = (
        "<script>document.title = [...document.querySelectorAll('td.since')]"
        ".map((cell) => Number(cell.offsetHeight > 0)).join('')</script></body>"
    )
    copy = tmp_path / "index.html"
    copy.write_text(page.read_text(encoding="utf-8").replace("</body>", told), encoding="utf-8")
    dom = browse(tmp_path, copy, "--window-size=500,900", "--dump-dom")
    assert f"<title>1{'0' * 17}</title>" in dom


def test_a_joint_under_alarm_in_two_programs_is_one_card(page):
    name = "two programs"
    alarms = {
        program: AlarmRow(name, program, 2, NIGHTS[-1], NIGHTS[9], None, None, text, "{}")
        for program, text in (("A", "at fault"), ("B", "worn"))
    }
    joints = tuple(
        JointSummary(2, program, "fault", NIGHTS[-1], "", index, alarms[program])
        for program, index in (("A", 50.0), ("B", 40.0))
    )
    robot = RobotSummary(name, joints, NightRow(name, NIGHTS[-1], "", "done"))
    with History(page.parent / "history.sqlite") as history:
        text = render(history, Summary((robot,)))
    assert text.count('class="card fault-edge"') == 1
    assert f"also in B, since {NIGHTS[9]}: worn" in text
