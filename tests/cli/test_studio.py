"""The studio without a browser: what is in hand, what its server answers, and whom it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from studio_server import TOKEN, Client, studio

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli.studio import saving
from mocca_robot.cli.studio.command import listen
from mocca_robot.cli.studio.corners import drag
from mocca_robot.cli.studio.history import History, Snapshot, changed
from mocca_robot.cli.studio.opening import open_path, unpack
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.files.documents import parse_yaml

CONFIGS = Path(__file__).parents[2] / "configs"
DRAWING = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">'
    '<path id="floor" d="M0 90H100V100H0Z"/><path id="low" d="M20 60H80V90H20Z"/>'
    '<path id="high" d="M30 30H70V60H30Z"/></svg>'
)


def start() -> Snapshot:
    return Snapshot(data={"model": "a.svg", "joints": {"margin": 0.1}, "fixed": ["floor"]}, folder=Path("/x"))


# --- what is in hand


def test_snapshots_stay_as_they_were() -> None:
    before = start()
    after = changed(before, ["joints", "margin"], "0.2", 1.0)
    assert before.data["joints"] == {"margin": 0.1}
    assert after.data["joints"] == {"margin": 0.2}
    assert after.label == "joints.margin: 0.2"
    assert changed(after, ["joints", "margin"], None, 1.0).data == {"model": "a.svg", "fixed": ["floor"]}
    assert changed(before, ["alpha_deg"], "null", 1.0).data["alpha_deg"] is None


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["alpha_deg"], "95", "alpha_deg"),
        (["alpha_deg"], "wide", "alpha_deg"),
        (["joints", "margin"], "0.7", "joints.margin"),
        (["joints", "margn"], "0.1", "margin"),
        (["density"], "[", "density"),
        (["parts", "low", "density"], "-1", "density"),
        (["model"], "/etc/passwd", "model"),
        ([], "1", "not changed here"),
    ],
)
def test_refused_values_name_key_and_limit(path: list[str], value: str, named: str) -> None:
    with pytest.raises(InputError, match=named):
        changed(start(), path, value, 1.0)


def test_undo_and_redo_go_along_one_line() -> None:
    history = History(snapshots=(start(),))
    for value in ("3", "4", "5"):
        history = history.with_step(changed(history.now, ["alpha_deg"], value, 1.0))
    history = history.moved(-1).moved(-1)
    assert (history.now.data["alpha_deg"], history.undoes, history.redoes) == (3, "alpha_deg: 3", "alpha_deg: 4")
    assert history.moved(-5).undoes is None
    assert history.moved(5).now.data["alpha_deg"] == 5
    history = history.with_step(changed(history.now, ["alpha_deg"], "9", 1.0))
    assert history.redoes is None
    history = history.with_step(changed(history.now, ["alpha_deg"], "10", 1.0), merge=True)
    assert [s.data.get("alpha_deg") for s in history.snapshots] == [None, 3, 10]


def test_saving_keeps_what_was_not_changed_with_its_comments() -> None:
    text = "# mine\nmodel: a.svg  # drawn\n\n# how wide\nalpha_deg: 5\n"
    text += "joints:\n  margin: 0.1   # wood\n# end\nfixed: [floor]\n"
    was = parse_yaml(text, "text")
    out = saving.as_yaml({**was, "alpha_deg": 8, "density": 700}, text, was)
    assert "# mine\nmodel: a.svg  # drawn\n\n# how wide\nalpha_deg: 8\n" in out
    assert "  margin: 0.1   # wood\n# end\nfixed: [floor]\n" in out
    assert parse_yaml(out, "out") == {**was, "alpha_deg": 8, "density": 700}
    gone = {k: v for k, v in was.items() if k != "joints"}
    assert parse_yaml(saving.as_yaml(gone, text, was), "gone") == gone


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda p: p.stem)
def test_every_configuration_comes_back_as_it_was(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    data = parse_yaml(text, path.name)
    assert saving.as_yaml(data, text, data) == text
    assert parse_yaml(saving.as_yaml(data), "new") == data


# --- corners


def tower() -> Assembly:
    def block(x0: float, y0: float, x1: float, y1: float) -> Polygon:
        return Polygon(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))

    return Assembly(
        "tower",
        (
            Part("floor", block(0, 0, 4, 1), fixed=True),
            Part("left", block(0, 1, 2, 2)),
            Part("right", block(2, 1, 4, 2)),
            Part("top", block(1, 2, 3, 3)),
        ),
    )


@pytest.mark.parametrize(
    ("corner", "to"), [((2, 2), (2.1, 1.8)), ((2, 1), (2.2, 1.1)), ((3, 2), (3.2, 2.1)), ((0, 1), (0.2, 1))]
)
def test_a_dragged_corner_opens_no_gap_and_no_overlap(corner: tuple[float, float], to: tuple[float, float]) -> None:
    before = tower()
    after = drag(before, np.array(corner, float), np.array(to, float))
    report = find_contacts(after)
    assert not report.overlaps
    assert not report.near_misses
    assert {c.parts for c in report.contacts} == {c.parts for c in find_contacts(before).contacts}
    back = drag(after, np.array(to, float), np.array(corner, float))
    for old, new in zip(before.parts, back.parts):
        assert np.isclose(old.shape.volume, new.shape.volume)


def test_corners_that_cross_or_are_not_there_are_refused() -> None:
    with pytest.raises(InputError, match="'top' would cross itself"):
        drag(tower(), np.array([1.0, 3.0]), np.array([9.0, 2.5]))
    with pytest.raises(InputError, match="No part has a corner"):
        drag(tower(), np.array([0.5, 0.5]), np.array([0.6, 0.6]))


# --- dropped files


@pytest.mark.parametrize("name", ["../evil.svg", "/etc/evil.svg", "C:\\evil.svg", "a/../../b.svg", "", "a\x00b.svg"])
def test_names_that_lead_elsewhere_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        unpack([(name, b"x")], tmp_path / "in")
    assert not list(tmp_path.rglob("evil*"))


def test_a_dropped_drawing_becomes_something_to_work_on(tmp_path: Path) -> None:
    snapshot, saved = open_path(unpack([("three.svg", DRAWING.encode())], tmp_path))
    assert saved.path is None
    assert snapshot.data["fixed"] == ["floor"]
    assert snapshot.data["sequence"] == ["low", "high"]


# --- the server


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with studio(tmp_path_factory.mktemp("work")) as found:
        yield found


def window(client: Client, name: str) -> Client:
    return Client(client.port, name)


def test_only_its_own_pages_may_talk_to_it(client: Client) -> None:
    assert client.get("/")[0] == 200
    assert client.get("/", cookie="")[0] == 403
    assert client.get("/", cookie=f"mocca-studio-{client.port}=wrong")[0] == 403
    assert client.get("/?token=wrong", cookie="")[0] == 403
    assert client.get(f"/?token={TOKEN}", cookie="")[0] == 303
    assert client.get("/", host=f"evil.example:{client.port}")[0] == 403
    assert client.get("/", origin="http://evil.example")[0] == 403
    assert client.get("/", origin=f"http://127.0.0.1:{client.port}")[0] == 200
    assert client.get("/api/window/events", cookie="")[0] == 403
    for name in ("../history.py", "app.css", "%2e%2e/web"):
        assert client.get(f"/{name}.js")[0] == 404


def test_the_page_asks_the_network_for_nothing(client: Client) -> None:
    folder = Path(saving.__file__).parent / "page"
    for file in folder.iterdir():
        text = file.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text
        assert "https://" not in text
        assert "eval(" not in text


def test_change_undo_save_and_open_again(client: Client) -> None:
    mine = window(client, "change-undo")
    assert mine.drop({"three.svg": DRAWING.encode()})["ok"]
    with mine.events() as until:
        first = until(lambda e: e["stage"] == "result")
        assert first["positive"]
        assert len(first["shapes"]) == 3
        assert mine.post("change", path=["alpha_deg"], value="12")["ok"]
        second = until(lambda e: e["stage"] == "result" and e["revision"] > first["revision"])
        assert second["insertions"][0]["required_deg"] == pytest.approx(12.0)
        refused = mine.post("change", path=["alpha_deg"], value="120")
        assert not refused["ok"]
        assert "alpha_deg" in refused["error"]
        assert mine.post("corner", corner=[0.08, -0.06], to=[0.085, -0.06])["ok"]
        third = until(lambda e: e["stage"] == "input" and e["revision"] > second["revision"])
        corner = min(third["shapes"][1][0], key=lambda p: abs(p[0] - 0.085) + abs(p[1] + 0.06))
        assert corner == pytest.approx([0.085, -0.06])
        saved = mine.post("save", path="kept")
        assert saved["ok"]
        mine.post("undo")
        document = until(lambda e: e["stage"] == "document" and e["redo"] is not None)
        assert document["data"]["alpha_deg"] == 12
        assert not document["saved"]
    config = load(saved["path"])
    assert np.rad2deg(config.assembly.alpha_rad or 0.0) == pytest.approx(12.0)
    assert float(config.assembly.parts[1].shape.bounds[1, 0]) == pytest.approx(0.085)
    other = window(client, "opened-again")
    assert other.post("open", path=saved["path"])["ok"]


def test_a_file_that_somebody_else_changed_is_not_overwritten_unasked(client: Client) -> None:
    mine = window(client, "other-hand")
    mine.drop({"three.svg": DRAWING.encode()})
    path = Path(mine.post("save", path="shared.yaml")["path"])
    path.write_text(path.read_text(encoding="utf-8") + "# a line by somebody else\n", encoding="utf-8")
    mine.post("change", path=["alpha_deg"], value="7")
    assert "changed by something else" in mine.post("save", path=str(path))["error"]
    assert "somebody else" in path.read_text(encoding="utf-8")
    assert mine.post("save", path=str(path), overwrite=True)["ok"]


def test_windows_do_not_disturb_each_other_and_come_back_as_they_were(client: Client) -> None:
    one, two = window(client, "window-one"), window(client, "window-two")
    for each in (one, two):
        each.drop({"three.svg": DRAWING.encode()})
    one.post("change", path=["alpha_deg"], value="9")
    with one.events() as until:
        assert until(lambda e: e["stage"] == "document")["data"]["alpha_deg"] == 9
    with two.events() as until:
        assert "alpha_deg" not in until(lambda e: e["stage"] == "document")["data"]
    with one.events() as until:  # reloaded
        assert until(lambda e: e["stage"] == "document")["data"]["alpha_deg"] == 9


def test_what_cannot_be_used_is_explained_and_the_old_result_stays(client: Client) -> None:
    mine = window(client, "explained")
    mine.drop({"three.svg": DRAWING.encode()})
    with mine.events() as until:
        until(lambda e: e["stage"] == "result")
        mine.post("change", path=["sequence"], value=["high"])
        problem = until(lambda e: e["stage"] == "problem")
        assert "'low'" in problem["text"]
        assert problem["path"] == "sequence"
    with mine.events() as until:
        until(lambda e: e["stage"] == "result")  # of the state before
        until(lambda e: e["stage"] == "problem")
    for files in ({"a.svg": b"<svg"}, {"a.exe": b"MZ"}, {"a.yaml": b"model: ../../etc/passwd"}, {}):
        assert not mine.drop(files)["ok"]


def test_too_much_is_refused(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mocca_robot.cli.studio.opening.LARGEST_DROP", 1000)
    assert "MB" in window(client, "too-much").drop({"a.svg": b" " * 2000})["error"]


def test_tilt_and_letting_go_answer_about_what_is_shown(client: Client) -> None:
    mine = window(client, "tilting")
    mine.drop({"three.svg": DRAWING.encode()})
    with mine.events() as until:
        until(lambda e: e["stage"] == "result")
        for angle, stands in ((1.0, False), (0.0, True)):
            mine.post("ask", do="tilt", which="input", angle_deg=angle, azimuth_deg=0, question=1)
            assert until(lambda e: e["stage"] == "tilt")["stands"] is stands
        mine.post("ask", do="let_go", which="input", angle_deg=20.0, azimuth_deg=0, question=2)
        seen = until(lambda e: e["stage"] == "let_go")
        assert seen["fell"]
        assert len(seen["poses"]) == len(seen["times"])
        assert not mine.post("ask", do="burn", which="input")["ok"]


def test_jobs_run_beside_and_can_be_cancelled(client: Client) -> None:
    mine = window(client, "working")
    mine.drop({"three.svg": DRAWING.encode()})
    with mine.events() as until:
        until(lambda e: e["stage"] == "result")
        mine.post("job", kind="design")
        job = until(lambda e: e["stage"] == "jobs" and e["jobs"] and e["jobs"][0]["state"] == "done")["jobs"][0]
        names = {Path(f).name for f in job["files"]}
        assert {"design.json", "report.html"} <= names
        status, page = mine.get(f"/api/{mine.window}/jobs/1/report.html")
        assert (status, b"three" in page) == (200, True)
        assert mine.get(f"/api/{mine.window}/jobs/1/passwd")[0] == 404
        mine.post("job", kind="run")
        until(lambda e: e["stage"] == "jobs" and e["jobs"][0]["state"] == "running")
        mine.post("cancel", job=2)
        until(lambda e: e["stage"] == "jobs" and e["jobs"][0]["state"] == "cancelled")


def test_a_taken_port_is_named_and_another_is_found() -> None:
    with listen(0) as taken, pytest.raises(InputError, match=str(taken.getsockname()[1])):
        listen(taken.getsockname()[1])
    with pytest.raises(InputError, match="70000"):
        listen(70000)


def test_ctrl_c_ends_it() -> None:
    import os
    import signal

    command = [sys.executable, "-m", "mocca_robot.cli", "studio", "--no-browser", "--port", "0"]
    flags = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, creationflags=flags)
    assert process.stdout is not None
    assert "token=" in process.stdout.readline()
    process.send_signal(signal.SIGINT if os.name == "posix" else signal.CTRL_BREAK_EVENT)
    assert process.wait(60) == 0


def test_keys_of_the_page_are_json() -> None:
    from mocca_robot.cli.studio.keys_data import keys_data

    assert len(json.loads(json.dumps(keys_data()))) > 30
