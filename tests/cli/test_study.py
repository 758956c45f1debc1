"""Studies: every point its row, resumed by content, the same on every executor, whatever happens to a worker."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import hears_ctrl_c, posix_only

from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.runtime.executors import LocalProcesses, WorkerLost, completed, executor, mapped
from mocca_robot.statics.cases import critical_tilt, critical_tilts
from mocca_robot.verdicts.verification import verify
from sim.studies.point import Row
from sim.studies.run import StudyResult, run_study
from sim.studies.study import Study, read_study
from sim.trial_store import TrialStore

ROOT = Path(__file__).parents[2]
BASE = ROOT / "configs" / "stack.yaml"


def written(folder: Path, text: str) -> Path:
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def small(folder: Path, vary: str = "{alpha_deg: [0, 4], joints.max_slope_deg: [40, 70]}", more: str = "") -> Study:
    return read_study(written(folder, f"base: {BASE}\nvary: {vary}\n{more}"))


def without_time(found: StudyResult) -> list[Row | None]:
    return [None if row is None else {k: v for k, v in row.items() if k != "seconds"} for row in found.rows]


class Inline(Executor):
    """An executor that computes at once, here."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def test_a_grid_has_every_combination_and_a_list_goes_in_step(tmp_path: Path) -> None:
    grid = small(tmp_path, "{alpha_deg: [0, 5], friction: {from: 0.1, to: 10, count: 3, spacing: log}}")
    assert [tuple(p.values.values()) for p in grid.points] == [(a, f) for a in (0, 5) for f in (0.1, 1.0, 10.0)]
    listed = small(tmp_path, "{alpha_deg: [0, 5], friction: [0.1, 0.2]}", "combine: list")
    assert [tuple(p.values.values()) for p in listed.points] == [(0, 0.1), (5, 0.2)]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("vary: {alpha_deg: [1]}", "no 'base'"),
        ("base: nowhere.yaml\nvary: {alpha_deg: [1]}", "does not exist"),
        (f"base: {BASE}", "varies nothing"),
        (f"base: {BASE}\nvary: {{alfa_deg: [1]}}", "did you mean 'alpha_deg'"),
        (f"base: {BASE}\nvary: {{alpha_deg: 3}}", "list of values"),
        (f"base: {BASE}\nvary: {{alpha_deg: {{from: 0, to: 5}}}}", "no 'count'"),
        (f"base: {BASE}\nvary: {{alpha_deg: {{from: 0, to: 5, count: 3, spacing: log}}}}", "more than 0"),
        (f"base: {BASE}\nvary: {{alpha_deg: [1, 2], friction: [0]}}\ncombine: list", "alpha_deg has 2, friction has 1"),
        (f"base: {BASE}\nvary: {{alpha_deg: [1]}}\nset: {{alpha_deg: 2}}", "varied and set"),
        (f"base: {BASE}\nvary: {{alpha_deg: [1]}}\nstages: [simulates]", "did you mean 'simulate'"),
        (f"base: {BASE}\nvary: {{alpha_deg: [1]}}\nover: 3", "unknown key 'over'"),
    ],
)
def test_a_study_that_cannot_be_used_is_an_error_with_its_remedy(
    text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", str(written(tmp_path, text)), "-o", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err


def test_the_command_writes_table_figures_and_page_and_resumes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"base: {BASE}\nvary: {{alpha_deg: [0, 4, 120], joints.max_slope_deg: [40, 70]}}\nstages: [design, tilt]\n"
    asked = ["study", str(written(tmp_path, text)), "-o", str(tmp_path / "out"), "--jobs", "2", "--json"]
    assert main(asked) == 1  # an alpha of 120 degrees has no verdict
    first = json.loads(capsys.readouterr().out)
    assert first["counts"] == {"holds": 4, "unusable": 2} and first["kept"] == 0
    data = json.loads(Path(first["files"]["study"]).read_text(encoding="utf-8"))
    assert [p["status"] for p in data["points"]] == ["holds"] * 4 + ["unusable"] * 2
    assert "alpha_deg is 120; it must be" in data["points"][-1]["reason"]
    with Path(first["files"]["table"]).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(r["tilt_deg"]) for r in rows[:4]] == [p["tilt_deg"] for p in data["points"][:4]]
    page = ET.parse(first["files"]["page"])
    assert "mocca-robot design" in "".join(page.getroot().itertext())
    for kind, name in first["files"].items():
        if name.endswith(".svg"):
            assert ET.parse(name).getroot().tag.endswith("svg"), kind
    assert main(asked) == 1
    again = json.loads(capsys.readouterr().out)
    assert again["kept"] == 4
    assert json.loads(Path(again["files"]["study"]).read_text(encoding="utf-8")) == data | {
        "points": [p | ({"seconds": 0.0} if p["status"] == "unusable" else {}) for p in data["points"]]
    }


def test_a_study_that_grows_computes_only_what_is_new(tmp_path: Path) -> None:
    store = TrialStore(tmp_path / "points.jsonl")
    first = run_study(small(tmp_path, "{alpha_deg: [0, 4]}"), Inline(), store)
    grown = run_study(small(tmp_path, "{alpha_deg: [4, 0, 2]}"), Inline(), TrialStore(tmp_path / "points.jsonl"))
    assert grown.kept == 2
    assert grown.rows[:2] == first.rows[::-1]
    other = run_study(small(tmp_path, "{alpha_deg: [0, 4]}", "set: {friction: 0.3}"), Inline(), store)
    assert other.kept == 0  # friction is part of what decides a row


def test_every_executor_gives_the_same_rows(tmp_path: Path) -> None:
    study = small(tmp_path, more="stages: [design, tilt]")
    here = without_time(run_study(study, Inline()))
    assert all(row is not None and row["status"] == "holds" for row in here)
    with ThreadPoolExecutor(2) as threads:
        assert without_time(run_study(study, threads)) == here
    with executor(2) as processes:
        assert without_time(run_study(study, processes)) == here


def test_ctrl_c_keeps_finished_points_and_the_rest_follows(tmp_path: Path) -> None:
    study = small(tmp_path)

    def interrupts(label: str, done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    store = TrialStore(tmp_path / "points.jsonl")
    stopped = run_study(study, Inline(), store, interrupts)
    assert stopped.interrupted and len(store) == 2 and len(stopped.unfinished) == 2
    whole = run_study(study, Inline(), TrialStore(tmp_path / "points.jsonl"))
    assert whole.kept == 2 and not whole.unfinished


@posix_only
def test_an_interrupted_command_goes_on_from_there(tmp_path: Path) -> None:
    text = f"base: {BASE}\nvary: {{alpha_deg: {{from: 0, to: 4, count: 60}}}}\n"
    command = [sys.executable, "-m", "mocca_robot.cli", "study", str(written(tmp_path, text)), "--jobs", "1", "--json"]
    command += ["-o", str(tmp_path / "out")]
    running = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        preexec_fn=hears_ctrl_c,
    )
    store = tmp_path / "out" / "points.jsonl"
    give_up = time.monotonic() + 120.0
    while not (store.exists() and store.read_text(encoding="utf-8").count("\n") >= 2):
        assert running.poll() is None and time.monotonic() < give_up
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    said, wrong = running.communicate(timeout=120)
    assert running.returncode == 130, wrong
    assert "Traceback" not in wrong
    data = json.loads((tmp_path / "out" / "study.json").read_text(encoding="utf-8"))
    statuses = [p["status"] for p in data["points"]]
    assert json.loads(said)["interrupted"] and "not computed" in statuses and statuses[:2] == ["holds", "holds"]


def dies_once(flag: str) -> str:
    if not os.path.exists(flag):
        Path(flag).touch()
        os._exit(9)
    return "done"


def dies(_: object) -> None:
    os._exit(9)


def doubled(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    return 2 * number


def test_a_process_that_dies_costs_its_own_task_only(tmp_path: Path) -> None:
    pool = LocalProcesses(2)
    lost = pool.submit(dies, None)
    again = pool.submit(dies_once, str(tmp_path / "flag"))
    fine = [pool.submit(doubled, k) for k in range(3)]
    assert [f.result(timeout=120) for f in fine] == [0, 2, 4]
    assert again.result(timeout=120) == "done"
    with pytest.raises(WorkerLost, match="fewer jobs"):
        lost.result(timeout=120)
    pool.shutdown()


def test_completed_yields_errors_and_mapped_raises_them() -> None:
    found = dict(completed(Inline(), doubled, iter(range(5)), in_flight=2))
    assert [found[k] for k in (0, 1, 2, 4)] == [0, 2, 4, 8]
    assert isinstance(found[3], ValueError)
    assert mapped(Inline(), doubled, [2, 1]) == mapped(None, doubled, [2, 1]) == [4, 2]
    with pytest.raises(ValueError, match="three"):
        mapped(Inline(), doubled, [1, 3])


@pytest.fixture
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as found:
        yield found


@posix_only
def test_a_cluster_gives_the_same_rows_though_a_worker_is_killed(tmp_path: Path, cluster: Any) -> None:
    study = small(tmp_path, "{alpha_deg: {from: 0, to: 4, count: 8}}", "stages: [design, tilt]")
    here = without_time(run_study(study, Inline()))
    killed = []

    def kills(label: str, done: int, total: int) -> None:
        if done == 3:
            worker = next(iter(cluster.workers.values()))
            killed.append(worker.pid)
            os.kill(worker.pid, signal.SIGKILL)

    with executor(scheduler=cluster.scheduler_address) as pool:
        there = run_study(study, pool, progress=kills)
    assert killed and without_time(there) == here


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mocca_robot.runtime.executors.CONNECT_S", 0.5)
    with pytest.raises(EnvironmentNeeded, match=r"tcp://127\.0\.0\.1:9"), executor(scheduler="tcp://127.0.0.1:9"):
        pass


def test_a_point_that_no_joint_can_hold_is_a_row_with_its_proof(tmp_path: Path) -> None:
    study = read_study(
        written(tmp_path, f"base: {ROOT / 'configs/leaning_tower_20.yaml'}\nvary: {{alpha_deg: [5, 60]}}\n")
    )
    good, narrow = run_study(study, Inline()).rows
    assert good is not None and good["status"] == "holds" and good["curved_joints"] > 0
    assert narrow is not None and narrow["status"] == "narrow" and "leave '" in narrow["reason"]


def test_sections_may_not_be_set_twice(tmp_path: Path) -> None:
    study = read_study(
        written(tmp_path, f"base: {BASE}\nvary: {{joints: [{{inset: 0.1}}]}}\nset: {{joints.margin: 0.1}}")
    )
    with pytest.raises(InputError, match="as a whole"):
        study.config(study.points[0])


@pytest.mark.parametrize("path", sorted((ROOT / "configs" / "studies").glob("*.yaml")), ids=lambda p: p.stem)
def test_example_studies_can_be_read_and_their_first_point_computed(path: Path) -> None:
    study = read_study(path)
    for point in study.points:
        study.config(point)
    first = Study(
        name=study.name,
        base=study.base,
        vary={k: v[:1] for k, v in study.vary.items()},
        fixed=study.fixed,
        combine="grid",
        stages=study.stages,
    )
    (row,) = run_study(first, Inline()).rows
    assert row is not None and row["status"] == "holds", row


def test_load_cases_and_azimuths_are_the_same_on_an_executor() -> None:
    assembly = load(ROOT / "configs" / "leaning_tower_support_free.yaml").assembly
    with executor(2) as pool:
        there = verify(assembly, executor=pool)
        tilts = critical_tilts(there.graph, (0.0, np.pi), 0.2, pool)
    here = verify(assembly)
    assert [c.case.name for c in there.cases] == [c.case.name for c in here.cases]
    for mine, theirs in zip(here.cases, there.cases, strict=True):
        assert theirs.result.infeasibility == mine.result.infeasibility
        assert (theirs.result.forces == mine.result.forces).all() and theirs.moving == mine.moving
    assert tilts == tuple(critical_tilt(here.graph, a, 0.2) for a in (0.0, np.pi))


def test_physics_is_the_same_on_an_executor_and_a_store_resumes_it() -> None:
    from sim.questions import Questions
    from sim.simulate import simulate

    assembly = load(BASE).assembly
    asked = Questions(stages=("states", "tilt", "insertion"), directions=2, clearances=(0.0,), errors=(), threads=1)
    store = TrialStore()
    with executor(2) as pool:
        there = simulate(assembly, None, asked, store=store, executor=pool)
    here = simulate(assembly, None, asked)
    assert len(store) > 0
    assert (there.states, there.tilt, there.insertion) == (here.states, here.tilt, here.insertion)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except ProcessLookupError:
        return False
    except FileNotFoundError:  # no /proc here, or gone this moment
        return Path("/proc").is_dir() is False


@pytest.mark.skipif(os.name != "posix", reason="processes are adopted on POSIX only")
def test_processes_end_with_the_one_they_work_for_even_when_it_is_killed(tmp_path: Path) -> None:
    file = tmp_path / "killed.py"
    file.write_text("""if __name__ == "__main__":
    import os, time
    from mocca_robot.runtime.executors import LocalProcesses
    print(LocalProcesses(1).submit(os.getpid).result(), flush=True)
    time.sleep(60)
""")
    with subprocess.Popen([sys.executable, str(file)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        assert _runs(worker)
        parent.kill()
    for _ in range(200):
        if not _runs(worker):
            return
        time.sleep(0.1)
    pytest.fail(f"process {worker} outlived its parent by 20 s")
