"""The desk of a run: its choices, its runs, its pages in a browser."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import pytest

from softehl.__main__ import main
from softehl.cases.app.page import CHOICES, rods, slides_on
from softehl.cases.app.runs import Desk, case_text
from softehl.cases.harness.case_file import read_case
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.shipped import SHIPPED

# --- The desk without a browser: what it offers, its case files, its runs, what it needs ----------


GIVEN = {
    **{"ring": "36x4", "rod": "36 f7", "compound": "NBR 70", "density": 1},
    **{"speeds": [800, 600, 400, 300, 200, 150, 100], "stroke": "out", "error_estimate": False},
}


def wait(desk: Desk, name: str, *, done: int, seconds: float = 240.0) -> None:
    """Wait until a run has so many states."""
    end = time.monotonic() + seconds
    while desk.state(name).done < done:
        assert time.monotonic() < end, desk.state(name)
        assert desk.state(name).running or desk.state(name).done >= done, desk.state(name)
        time.sleep(0.02)


def test_all_that_is_offered_is_understood() -> None:
    usual = {choice.key: choice.value for choice in CHOICES if choice.value != "smooth"}
    for choice in CHOICES:
        for option in (*choice.options, *(rods(usual["ring"]) if choice.key == "rod" else ())):
            given = {**usual, choice.key: option}
            if choice.key == "ring":
                given["rod"] = rods(option)[0]
            if option.startswith("U-cup"):
                del given["gland"]
            if choice.key == "sealed_pressure":
                given["compound"] = "PU 95"  # which bears all of them
            if option == "smooth":
                continue
            key, rod = slides_on(given.pop("rod"))
            p = Seal.model_validate({**given, key: rod})
            assert p.piston == (key == "bore"), option


def test_a_case_file_says_what_was_given(tmp_path: Path) -> None:
    given = {**GIVEN, "oil": 'a "name" in \\ µ', "materials": {"cap": {"mu": 2.0}}}
    assert tomllib.loads(case_text(given)) == {"case": "oring", **given}


def test_a_stopped_run_keeps_what_it_has_and_goes_on(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    name = desk.start(GIVEN)
    try:
        wait(desk, name, done=1)
        desk.stop(name)
        desk.processes[name].wait(30)
        state = desk.state(name)
        assert (state.status, state.requested) == ("stopped", 7)
        assert 1 <= state.done < 7
        first = (tmp_path / name / "profile_1MPa_out_800mm_s.csv").stat().st_mtime_ns
        desk.resume(name)
        desk.processes[name].wait(240)
    finally:
        desk.close()
    state = desk.state(name)
    assert (state.status, state.done, state.requested) == ("done", 7, 7)
    assert (tmp_path / name / "profile_1MPa_out_800mm_s.csv").stat().st_mtime_ns == first
    other = Desk(tmp_path)  # of another session
    assert [s.name for s in other.states()] == [name]
    again = tmp_path / "again.toml"
    again.write_text(other.case_file(name), encoding="utf-8")
    assert state.run is not None
    assert read_case(str(again), SHIPPED).parameters == state.run.parameters


def test_a_run_that_cannot_begin_says_why(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    name = desk.start({**GIVEN, "rod": "nonsense"})
    desk.processes[name].wait(60)
    state = desk.state(name)
    assert state.status == "failed"
    assert "nonsense" in state.line


def test_without_panel_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "softehl.cases.app.server", raising=False)
    monkeypatch.setitem(sys.modules, "panel", None)
    assert main(["app", "--folder", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "pip install 'softehl[app]'" in error


# --- The desk in headless Chromium, from choosing a ring to the report; who has no token gets n----


CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
PATIENCE = 240.0
WHOLE_RUN = 900.0  # s, on a loaded machine
SPEEDS = [800, 600, 450, 300, 200, 100]
ALL = """
const found = [];
const walk = (root) => { for (const e of root.querySelectorAll('*')) {
  if (e.matches(arguments[0])) found.push(e);
  if (e.shadowRoot) walk(e.shadowRoot); } };
walk(document);
return found;
"""
"""Elements of a selector, also those in the shadow of others."""

POINTS = """
let count = 0;
const walk = (view, thickness) => {
  const {type, glyph, data_source} = view.model;
  if (type === 'Figure')
    thickness = view.model.left.some((a) => String(a.axis_label).startsWith('film thickness'));
  if (thickness && type === 'GlyphRenderer' && glyph.type === 'Scatter')
    count += data_source.data.verdict.length;
  for (const child of view.children()) walk(child, thickness); };
for (const root of Bokeh.index.roots) walk(root, false);
return count;
"""
"""Points of the curves of film thickness that are drawn."""

Driver = Any


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a desk that is served by the command line."""
    pytest.importorskip("panel")
    pytest.importorskip("panel_material_ui")
    folder = tmp_path_factory.mktemp("desk")
    command = [sys.executable, "-m", "softehl", "app", "--no-browser", "--folder", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield server.stdout.readline().strip()
            server.terminate()
            assert server.wait(60) == 143
        finally:
            server.kill()


@pytest.fixture(scope="module")
def browser() -> Iterator[Driver]:
    pytest.importorskip("panel")
    selenium = pytest.importorskip("selenium.webdriver")
    if CHROMIUM is None or shutil.which("chromedriver") is None:
        pytest.skip("no Chromium with its driver")
    options = selenium.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,1500"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = selenium.Chrome(options, selenium.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()


class Hand:
    """What an engineer does on the page, and sees there."""

    def __init__(self, driver: Driver) -> None:
        self.driver = driver

    def all(self, css: str) -> list[Any]:
        """Elements that are on the page."""
        found: list[Any] = self.driver.execute_script(ALL, css)
        return found

    def texts(self, css: str) -> list[str]:
        """Their texts, of one moment."""
        script = ALL.replace(
            "return found", "return found.map((e) => e.innerText ?? e.textContent)"
        )
        found: list[str] = self.driver.execute_script(script, css)
        return found

    def fields(self) -> list[str]:
        """What the form holds."""
        script = ALL.replace("return found", "return found.map((e) => e.value)")
        found: list[str] = self.driver.execute_script(script, "input[type=text]")
        return found

    def click(self, css: str, words: str) -> None:
        """Click on what has these words, as soon as it stands still."""
        self.until(lambda: self._clicked(css, words))

    def _clicked(self, css: str, words: str) -> bool:
        from selenium.common.exceptions import StaleElementReferenceException

        try:
            found = [e for e in self.all(css) if e.text == words]
            for element in found[:1]:
                element.click()
        except StaleElementReferenceException:  # a list is drawn anew for each letter
            return False
        return bool(found)

    def type(self, number: int, words: str) -> None:
        """Type into a field in place of what it holds."""
        self.until(lambda: len(self.all("input[role=combobox]")) > number)
        field = self.all("input[role=combobox]")[number]
        field.click()
        field.send_keys("\ue009a\ue000" + words)  # control-a

    def choose(self, number: int, words: str) -> None:
        """Choose from the list of a field."""
        self.type(number, words)
        self.click("li[role=option]", words)

    def states(self) -> dict[str, tuple[str, str]]:
        """Run -> status and states, from the list of runs."""
        kept = self.driver.execute_script(
            ALL.replace(
                "return found",
                "return found.map((r) => [...r.querySelectorAll('[tabulator-field]')]"
                ".map((c) => [c.getAttribute('tabulator-field'), c.innerText]))",
            ),
            ".tabulator-row",
        )
        rows = [dict(row) for row in kept]
        # an empty cell holds a space that does not break
        return {r["run"]: (r["status"], r["states"].strip()) for r in rows if r.get("run")}

    def points(self) -> int:
        """Points of the curves of film thickness."""
        found: int = self.driver.execute_script(POINTS)
        return found

    def until(self, true: Callable[[], Any], seconds: float = PATIENCE) -> Any:
        """Wait for something."""
        end = time.monotonic() + seconds
        while not (found := true()):
            assert time.monotonic() < end, self.states()
            time.sleep(0.1)
        return found


def drawn(hand: Hand, words: str) -> bool:
    """Whether the drawing of the gland has these words."""
    return any(words in text for text in hand.texts("svg text"))


def told(hand: Hand, words: str) -> bool:
    """Whether the words on the gland have these."""
    return any(words in line for line in hand.texts("li"))


def shown(hand: Hand, rubber: str) -> bool:
    """Whether the form shows this rubber."""
    return rubber in hand.fields()


def reports(hand: Hand, runs: int) -> list[str]:
    """Addresses on the page of the report of so many runs."""
    script = ALL.replace("return found", "return found.map((e) => e.href)")
    found: list[str] = hand.driver.execute_script(script, "a[href*='report.html']")
    return [address for address in found if address.count("run=") == runs]


def _has_files(address: str) -> None:
    """Case file and sheet of a run, and of no other folder."""
    base, _, token = address.partition("/desk?")
    name = urlencode({"run": "ISO-3601-20x2.65-20-f7-NBR-70"})
    case = fetch(f"{base}/file/case.toml?{name}&{token}").decode()
    assert 'ring = "ISO 3601 20x2.65"' in case
    openpyxl = pytest.importorskip("openpyxl")
    sheet = fetch(f"{base}/file/report.xlsx?{name}&{token}")
    assert len(openpyxl.load_workbook(BytesIO(sheet)).sheetnames) > 3
    with pytest.raises(HTTPError, match="404") as refused:
        fetch(f"{base}/file/case.toml?run=..%2F..&{token}")
    refused.value.close()


@pytest.mark.slow
def test_the_form_is_what_its_fields_show(browser: Driver, address: str) -> None:
    """Texts that are in no list, entered or only typed, and after a reload; what is wrong is said;
    on a telephone nothing is wider than the page.
    """
    hand = Hand(browser)
    browser.get(address)
    hand.until(lambda: drawn(hand, "rod 35.9625 mm"))
    for words, end, modulus in (("NBR 71", "\ue007", "1.928"), ("FKM 82", "\t", "3.543")):
        hand.type(2, words + end)
        hand.until(partial(told, hand, f"shear modulus of the rubber {modulus} MPa"))
        hand.until(partial(shown, hand, words))
    browser.refresh()
    hand.until(partial(told, hand, "shear modulus of the rubber 3.543 MPa"))
    hand.until(partial(shown, hand, "FKM 82"))
    hand.type(1, "1 7/16 in\t")
    hand.until(lambda: any("is no size; write" in words for words in hand.texts("p")))
    narrow = {"width": 400, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", narrow)
    hand.until(lambda: browser.execute_script("return document.body.scrollWidth") == 400)
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.slow
def test_from_a_ring_to_the_report(browser: Driver, address: str, tmp_path: Path) -> None:
    hand = Hand(browser)
    browser.get(address)
    hand.until(lambda: drawn(hand, "rod 35.9625 mm"))
    hand.choose(0, "ISO 3601 20x2.65")
    hand.until(lambda: "20 f7" in hand.fields())  # the rod follows, and so does the drawing
    hand.until(lambda: drawn(hand, "rod 19.9695 mm"))
    hand.until(lambda: any(words.startswith("squeeze 14.5") for words in hand.texts("li")))

    hand.all("textarea")[0].send_keys(f"density = 4\nerror_estimate = false\nspeeds = {SPEEDS}\t")
    hand.click("button", "Run")
    first = "ISO-3601-20x2.65-20-f7-NBR-70"
    hand.until(lambda: first in hand.states())
    hand.choose(2, "FKM 80")
    hand.until(lambda: any("FKM" in f for f in hand.fields()))
    hand.click("button", "Run")
    second = "ISO-3601-20x2.65-20-f7-FKM-80"
    hand.until(lambda: second in hand.states())
    assert [status for status, _ in hand.states().values()] == ["running", "running"]

    hand.until(lambda: hand.states()[second][1] not in ("", "0 of 12"))
    hand.click("button", "Stop")  # of the one that was begun last
    hand.until(lambda: hand.states()[second][0] == "stopped")
    browser.refresh()
    hand.until(lambda: "FKM 80" in hand.fields() and len(hand.states()) == 2)
    kept = hand.states()[second]
    assert kept[0] == "stopped"
    reached = int(kept[1].split()[0])
    assert 1 <= reached < 12
    hand.until(lambda: hand.points() == reached)  # its curve has grown so far
    hand.until(lambda: hand.states()[first] == ("done", "12 of 12"), WHOLE_RUN)
    hand.click("button", "Go on")
    hand.until(lambda: hand.states()[second] == ("done", "12 of 12"), WHOLE_RUN)
    hand.until(lambda: hand.points() == 12)

    boxes = hand.all(".tabulator-row input[type=checkbox]")
    assert len(boxes) == 2
    next(box for box in boxes if not box.is_selected()).click()
    hand.until(lambda: hand.points() == 24)
    link = hand.until(lambda: reports(hand, 2))[0]
    browser.get_screenshot_as_file(str(tmp_path / "desk.png"))
    outside = browser.execute_script(
        "return performance.getEntriesByType('resource').map((e) => e.name)"
    )
    assert [name for name in outside if not name.startswith("http://127.0.0.1:")] == []
    browser.get(link)
    assert "20" in browser.title
    assert "Side by side" in browser.find_element("tag name", "body").text
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
    _has_files(address)


def fetch(url: str, **headers: str) -> bytes:
    with urlopen(Request(url, headers=headers), timeout=120) as answer:
        content: bytes = answer.read()
    return content


@pytest.mark.parametrize("page", ["/desk", "/file/report.html?run=a", "/desk/ws", "/"])
@pytest.mark.parametrize("token", ["", "token=wrong"])
def test_nothing_is_answered_without_the_token(address: str, page: str, token: str) -> None:
    base = address.partition("/desk")[0]
    with pytest.raises(HTTPError) as refused:
        fetch(f"{base}{page}{'&' if '?' in page else '?'}{token}")
    refused.value.close()
    assert refused.value.code in (400, 403)


def test_the_desk_is_on_this_machine_only(address: str) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/desk\?token=\S{32}", address)
