"""The report without OpenGL: verdicts on both sides of their criterion, the page, and the folder that it goes to."""

from __future__ import annotations

import csv
import io
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssil_viewer import output
from ssil_viewer.errors import UserError
from ssil_viewer.measure.tables import Table
from ssil_viewer.reference.all_pixels import Surfaces
from ssil_viewer.reproduce import charts, light, report, sampling, speed, steady
from ssil_viewer.reproduce import run as running
from ssil_viewer.reproduce.claim import FAILS, HOLDS, UNSEEN, Chart, Claim, Finding, Line, Picture, judged
from ssil_viewer.reproduce.claims import CLAIMS, chosen
from ssil_viewer.reproduce.run import Result
from ssil_viewer.reproduce.studio import scaled_box
from ssil_viewer.settings import Settings

# -- verdicts ------------------------------------------------------------------------------------------------------

def series(worst: float, repeats_within: float) -> dict:
    return {"name": "lights", "worst": worst, "repeats_within": repeats_within,
            "points": [{"label": "1"}, {"label": "9"}]}


@pytest.mark.parametrize("worst, repeats_within, verdict", [
    (1.04, 1.5, HOLDS), (1.06, 1.01, FAILS), (1.06, 1.5, UNSEEN)])
def test_constant_cost(worst, repeats_within, verdict):
    assert speed.constant_verdict([series(1.01, 1.0), series(1.0, 1.0)])[0] == HOLDS
    found, why = speed.constant_verdict([{**series(1.01, 1.0), "name": "triangles"}, series(worst, repeats_within)])
    assert found == verdict
    assert ("too busy" in why) == (verdict == UNSEEN)


@pytest.mark.parametrize("totals, gpu, size, verdict", [
    ([1.0, 9.9], True, (1280, 720), HOLDS), ([1.0, 10.1], True, (1280, 720), FAILS),
    ([1.0, 2.0], True, (640, 360), UNSEEN), ([1.0, 2.0], False, (1280, 720), UNSEEN)])
def test_budget(totals, gpu, size, verdict):
    assert speed.budget_verdict(totals, gpu, size)[0] == verdict


@pytest.mark.parametrize("most, repeats_within, verdict", [(1.9, 1.5, HOLDS), (2.1, 1.01, FAILS), (2.1, 1.5, UNSEEN)])
def test_visibility(most, repeats_within, verdict):
    found, why = speed.visibility_verdict({"horizon": {1: 1.5, 2: most}, "voxel": {1: 4.0, 2: 17.0}}, repeats_within)
    assert found == verdict and f"{most:.2f}" in why and "17.00" in why


@pytest.mark.parametrize("level, dense, repeats_within, verdict", [
    (1.04, 1.9, 1.5, HOLDS), (1.1, 1.9, 1.01, FAILS), (1.0, 1.2, 1.01, FAILS), (1.1, 1.9, 1.3, UNSEEN),
    (0.9, 1.9, 1.3, UNSEEN)])
def test_one_more_level(level, dense, repeats_within, verdict):
    assert speed.level_verdict(level, dense, repeats_within)[0] == verdict


def candidate(start: int, samples: int, ms: float, error: float) -> sampling.Candidate:
    return sampling.Candidate(Settings(start_level=start, samples=samples), ms, error)


def test_equal_time():
    full, many = candidate(0, 16, 100.0, 0.5), candidate(0, 64, 400.0, 0.1)
    better = candidate(2, 64, 90.0, 0.3)
    assert sampling.equal_time_verdict([full, better])[0] == HOLDS
    found, why = sampling.equal_time_verdict([full, many, better])
    assert found == HOLDS and "64 samples is not beaten" in why, "many samples at full resolution are not judged"
    for worse in (candidate(2, 64, 110.0, 0.3), candidate(2, 64, 90.0, 0.6), candidate(2, 8, 90.0, 0.3)):
        found, why = sampling.equal_time_verdict([full, worse])
        assert found == FAILS and "nothing that starts lower is better" in why
    with pytest.raises(UserError):
        sampling.equal_time_verdict([many, better])


@pytest.mark.parametrize("measure, good, bad", [
    (steady.vote_verdict, ({0.5: 0.4, 1.0: 0.8},), [({0.5: 0.4, 1.0: 0.81},)]),
    (sampling.form_factor_verdict, (0.3, 0.01, 1.6, 4, 9), [(0.0, 0.03, 1.6, 4, 9), (0.0, -0.03, 1.6, 4, 9),
                                                            (0.0, 0.0, 1.4, 4, 9)]),
    (sampling.importance_verdict, (2.1, -0.04), [(1.9, 0.0), (9.0, 0.06), (9.0, -0.06)]),
    (steady.upsampling_verdict, ({"nearest": 0.2, "bilateral": 0.1}, {"nearest": 0.4, "bilateral": 0.4}),
     [({"nearest": 0.2, "bilateral": 0.11}, {"nearest": 0.4, "bilateral": 0.3}),
      ({"nearest": 0.2, "bilateral": 0.1}, {"nearest": 0.4, "bilateral": 0.41})]),
    (steady.reprojection_verdict, (0.2, 0.1, 1.25, 1.0), [(0.21, 0.05, 1.0, 9.0), (0.1, 0.11, 1.0, 1.0),
                                                          (0.1, 0.05, 1.3, 1.0)]),
    (light.bounces_verdict, ([1.0, 2.0, 2.5, 2.6], 2.55, [0.5, 0.2, 0.1]),
     [([1.0, 2.0, 3.0, 3.5], 3.2, []), ([1.0, 2.0, 1.9, 1.95], 2.0, []), ([1.0, 2.0, 2.5, 2.6], 2.4, []),
      ([1.0, 2.0, 2.5, 2.6], 2.55, [0.5, 0.1, 0.2])]),
])
def test_rules(measure, good, bad):
    assert measure(*good)[0] == HOLDS
    assert [measure(*numbers)[0] for numbers in bad] == [FAILS] * len(bad)


def test_a_busy_machine_cannot_refute_the_cost_of_the_temporal_filter():
    verdict, why = steady.reprojection_verdict(0.1, 0.05, 1.5, 1.4)
    assert verdict == UNSEEN and "too busy" in why


def test_sponza():
    relief = {"direct": 0.01, "both": 0.2, "shown": 0.06, "shown_direct": 0.0, "contrast": 0.2}
    assert light.sponza_verdict(1.5, 1.2, relief)[0] == HOLDS
    assert light.sponza_verdict(1.4, 1.2, relief)[0] == FAILS
    for name, value in (("direct", 0.03), ("shown", 0.04), ("contrast", 0.05)):
        assert light.sponza_verdict(1.5, 1.2, relief | {name: value})[0] == FAILS, name


def test_a_busy_machine_cannot_refute():
    assert [judged(1.0, 9.0, 1.1), judged(1.02, 1.05, 1.1), judged(1.15, 1.2, 1.1)] == [HOLDS, FAILS, UNSEEN]
    assert judged(2.0, 1.2, 1.1) == FAILS, "no disturbance of a fifth makes it twice as slow"


def test_a_level_that_costs_less_than_nothing_is_no_measurement():
    verdict, why = speed.level_verdict(0.93, 1.9, 1.004)
    assert verdict == UNSEEN and "more work in less time" in why and "busy" not in why


def test_columns_of_one_name_are_all_in_the_csv():
    table = Table("t", ("name", "over", "over"), (("a", "1", "2"),))
    files = report.contents({}, [Result(claim("C1"), Finding(HOLDS, "w", tables=(table,)))])
    assert files["C1-1.csv"].decode() == "name,over,over\na,1,2\n"


def test_a_part_of_the_picture_is_found_at_any_size():
    box = (470, 195, 730, 450)
    assert scaled_box(box, (1280, 720)) == box
    assert scaled_box(box, (640, 360)) == (235, 98, 365, 225)
    assert scaled_box(box, (720, 720)) == (190, 195, 450, 450), "the middle stays in the middle"


def test_edges_are_steps_and_creases_but_not_slopes():
    """A slanted plane, beside it the same plane further back, below it one that faces up."""
    y, x = np.mgrid[:8, :8].astype(float)
    position = np.stack([x, -y, -100 - 0.1 * x], -1)
    normal = np.zeros((8, 8, 3))
    normal[:] = np.array([-0.1, 0.0, 1.0]) / np.hypot(0.1, 1)
    image = Surfaces(position, normal, np.ones((8, 8)), np.ones((8, 8), bool))
    assert not steady.edges(image).any()
    position[:, 5:, 2] -= 10
    found = steady.edges(image)
    assert found[:, 4:6].all() and found.sum() == 16
    assert steady.widened(found, 2).sum() == 8 * 6
    position[:, 5:, 2] += 10
    normal[6:] = (0.0, 1.0, 0.0)
    assert steady.edges(image)[5:7].all() and steady.edges(image).sum() == 16


# -- names ---------------------------------------------------------------------------------------------------------

def test_the_claims_are_those_of_the_talk_and_can_be_chosen():
    assert [claim.id for claim in CLAIMS] == [f"C{n}" for n in range(1, 13)]
    assert chosen(None) == list(CLAIMS)
    assert [claim.id for claim in chosen(" c7,C3 ,C3")] == ["C3", "C7"]
    for text, message in (("C3,C33", "no claim is called 'C33', --claims, did you mean C3"),
                          ("7", "did you mean C7?"), (",", "no claim is named"), ("pareto", "give some of C1,C2")):
        with pytest.raises(UserError, match=message.replace("?", r"\?")):
            chosen(text)


def test_the_documentation_has_every_rule():
    text = (Path(__file__).resolve().parents[2] / "docs" / "reproduce.md").read_text(encoding="utf-8")
    for one in CLAIMS:
        assert f"| {one.id} {one.title} | {one.criterion} |" in text, "docs/reproduce.md says otherwise"


# -- the page ------------------------------------------------------------------------------------------------------

NASTY = 'A <script>alert("1")</script> & `b`'


def claim(name: str, measure=None) -> Claim:
    return Claim(name, NASTY, "It says & means <this>.", "By 2 m^-2.", "x < 5 %", (f"run --{NASTY}",), measure)


def result(name: str, verdict: str) -> Result:
    table = Table("ms; wall clock", ("name", "a"), ((NASTY, "1"), ("two", "2")))
    chart = Chart("line", "Rise", "x", "y", (Line("a", ((1.0, 2.0), (10.0, 3.0)), marks=("p", "q")),
                                              Line("front", ((1.0, 1.0), (9.0, 2.0)), faint=True)),
                  "A line.", log_x=True, log_y=True)
    bars = Chart("bars", "Bars", "", "ms", (Line("a", ((0.0, 2.0), (1.0, 3.0)), marks=("p", "q"), bars=True),), "Bars.")
    image = Image.new("RGB", (8, 4), (10, 20, 30))
    pictures = (Picture("soft", image, "caption", f'alt "{NASTY}"'), Picture("sharp", image, "c", "texels", sharp=True))
    return Result(claim(name), Finding(verdict, f"measured {NASTY}", {"ratio": np.float32(2.0)}, (table,),
                                       (chart, bars), pictures, ("a note",)))


RESULTS = [result("C1", HOLDS), result("C2", FAILS), result("C3", UNSEEN)]
HEAD = {"renderer": NASTY, "clock": "wall clock"}


class Reader(HTMLParser):
    """Notes what a browser would fetch, names, texts of verdicts, and whether elements close."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.links, self.ids, self.alts, self.open = [], [], [], [], []
        self.verdicts: dict[str, list[str]] = {}
        self._section = ""
        self._within = False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.tags.append(tag)
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)
        self.links += [value for name, value in attributes if name in ("src", "href", "xlink:href", "srcset", "data")]
        self.ids += [found["id"]] if "id" in found else []
        if tag == "img":
            self.alts.append(found.get("alt"))
        if tag == "section":
            self._section = found["id"]
        self._within = "verdict" in (found.get("class") or "").split()

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        self._within = False

    def handle_data(self, data):
        if self._within:
            self.verdicts.setdefault(self._section, []).append(data)


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    return report.contents(HEAD, RESULTS)


def test_the_page_needs_nothing_from_elsewhere(files):
    text = files["index.html"].decode()
    page = Reader(text)
    assert not page.open, "every element closes"
    assert all(link.startswith(("data:image/", "#")) for link in page.links)
    assert "http" not in text and "@import" not in text
    assert "url(" not in text.replace("url(#", "")
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert len(page.ids) == len(set(page.ids)), "charts do not share names"
    targets = {link.removeprefix("#") for link in page.links if link.startswith("#")}
    assert targets <= set(page.ids)
    assert page.tags.count("img") == 6 and all(page.alts)


def test_every_claim_has_a_verdict_in_summary_and_section(files):
    page = Reader(files["index.html"].decode())
    assert page.verdicts == {"": ["✓ holds", "✗ does not hold", "○ cannot be seen here"], "C1": ["✓ holds"],
                             "C2": ["✗ does not hold"], "C3": ["○ cannot be seen here"]}


def test_names_are_escaped(files):
    text = files["index.html"].decode()
    assert "<script" not in text and "&lt;script&gt;" in text
    assert "<code>b</code>" in text and "m<sup>-2</sup>" in text and "5&nbsp;%" in text


def test_the_data_beside_the_page(files):
    data = json.loads(files["data.json"])
    assert [one["verdict"] for one in data["claims"]] == [HOLDS, FAILS, UNSEEN]
    assert data["claims"][0]["figures"] == {"ratio": 2.0}
    assert data["claims"][1]["charts"][0]["lines"][0]["points"] == [[1.0, 2.0], [10.0, 3.0]]
    assert set(data["files"]) == files.keys() - {"index.html", "data.json"}
    assert list(csv.reader(io.StringIO(files["C1-1.csv"].decode()))) == [["name", "a"], [NASTY, "1"], ["two", "2"]]
    for name in ("C1-soft.jpg", "C1-sharp.png"):
        assert Image.open(io.BytesIO(files[name])).size == (8, 4)
    assert files == report.contents(HEAD, RESULTS), "the same bytes each time"


def test_charts_stand_alone_too(files):
    pytest.importorskip("matplotlib")
    import xml.etree.ElementTree as tree
    assert tree.fromstring(files["C1-line.svg"].decode()).tag.endswith("svg")
    assert ">p<" in files["C1-bars.svg"].decode()


def test_without_matplotlib_the_page_says_so(monkeypatch):
    monkeypatch.setattr(charts.importlib.util, "find_spec", lambda name: None)
    found = report.contents(HEAD, RESULTS)
    text = found["index.html"].decode()
    assert "they take matplotlib" in text and "<svg" not in text
    assert not any(name.endswith(".svg") for name in found)


# -- running -------------------------------------------------------------------------------------------------------

def test_a_claim_that_cannot_be_measured_does_not_cost_the_others():
    def missing(lab):
        raise UserError("no package", "", "install it")

    heard = []
    claims = [claim("C1", missing), claim("C2", lambda lab: lab.say("x", 0.5) or Finding(HOLDS, "fine"))]
    found = running.measure(None, claims, progress=lambda what, done, total: heard.append((what, done, total)))
    assert [one.finding.verdict for one in found] == [UNSEEN, HOLDS]
    assert found[0].finding.why == "it could not be measured: no package, install it"
    assert heard == [("C1: ", 0.0, 2), ("C2: ", 1.0, 2), ("C2: x", 1.5, 2)]


def test_errors_of_the_program_go_on():
    def broken(lab):
        raise ValueError

    with pytest.raises(ValueError):
        running.measure(None, [claim("C1", broken)])


# -- the folder ----------------------------------------------------------------------------------------------------

def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_former_report_is_replaced_and_nothing_else(tmp_path, files):
    target = tmp_path / "out"
    assert output.check_folder(target, report.is_report) == target and not names(tmp_path)
    report.write(target, HEAD, RESULTS)
    assert names(target) == set(files) and names(tmp_path) == {"out"}
    assert report.is_report(target)
    output.check_folder(target, report.is_report)
    report.write(target, HEAD, RESULTS[:1])
    assert names(target) < set(files) and names(tmp_path) == {"out"}
    (target / "mine.txt").write_text("keep")
    with pytest.raises(UserError, match="holds other files"):
        output.check_folder(target, report.is_report)
    empty = tmp_path / "empty"
    empty.mkdir()
    output.check_folder(empty, report.is_report)
    report.write(empty, HEAD, RESULTS[:1])
    assert (empty / "index.html").exists()


@pytest.mark.parametrize("data", ["", "[]", "{}", '{"kind": "other", "files": []}', '{"kind": 1, "files": 2}'])
def test_what_is_no_report_stays(tmp_path, data):
    (tmp_path / "data.json").write_text(data)
    assert not report.is_report(tmp_path)


def test_folders_that_cannot_be(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    for path, message in (("file", "a file is where the output folder should be"), ("a/b", "does not exist"),
                          ("file/b", "is a file"), ("", "no usable"), (".", "current folder"), ("a\0", "no usable")):
        with pytest.raises(UserError, match=message):
            output.check_folder(path, report.is_report)
    assert names(tmp_path) == {"file"}
    monkeypatch.setattr(output.os, "access", lambda *_: False)
    with pytest.raises(UserError, match="no right to write"):
        output.check_folder("new", report.is_report)


def test_a_folder_that_cannot_be_moved_is_refused_before_anything_is_measured(tmp_path, monkeypatch):
    """As on Windows while a table of it is open elsewhere."""
    target = tmp_path / "out"
    report.write(target, HEAD, RESULTS[:1])

    def busy(self, to):
        raise PermissionError(13, "The process cannot access the file because it is being used by another process")

    monkeypatch.setattr(Path, "rename", busy)
    with pytest.raises(UserError, match="used by another process"):
        output.check_folder(target, report.is_report)
    assert names(tmp_path) == {"out"}


def test_a_mounted_volume_is_refused_before_anything_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(output.os.path, "ismount", lambda path: path == tmp_path / "volume")
    (tmp_path / "volume").mkdir()
    with pytest.raises(UserError, match="mounted volume"):
        output.check_folder(tmp_path / "volume", report.is_report)


def test_what_came_into_the_folder_meanwhile_stays(tmp_path):
    target = tmp_path / "out"
    report.write(target, HEAD, RESULTS[:1])
    output.check_folder(target, report.is_report)
    (target / "mine.txt").write_text("keep")
    with pytest.raises(UserError, match="other files by now"):
        report.write(target, HEAD, RESULTS)
    assert (target / "mine.txt").read_text() == "keep" and names(tmp_path) == {"out"}


@pytest.mark.parametrize("failure, expected", [(OSError(28, "No space left on device"), UserError),
                                               (KeyboardInterrupt(), KeyboardInterrupt)], ids=["full", "interrupt"])
def test_a_full_disk_or_an_interrupt_leaves_the_former_report(tmp_path, monkeypatch, failure, expected):
    target = tmp_path / "out"
    report.write(target, HEAD, RESULTS[:1])
    before = {path.name: path.read_bytes() for path in target.iterdir()}
    whole, written = Path.write_bytes, []

    def full(self, data):
        written.append(self)
        if len(written) > 2:
            raise failure
        return whole(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(expected):
        report.write(target, HEAD, RESULTS)
    assert {path.name: path.read_bytes() for path in target.iterdir()} == before
    assert names(tmp_path) == {"out"}


def test_a_failed_exchange_brings_the_former_folder_back(tmp_path, monkeypatch):
    target = tmp_path / "out"
    target.mkdir()
    (target / "old").write_text("old")
    rename, calls = Path.rename, []

    def second_fails(self, to):
        calls.append(to)
        if len(calls) == 2:
            raise OSError(16, "Device or resource busy")
        return rename(self, to)

    monkeypatch.setattr(Path, "rename", second_fails)
    with pytest.raises(UserError, match="busy"), output.atomic_folder(target) as fresh:
        (fresh / "new").write_text("new")
    assert names(tmp_path) == {"out"} and names(target) == {"old"}
