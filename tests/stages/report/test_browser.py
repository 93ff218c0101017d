"""The report in a browser: on a desk and in a hand, by day and by night."""

import html
import json
import re
import shutil
import subprocess

import pytest
from browser import browse, needs_browser

WIDTHS = (1280, 390)
LOOK = """
function look(frame) {
  const page = frame.contentDocument, root = page.documentElement;
  const box = (element) => element.getBoundingClientRect();
  const seen = (element) => box(element).width > 1 && box(element).height > 1;
  const all = (selector) => [...page.querySelectorAll(selector)];
  const beyond = (element) => element.scrollWidth > element.clientWidth + 1;
  return {
    width: frame.clientWidth,
    page: root.scrollWidth,
    paper: frame.contentWindow.getComputedStyle(page.body).backgroundColor,
    headings: all(".card dt").map((term) => term.textContent),
    stacked: box(all(".card dt")[0]).bottom <= box(all(".card dd")[0]).top + 1,
    figures: all("figure svg").map(seen),
    rows: all("section > .scroll .stack tbody tr").map((row) => row.innerText.trim()),
    cut: all("section > .scroll").filter(beyond).map((area) => area.getAttribute("aria-label")),
    sideways: all("figure .plot").filter(beyond).length,
    unreachable: all(".scroll, .plot, pre").filter((area) => area.tabIndex !== 0).length,
    scopeless: all("th:not([scope])").length,
  };
}
addEventListener("load", () => {
  const found = [...document.querySelectorAll("iframe")].map(look);
  document.body.textContent = "FOUND" + JSON.stringify(found) + "DONE";
});
"""

pytestmark = [needs_browser, pytest.mark.long]


@pytest.fixture(scope="module", params=["light", "dark"])
def looks(request, page, tmp_path_factory) -> list[dict]:
    """Return what is seen at both widths in one colour scheme."""
    folder = tmp_path_factory.mktemp("browser")
    frames = "".join(
        f'<iframe width="{width}" height="900" style="border:0" '
        f'srcdoc="{html.escape(page, quote=True)}"></iframe>'
        for width in WIDTHS
    )
    wrapper = folder / "page.html"
    wrapper.write_text(f"<body>{frames}<script>{LOOK}</script></body>", encoding="utf-8")
    printed = browse(folder, wrapper, "--dump-dom", dark=request.param == "dark")
    found = re.search(r"FOUND(.*)DONE", html.unescape(printed))
    assert found, printed[-500:]
    return [{**look, "scheme": request.param} for look in json.loads(found[1])]


def test_nothing_sticks_out_or_is_hidden(looks):
    assert [look["width"] for look in looks] == list(WIDTHS)
    for look in looks:
        assert look["page"] <= look["width"]
        assert look["figures"]
        assert all(look["figures"])
        assert look["rows"]
        assert all(look["rows"])
    # on a narrow screen rows are cards, none of which needs to be pushed sideways
    assert looks[1]["cut"] == []
    assert [look["sideways"] for look in looks] == [0, 0]


def test_a_card_says_first_what_to_do(looks):
    order = ["Inspect first", "Likely cause", "How sure", "Since when", "Why"]
    for look in looks:
        assert look["headings"] == order
    assert [look["stacked"] for look in looks] == [False, True]


def test_a_keyboard_reaches_every_box_and_tables_name_their_headings(looks):
    for look in looks:
        assert look["unreachable"] == 0
        assert look["scopeless"] == 0


def test_dark_is_dark(looks):
    for look in looks:
        red, green, blue = map(int, re.findall(r"\d+", look["paper"])[:3])
        assert (red + green + blue < 200) == (look["scheme"] == "dark")


def test_notes_are_in_the_page(page: str) -> None:
    assert "payload_kg differs: normal-0 has 0.0, fault-0 2.0" in page


def test_paper_has_no_half_empty_pages(page, tmp_path):
    """Print it: text and figures fill all pages but the last by more than half."""
    reader = shutil.which("pdftotext")
    if reader is None:
        pytest.skip("no pdftotext on this machine")
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    target = tmp_path / "page.pdf"
    options = ("--no-pdf-header-footer", f"--print-to-pdf={target}")
    browse(tmp_path, tmp_path / "page.html", *options)
    boxes = subprocess.run(
        [reader, "-bbox", str(target), "-"], capture_output=True, text=True, check=True
    ).stdout
    filled = []
    for sheet in boxes.split("<page ")[1:]:
        height = float(re.search(r'height="([\d.]+)"', sheet)[1])
        lowest = max((float(y) for y in re.findall(r'yMax="([\d.]+)"', sheet)), default=0.0)
        filled.append(lowest / height)
    assert len(filled) > 1
    assert min(filled[:-1]) > 0.5
