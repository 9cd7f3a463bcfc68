"""The page: one offline file, small, escaped, whole or not there, and with everything in it that was found."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from aerofdi.core import Flight, Series, Status, WrongUse, empty_verdict
from aerofdi.pipeline import FlightDiagnosis
from aerofdi.report import write_html
from aerofdi.report.page import page
from aerofdi.report.timeline import marks, states, timeline, unjudged

from .conftest import made_run

EVIL = "</script><script>alert('x')</script><img src=x onerror=alert(1)>\"'&.csv"


class Reader(HTMLParser):
    """Collects elements, attributes, the text people see, and the data block."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.data = ""
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.inside = dict(attrs).get("id") or tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "flights":
            self.data += data
        elif self.inside not in ("script", "style"):
            self.words.append(data)


def test_everything_a_reader_needs_is_in_words(faulty: FlightDiagnosis) -> None:
    text = " ".join(Reader(page([faulty])).words)
    for wanted in (
        "FAULT", "Right elevon (elevon B) stuck at 1421 µs", "Silent through 19.5 s", "STALE_INPUT", "40.50 s",
        "right elevon: loss of 35 % or more", "R² 0.80 commands alone", "R² 0.70 held out", "40 ms", "-5.00 ± 0.10 1/s",
        "learnt from", "0.0-20.0 s", "50.0-60.0 s: not flown under autopilot", "48.0-50.0 s: outside what was asked",
    ):  # fmt: skip
        assert wanted in text, wanted


def test_the_data_draw_what_was_found(faulty: FlightDiagnosis) -> None:
    (data,) = json.loads(Reader(page([faulty])).data)
    titles = [p["title"] for p in data["panels"]]
    assert titles[0] == "Attitude" and "Surface commands" in titles
    assert sum("explained by commands" in t for t in titles) == 2
    assert "right elevon stuck: position" in titles and "parity: residual over threshold" in titles
    assert [r["name"] for r in data["rows"]] == ["mode", "use", "effectiveness", "parity"]
    assert data["track"] and len(data["track"]) == 2
    assert {"t": 40.5, "text": "effectiveness: alarm", "kind": "alarm"} in data["marks"]
    assert any(m["kind"] == "truth" and m["t"] == 40.0 for m in data["marks"])


def test_without_a_model_what_happened_is_still_shown(unjudged: FlightDiagnosis) -> None:
    (data,) = json.loads(Reader(page([unjudged])).data)
    assert [p["title"] for p in data["panels"]] == ["Attitude", "Surface commands", "Angular rates"]
    assert all(s[2] == "unjudged" for r in data["rows"] if r["name"] == "use" for s in r["stretches"])


def test_nothing_from_a_log_becomes_markup(make) -> None:
    d = make("fault", source=EVIL, notes=(EVIL, "<b>bold</b>"))
    d.flight.measured["mode"].codes[2] = EVIL
    d.flight.meta["aliases"]["elevon_right"] = EVIL
    d.flight.meta["aircraft"] = EVIL
    d.flight.meta["assumed"] = [EVIL]
    plain, evil = Reader(page([make("fault"), make("fault")])), Reader(page([d, d]))
    count = [t for t, _ in evil.tags].count
    assert count("script") == 2 and count("img") == 0 and count("b") == 2
    assert [t for t, _ in evil.tags if t in ("script", "style", "a", "section")] == [
        t for t, _ in plain.tags if t in ("script", "style", "a", "section")
    ]
    assert not any(name.startswith("on") for _, attributes in evil.tags for name in attributes)
    assert EVIL in "".join(evil.words)
    assert any(EVIL in s[3] for r in json.loads(evil.data)[0]["rows"] for s in r["stretches"])


def test_the_page_asks_nobody_for_anything(faulty: FlightDiagnosis, healthy: FlightDiagnosis) -> None:
    text = page([faulty, healthy])
    assert not re.search(r"(?:src|href)\s*=\s*[\"']?(?!#)", text.replace('href="#', ""))
    assert "http:" not in text and "https:" not in text and "@import" not in text and "url(" not in text
    assert "fetch(" not in text and "XMLHttpRequest" not in text and "innerHTML" not in text
    policy = next(a for t, a in Reader(text).tags if a.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in str(policy["content"])


def test_many_flights_one_page(make, tmp_path: Path) -> None:
    found = [make(k, source=f"{i}.csv") for i, k in enumerate(["fault", "healthy", "cannot_judge"] * 5)]
    path = write_html(found, tmp_path / "r.html")
    seen = Reader(path.read_text(encoding="utf-8"))
    text = " ".join(seen.words)
    assert "15 flights: 5 with a fault, 5 without, 5 not judged" in text
    assert [a["id"] for t, a in seen.tags if t == "section"] == [f"flight{i}" for i in range(15)]
    assert path.stat().st_size < 3e6 and list(tmp_path.iterdir()) == [path]


def long_flight(d: FlightDiagnosis, hours: float) -> FlightDiagnosis:
    """The same diagnosis with an hour of 100 Hz record and 50 Hz verdicts, one spike in each."""
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(int(hours * 360_000))
    names = ("p", "q", "r", "phi", "theta", "command.elevon_left", "command.elevon_right", "reference.phi")
    measured = {
        n: Series(t, rng.standard_normal(len(t)), "1" if n.startswith("c") else "rad/s") for n in names
    }
    measured["phi"].value[123_456] = 300.0
    results = []
    for r in d.results:
        at = t[::2] + 0.0
        run = made_run(r.diagnoser, r.run.diagnoser.hypotheses, None)
        v = empty_verdict(run.diagnoser, len(at))
        v.status[:] = Status.OK
        v.residual[:], v.threshold[:], v.score[:] = rng.standard_normal(v.residual.shape), 1.0, 1.0
        results.append(
            type(r)(r.diagnoser, r.verdict, r.reason, {}, r.events, run._replace(t_s=at, verdict=v))
        )
    return FlightDiagnosis(
        "long.ulg", Flight(measured, meta={"source": "long.ulg"}), [], [], [(0.0, t[-1])], None, results
    )


def test_an_hour_at_100_hz_stays_small_and_keeps_its_spike(faulty: FlightDiagnosis, tmp_path: Path) -> None:
    path = write_html([long_flight(faulty, 1.0)], tmp_path / "r.html")
    assert path.stat().st_size < 3e6
    (data,) = json.loads(Reader(path.read_text(encoding="utf-8")).data)
    roll = next(
        t for p in data["panels"] if p["title"] == "Attitude" for t in p["traces"] if t["name"] == "roll"
    )
    assert roll["zero"] + 32767 * roll["unit"] == pytest.approx(np.degrees(300.0), rel=1e-3)


def test_a_report_that_cannot_be_written_says_so(faulty: FlightDiagnosis, tmp_path: Path) -> None:
    with pytest.raises(WrongUse, match=r"cannot be written to .*nowhere"):
        write_html([faulty], tmp_path / "nowhere" / "r.html")
    with pytest.raises(WrongUse, match="at least one"):
        write_html([], tmp_path / "r.html")
    assert not list(tmp_path.iterdir())


def test_timeline_covers_the_flight_without_overlap(faulty: FlightDiagnosis) -> None:
    use = next(r for r in timeline(faulty) if r["name"] == "use")["stretches"]
    assert [(s[2], s[0], s[1]) for s in use][:2] == [("trained", 0.0, 20.0), ("judged", 20.0, 48.0)]
    assert use[-1][1] == faulty.flight.span_s[1] and all(a[1] == b[0] for a, b in pairwise(use))
    assert sum(b - a for a, b, _ in unjudged(faulty)) == pytest.approx(faulty.flight.duration_s - 48.0)
    said = states(faulty.results[1].run)
    assert [s[2] for s in said] == ["silent", "waiting", "silent", "named"]
    assert said[1][0] == pytest.approx(30.0) and said[1][1] == pytest.approx(31.0)
    assert all(a[1] == pytest.approx(b[0]) for a, b in pairwise(said))


def test_the_log_s_own_truth_is_marked_as_such(faulty: FlightDiagnosis) -> None:
    t = np.array([0.0, 12.0, 20.0])
    d = FlightDiagnosis(
        "f", Flight(faulty.flight.measured, truth={"failure.aileron": Series(t, np.array([0.0, 1.0, 1.0]), "1")}),
        [], [], [], None, [],
    )  # fmt: skip
    assert marks(d) == [{"t": 12.0, "text": "truth: failure.aileron", "kind": "truth"}]
