"""Sweeps: what varies, which cases, the data set after any interruption, and bad ones told before anything runs."""

import gc
import importlib.util
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError, UnknownName
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.sampled import engine as sampled
from stickslip.sweeps import block, dataset, execute, forecast, measured, metric_check, numbers, summary
from stickslip.sweeps.plan import load
from support.sweeps import SMALL, table


@pytest.fixture(scope="module")
def small():
    return replace(load(SMALL), sizes=(256, 256))


@pytest.fixture(scope="module")
def undisturbed(small, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    execute.run(small, folder, jobs=1)
    return table(folder)


# ---- numbers -----------------------------------------------------------------------------------------------


def test_numbers_of_a_run_are_read_and_varied(small):
    run = small.runs[1]
    assert numbers.value_of(run, "friction.k[1]") == 5e3
    changed = numbers.varied(
        run, {"friction.k[1]": 6e3, "law.fs": 0.4, "controller.gain": 0.7, "axis.inertia": 5e-4,
              "controller.bandwidth_hz": 20.0, "reference.amplitude": 0.02},
    )  # fmt: skip
    assert changed.axis.friction.parameters.k == (1e4, 6e3)
    assert changed.control.compensator.model.parameters.fs == 0.4
    assert changed.control.compensator.gain == 0.7
    assert changed.motion.parameters.amplitude == 0.02
    kind, bandwidth, damping = numbers.poles(changed.control.gains, run.axis.inertia)
    assert (kind, bandwidth, damping) == ("PD", pytest.approx(20.0), pytest.approx(1.0))
    # The machine varies under the controller as it was designed.
    only = numbers.varied(run, {"axis.inertia": 5e-4})
    assert only.control.gains == run.control.gains
    with pytest.raises(UnknownName, match="fss"):
        numbers.value_of(run, "friction.fss")


@pytest.mark.parametrize(
    "name", ["friction.fc", "friction.k[0]", "axis.inertia", "controller.kd", "controller.damping"]
)
def test_a_batch_gives_what_the_loops_give_alone(small, name):
    run = small.runs[1]
    values = {name: numbers.value_of(run, name) * np.array([0.9, 1.1])}
    together = measured.measured(run, values, small.metrics, 2).metrics
    alone = [measured._alone(run, {name: float(v)}, small.metrics)[0] for v in values[name]]
    assert together == pytest.approx(np.array(alone), rel=2e-4)
    assert together[0] != pytest.approx(together[1], rel=1e-6)


def test_only_the_exact_integrator_is_made_wrong_in_two_ways(small, monkeypatch):
    ran = []
    monkeypatch.setattr(adaptive, "run", lambda case, run=adaptive.run: ran.append(1) or run(case))
    planned = replace(small.runs[0], duration=0.05)
    planned = replace(planned, numerics=replace(planned.numerics, integrator="adaptive", tolerance=1e-6))
    values = {"friction.fs": np.array([0.3])}
    found = measured.measured(planned, values, small.metrics, 1)
    sure, flagged = metric_check.checked(planned, values, small.metrics, found)
    assert sure.integrators == ["adaptive"]
    assert not flagged.any()
    assert len(ran) == 2  # as it is, and looser


def test_a_case_out_of_bounds_is_a_failure_of_its_own(small):
    found, why, _ = measured.measured(small.runs[0], {"friction.fs": np.array([0.3, -0.1])}, small.metrics, 2)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
    assert why[0] == ""
    assert "must be greater than 0" in why[1]


@pytest.mark.parametrize("integrator", ["exact", "adaptive", "fixed"])
def test_every_integrator_is_held_against_a_worse_run(small, integrator):
    run = replace(small.runs[0], duration=0.1)
    run = replace(run, numerics=replace(run.numerics, integrator=integrator, output=0.1, tolerance=1e-6))
    one, worse = (
        measured._alone(run, {"friction.fs": 0.35}, ["position_rms_rad"], perturbation)[0][0]
        for perturbation in (0.0, 2.0)
    )
    assert one != worse  # else nothing would ever be flagged
    assert one == pytest.approx(worse, rel=1e-2)


def test_metrics_differ_beyond_one_per_cent():
    one = np.array([[1e-3, 5.0], [1e-3, 5.0], [1e-3, np.nan], [1e-10, 5.0]])
    other = np.array([[1.02e-3, 5.0], [1.005e-3, 5.0], [1e-3, 5.0], [2e-10, 5.0]])
    names = ("position_rms_rad", "reversals_per_s")
    assert metric_check.differ(one, other, names).tolist() == [True, False, True, False]


# ---- the data set ------------------------------------------------------------------------------------------


def test_the_data_set_holds_every_case_once(undisturbed, small):
    assert len(undisturbed) == 2 * 600
    assert undisturbed["case"].to_list() == 2 * list(range(600))
    drawn = small.drawn.block(0, 600)
    assert np.array_equal(undisturbed["friction.fs"].to_numpy()[:600], drawn[:, 0])
    assert not any(undisturbed["failure"])
    assert sum(undisturbed["flagged"]) == 0


def test_a_table_of_all_cases_where_pyarrow_is_installed(small, tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet")
    few = replace(small, drawn=replace(small.drawn, cases=10))
    execute.run(few, tmp_path)
    cases = parquet.read_table(tmp_path / "cases.parquet").to_pylist()
    whole = table(tmp_path)
    assert [c["controller"] for c in cases] == [r.controller for r in few.runs for _ in range(10)]
    for name in ("friction.fs", "position_rms_rad", "flagged", "failure", "integrator"):
        found = {(c["controller"], c["case"]): c[name] for c in cases}
        assert found == {(w["controller"], w["case"]): w[name] for w in whole.to_dict("records")}
    # Without it the sweep is the same, and no older table stays.
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    execute.run(few, tmp_path)
    assert not (tmp_path / "cases.parquet").exists()
    assert table(tmp_path).equals(whole)


def test_what_is_missing_or_damaged_is_run_again(small, undisturbed, tmp_path):
    execute.run(small, tmp_path, jobs=2)
    parts = sorted((tmp_path / "data").rglob("*.npz"))
    kept = parts[1].stat().st_mtime_ns
    parts[0].unlink()
    parts[2].write_bytes(parts[2].read_bytes()[:500])
    parts[3].with_name(".stickslip-0123.part").write_bytes(b"half")
    manifest = execute.run(small, tmp_path, jobs=2)
    assert manifest["timings"]["blocks_computed"] == 2
    assert parts[1].stat().st_mtime_ns == kept
    assert not list(tmp_path.rglob("*.part"))
    assert table(tmp_path).equals(undisturbed)


def test_finished_blocks_of_another_sweep_are_not_lost(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=10))
    assert execute.run(few, tmp_path)["timings"]["blocks_computed"] == 2
    assert execute.run(few, tmp_path)["timings"]["blocks_computed"] == 0
    before = table(tmp_path)
    for other in (
        replace(few, drawn=replace(few.drawn, seed=4)),
        replace(few, drawn=replace(few.drawn, cases=9)),
        replace(few, metrics=few.metrics[:1]),
        replace(few, runs=few.runs[::-1][:1], check=False),
    ):
        with pytest.raises(
            InputError, match=r"holds finished blocks of another sweep .*; .*choose another place, or delete"
        ):
            execute.run(other, tmp_path)
    assert table(tmp_path).equals(before)


def test_progress_begins_with_what_was_found_and_that_is_said(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=10))
    told, said = [], []
    execute.run(few, tmp_path, progress=lambda *now: told.append(now), say=said.append)
    assert told == [(0, 20), (10, 20), (20, 20)]
    assert said == []
    next(tmp_path.rglob("part-000000.npz")).unlink()
    told.clear()
    execute.run(few, tmp_path, progress=lambda *now: told.append(now), say=said.append)
    assert told == [(10, 20), (20, 20)]
    execute.run(few, tmp_path, say=said.append)
    assert said == ["1 of 2 blocks were already done; going on", "2 of 2 blocks were already done"]


def test_a_block_takes_some_seconds_and_a_resumed_sweep_keeps_its_size(small, tmp_path, monkeypatch):
    assert forecast.block_size(0.001) == 256
    assert forecast.block_size(0.1) == 32
    assert forecast.block_size(60.0) == 1
    few = replace(small, drawn=replace(small.drawn, cases=10), sizes=())
    monkeypatch.setattr(execute, "size_timed", lambda sweep, run: 4)
    assert execute.run(few, tmp_path)["timings"]["blocks_computed"] == 2 * 3
    whole = table(tmp_path)
    assert whole["case"].to_list() == 2 * list(range(10))
    next(tmp_path.rglob("*controller=PD/part-000001.npz")).unlink()
    # A busier machine would choose others now.
    monkeypatch.setattr(execute, "size_timed", lambda sweep, run: 2)
    assert execute.run(few, tmp_path)["timings"]["blocks_computed"] == 1
    assert table(tmp_path).equals(whole)
    assert dataset.read(tmp_path, few, few.runs[0], ["flagged"])["flagged"].size == 10


def test_what_flagged_means_is_said_in_the_table_and_in_the_file(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=3))
    execute.run(few, tmp_path)
    rows = summary.summarise(tmp_path, few)
    assert "changes by more than 0.1 %" in rows[0]["flagged_means"]
    assert summary.summary_lines(rows, "position_rms_rad")[-1] == f"flagged: {rows[0]['flagged_means']}"
    assert "every case was run again" in summary.write_summary(tmp_path, few, rows).read_text()
    assert "check = false" in summary.meaning_of_flags(replace(few, check=False))


def test_a_sampled_case_that_is_sure_is_what_simulate_gives(small, monkeypatch):
    ran = []
    monkeypatch.setattr(sampled, "run", lambda case, run=sampled.run: ran.append(1) or run(case))
    run = small.runs[0]
    control = replace(run.control, sample_time=1e-3, encoder_counts=65536.0)
    planned = replace(run, control=control, duration=0.3, numerics=replace(run.numerics, output=0.3))
    values = {"friction.fs": np.array([0.3, 0.35])}
    found = measured.measured(planned, values, small.metrics, 2)
    sure, flagged = metric_check.checked(planned, values, small.metrics, found)
    assert sure.integrators == ["sampled", "sampled"]
    assert (
        len(ran) == 4 + flagged.sum()
    )  # at the tolerance, at a hundredth, and at 1e-10 rad where those differ
    case = numbers.varied(planned, {"friction.fs": 0.3})
    alone = ss.simulate(case.axis, case.control, case.motion, 0.3, slip_rule=case.rule)
    assert sure.metrics[0, 0] == pytest.approx(alone.meta["metrics"][small.metrics[0]], rel=2e-4)


def test_fewer_cases_do_not_overwrite_an_interrupted_sweep(tmp_path, capsys):
    command = ["sweep", str(SMALL), "--out", str(tmp_path), "--no-report", "--cases"]
    assert main([*command, "9"]) == 0
    (tmp_path / "manifest.json").unlink()  # as an interruption leaves it
    assert main([*command, "8"]) == 2
    assert "finished blocks of another sweep (2, such as data/" in capsys.readouterr().err
    assert len(table(tmp_path)) == 2 * 9


def test_blocks_of_a_larger_sweep_are_not_taken_for_its_own(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=10))
    execute.run(few, tmp_path)
    part = next(tmp_path.rglob("part-000000.npz"))
    part.with_name("part-000001.npz").write_bytes(part.read_bytes())  # of a sweep with more cases
    with pytest.raises(InputError, match=r"another sweep \(1, such as .*part-000001.npz\)"):
        execute.run(few, tmp_path)


@pytest.mark.slow
def test_processes_give_the_same_numbers(small, undisturbed, tmp_path):
    execute.run(small, tmp_path, jobs=2, backend="processes")
    assert table(tmp_path).equals(undisturbed)


@pytest.mark.slow
def test_a_cluster_gives_the_same_numbers(small, undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed")
    local = {"host": "127.0.0.1", "dashboard_address": None, "local_directory": str(tmp_path / "dask")}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **local) as cluster:
        execute.run(small, tmp_path / "out", scheduler=cluster.scheduler_address)
    assert table(tmp_path / "out").equals(undisturbed)


@pytest.mark.slow
@pytest.mark.parametrize("address", ["nonsense", "tcp://host", "http//host:1", "host:port"])
def test_an_address_that_is_none_is_refused_at_once(small, tmp_path, address):
    begun = time.monotonic()
    with pytest.raises(
        InputError, match=r"is no address of a Dask scheduler; give one such as tcp://host:8786"
    ):
        execute.run(small, tmp_path / "out", scheduler=address)
    assert time.monotonic() - begun < 20.0  # a scheduler that does not answer is waited for longer
    assert not (tmp_path / "out").exists()


def test_a_scheduler_that_is_not_there(small, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(execute, "PATIENCE", 1.0)
    with pytest.raises(InputError, match="no Dask scheduler at"):
        execute.run(small, tmp_path, scheduler="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_killed_at_random_times_it_goes_on(small, undisturbed, tmp_path):
    command = [
        sys.executable,
        "-m",
        "stickslip",
        "sweep",
        str(SMALL),
        "--out",
        str(tmp_path),
        "--no-report",
        "--jobs",
        "2",
    ]
    rng = np.random.default_rng(2)
    for _ in range(4):
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=Path(__file__).parents[2]
        )
        time.sleep(rng.uniform(0.6, 2.5))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    execute.run(small, tmp_path)
    assert table(tmp_path).equals(undisturbed)


def test_what_was_changed_travels_too(small):
    changed = replace(small, drawn=replace(small.drawn, cases=300, seed=4), metrics=small.metrics[:1])
    there = execute.Parcel.of(changed).load()
    assert (there.drawn, there.metrics) == (changed.drawn, changed.metrics)
    with pytest.raises(InputError, match="would compute other numbers: install the same version"):
        replace(execute.Parcel.of(changed), fingerprints=("other", "ones")).load()


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of a terminal")
def test_an_interruption_from_the_terminal_reaches_processes_too_and_drops_nothing(tmp_path):
    command = [sys.executable, "-m", "stickslip", "sweep", str(SMALL), "--out", str(tmp_path), "--no-report"]
    process = subprocess.Popen(
        [*command, "--cases", "6000", "--processes", "--jobs", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, cwd=Path(__file__).parents[2], start_new_session=True,
    )  # fmt: skip
    while process.poll() is None and not list(tmp_path.rglob("*.npz")):
        time.sleep(0.01)
    before = len(list(tmp_path.rglob("*.npz")))
    os.killpg(process.pid, signal.SIGINT)  # As Ctrl-C does: to every process of the terminal's foreground.
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "finishing the running cases" in said
    assert "Traceback" not in said
    kept = list(tmp_path.rglob("*.npz"))
    assert len(kept) > before  # What the processes had in hand.
    assert all(dataset.fingerprint_of(path) for path in kept)


def test_percentiles_and_shares(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=40))
    execute.run(few, tmp_path)
    row = summary.summarise(tmp_path, few)[0]
    values = dataset.read(tmp_path, few, few.runs[0], ["position_rms_rad"])["position_rms_rad"]
    assert row["position_rms_rad_p95"] == np.percentile(values, 95)
    assert row["cases"] == 40


def test_a_sweep_is_run_again_from_its_manifest(tmp_path, capsys):
    assert main(["sweep", str(SMALL), "--out", str(tmp_path), "--cases", "30", "--no-report"]) == 0
    assert main(["rerun", str(tmp_path)]) == 0
    assert main(["rerun", str(tmp_path / "manifest.json")]) == 0
    assert "60 cases, " in capsys.readouterr().out
    part = next((tmp_path / "data").rglob("*controller=PD/*.npz"))
    with np.load(part) as data:
        columns = dict(data)
    columns["position_rms_rad"][7] *= 1.0 + 1e-12
    np.savez(part, **columns)
    assert main(["rerun", str(tmp_path)]) == 1
    assert "PD case 7 position_rms_rad" in capsys.readouterr().out
    part.unlink()
    assert main(["rerun", str(tmp_path)]) == 2
    assert "0 of 30 cases" in capsys.readouterr().err


# ---- interruptions and the command ---------------------------------------------------------------------------


def test_more_cases_than_the_disk_has_room_for(small, tmp_path):
    huge = replace(small, drawn=replace(small.drawn, cases=10**12))
    with pytest.raises(InputError, match="GB free"):
        dataset.room_for(tmp_path, huge)


@pytest.mark.parametrize(
    ("jobs", "how"), [(1, signal.SIGINT), (2, signal.SIGINT), (1, signal.SIGTERM)], ids=["1", "2", "SIGTERM"]
)
def test_every_block_in_hand_is_kept_when_it_is_interrupted(small, tmp_path, monkeypatch, jobs, how):
    begun = []
    monkeypatch.setattr(execute, "compute", lambda *task: begun.append(task) or block.compute(*task))
    with pytest.raises(KeyboardInterrupt):
        execute.run(
            small, tmp_path, jobs=jobs, progress=lambda done, of: done and signal.raise_signal(how)
            if len(list(tmp_path.rglob("*.npz"))) == 1 else None,
        )  # fmt: skip
    assert len(begun) == 1 or jobs > 1
    assert len(list(tmp_path.rglob("*.npz"))) == len(begun)


def test_an_interrupted_sweep_gives_none_of_joblibs_advice(small, recwarn):
    blocks = execute.computed(small, small.blocks, jobs=2)
    next(blocks)
    blocks.close()
    gc.collect()
    assert [str(w.message) for w in recwarn if "tasks" in str(w.message)] == []


def test_the_command_prints_and_draws(tmp_path, capsys):
    command = ["sweep", str(SMALL), "--out", str(tmp_path), "--cases", "60", "--jobs", "2"]
    assert main(command) == 0
    for name in ("tornado-of-a-run-that-was.png", "my-own.png"):
        (tmp_path / "figures" / name).write_bytes(b"")
    capsys.readouterr()
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "signed/sine/nominal/FF-lugre" in out
    assert (tmp_path / "figures" / "percentiles-signed-sine-nominal.png").exists()
    assert (
        (tmp_path / "summary.csv")
        .read_text()
        .startswith("slip_rule,reference,friction,controller,cases,flagged")
    )
    assert not (tmp_path / "figures" / "tornado-of-a-run-that-was.png").exists()
    assert (tmp_path / "figures" / "my-own.png").exists()
    assert main(["sweep", "no-such-sweep"]) == 2
