"""Sweeps: what varies, which cases, the data set after any interruption, and bad ones told before anything runs."""

import gc
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.dataset
import pyarrow.parquet
import pytest

from stickslip.cli import main
from stickslip.errors import ConfigError, InputError, UnknownName
from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.model_file import write_model
from stickslip.model import Model
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.many import simd_batch
from stickslip.sweep import block, dataset, execute, numbers, summary
from stickslip.sweep.plan import load
from stickslip.sweep.sample import Drawn, Spread

SMALL = Path(__file__).with_name("small.toml")


@pytest.fixture(scope="module")
def small():
    return load(SMALL)


@pytest.fixture(scope="module")
def undisturbed(small, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    execute.run(small, folder, jobs=1)
    return table(folder)


def table(folder):
    found = pyarrow.dataset.dataset(
        folder / "data", partitioning="hive", exclude_invalid_files=True
    ).to_table()
    return found.sort_by([("controller", "ascending"), ("case", "ascending")])


# ---- cases -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["sobol", "latin"])
def test_blocks_are_parts_of_the_whole(method):
    drawn = Drawn(method, (Spread("a", 1.0, 2.0), Spread("b", 0.1, 10.0, logarithmic=True)), 600, 5)
    whole = drawn.block(0, 600)
    assert np.array_equal(whole[256:512], drawn.block(256, 512))
    assert whole.min(axis=0) == pytest.approx([1.0, 0.1], rel=0.03)
    assert whole.max(axis=0) == pytest.approx([2.0, 10.0], rel=0.03)
    # Even in the logarithm: half of the cases lie below 1.
    assert np.mean(whole[:, 1] < 1.0) == pytest.approx(0.5, abs=0.01)


def test_a_latin_hypercube_has_one_case_in_every_slice():
    drawn = Drawn("latin", (Spread("a", 0.0, 1.0), Spread("b", 0.0, 1.0)), 50, 1)
    for column in drawn.block(0, 50).T:
        assert sorted(np.floor(column * 50).astype(int)) == list(range(50))


def test_a_grid_has_every_point_with_every_other():
    drawn = Drawn("grid", (Spread("a", 1.0, 3.0, points=3), Spread("b", 0.0, 0.0, values=(5.0, 7.0))), 6, 1)
    assert drawn.block(0, 6).tolist() == [[1, 5], [1, 7], [2, 5], [2, 7], [3, 5], [3, 7]]
    assert drawn.block(4, 6).tolist() == [[3, 5], [3, 7]]


def test_a_nested_sweep_stays_within_the_level_that_it_drew():
    drawn = Drawn("sobol", (Spread("a", 0.7, 1.3), Spread("b", 0.7, 1.3)), 512, 1, nested=True)
    a, b, level = drawn.block(0, 512).T
    assert np.all(np.maximum(abs(a - 1.0), abs(b - 1.0)) <= 0.3 * level + 1e-12)
    assert np.mean(level < 0.25) == pytest.approx(0.25, abs=0.01)


def test_a_model_is_drawn_with_its_intervals_and_correlation():
    estimates = (
        Estimate("fs", "N·m", "F_S", 0.3, 0.03, 0.3 * np.exp(-0.196), 0.3 * np.exp(0.196), True),
        Estimate("inertia", "kg·m²", "J", 4e-4, 1e-5, 4e-4 * np.exp(-0.0196), 4e-4 * np.exp(0.0196), True),
    )
    drawn = Drawn("sobol", (), 4096, 1, estimates, ((1.0, 0.8), (0.8, 1.0)))
    assert drawn.names == ("friction.fs", "axis.inertia")
    logs = np.log(drawn.block(0, 4096) / [0.3, 4e-4])
    assert logs.std(axis=0) == pytest.approx([0.1, 0.01], rel=0.02)
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(0.8, abs=0.01)


def test_a_sweep_says_which_estimates_of_its_model_it_leaves_out(tmp_path, capsys):
    estimate = Estimate("fs", "N·m", "F_S", 0.335, 0.01, 0.32, 0.35, True)
    found = Identification(
        "commission",
        Model("gms", k=[1e4, 5e3], alpha=[0.5, 0.5], fs=0.335, fc=0.285, vs=0.01, delta_s=2.0, sigma2=0.018, c=24.0),
        (estimate, replace(estimate, name="breakaway.fs_positive")), np.eye(2), {},
    )  # fmt: skip
    write_model(tmp_path / "model.toml", found)
    (tmp_path / "study.toml").write_text(
        '[axis]\ninertia = 4e-4\n[friction.it]\nlaw = {model = "model.toml"}\n[references.s]\nkind = "sine"\n'
        "amplitude = 0.01\nfrequency = 4.0\nduration = 0.02\nplacement = {bandwidth_hz = 20.0, damping = 1.0}\n"
        '[controllers.PD]\nlinear = "PD"\n'
    )
    (tmp_path / "s.toml").write_text('study = "study.toml"\nmodel = "model.toml"\ncases = 2\ncheck = false\n')
    assert load(tmp_path / "s.toml").drawn.names == ("friction.fs",)
    assert main(["sweep", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--no-report"]) == 0
    assert (
        "not varied, as the model's law has no such parameters: breakaway.fs_positive"
        in capsys.readouterr().err
    )


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
    together = block.measured(run, values, small.metrics, 2).metrics
    alone = [block._alone(run, {name: float(v)}, small.metrics)[0] for v in values[name]]
    assert together == pytest.approx(np.array(alone), rel=2e-4)
    assert together[0] != pytest.approx(together[1], rel=1e-6)


def test_only_the_exact_integrator_is_made_wrong_in_two_ways(small, monkeypatch):
    ran = []
    monkeypatch.setattr(adaptive, "run", lambda case, run=adaptive.run: ran.append(1) or run(case))
    planned = replace(small.runs[0], duration=0.05)
    planned = replace(planned, numerics=replace(planned.numerics, integrator="adaptive", tolerance=1e-6))
    values = {"friction.fs": np.array([0.3])}
    found = block.measured(planned, values, small.metrics, 1)
    sure, flagged = block.checked(planned, values, small.metrics, found)
    assert sure.integrators == ["adaptive"]
    assert not flagged.any()
    assert len(ran) == 2  # as it is, and looser


def test_a_case_out_of_bounds_is_a_failure_of_its_own(small):
    found, why, _ = block.measured(small.runs[0], {"friction.fs": np.array([0.3, -0.1])}, small.metrics, 2)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
    assert why[0] == ""
    assert "must be greater than 0" in why[1]


@pytest.mark.parametrize("integrator", ["exact", "adaptive", "fixed"])
def test_every_integrator_is_held_against_a_worse_run(small, integrator):
    run = replace(small.runs[0], duration=0.1)
    run = replace(run, numerics=replace(run.numerics, integrator=integrator, output=0.1, tolerance=1e-6))
    one, worse = (
        block._alone(run, {"friction.fs": 0.35}, ["position_rms_rad"], perturbation)[0][0]
        for perturbation in (0.0, 2.0)
    )
    assert one != worse  # else nothing would ever be flagged
    assert one == pytest.approx(worse, rel=1e-2)


def test_metrics_differ_beyond_one_per_cent():
    one = np.array([[1e-3, 5.0], [1e-3, 5.0], [1e-3, np.nan], [1e-10, 5.0]])
    other = np.array([[1.02e-3, 5.0], [1.005e-3, 5.0], [1e-3, 5.0], [2e-10, 5.0]])
    names = ("position_rms_rad", "reversals_per_s")
    assert block.differ(one, other, names).tolist() == [True, False, True, False]


# ---- the data set ------------------------------------------------------------------------------------------


def test_the_data_set_holds_every_case_once(undisturbed, small):
    assert undisturbed.num_rows == 2 * 600
    assert undisturbed["case"].to_pylist() == 2 * list(range(600))
    drawn = small.drawn.block(0, 600)
    assert np.array_equal(undisturbed["friction.fs"].to_numpy()[:600], drawn[:, 0])
    assert not any(undisturbed["failure"].to_pylist())
    assert sum(undisturbed["flagged"].to_pylist()) == 0


def test_what_is_missing_or_damaged_is_run_again(small, undisturbed, tmp_path):
    execute.run(small, tmp_path, jobs=2)
    parts = sorted((tmp_path / "data").rglob("*.parquet"))
    kept = parts[1].stat().st_mtime_ns
    parts[0].unlink()
    parts[2].write_bytes(parts[2].read_bytes()[:500])
    parts[3].with_name("part-000000.99.part").write_bytes(b"half")
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
            InputError, match=r"holds finished blocks of another sweep .*; .*--out, or delete"
        ):
            execute.run(other, tmp_path)
    assert table(tmp_path).equals(before)


def test_progress_begins_with_what_was_found_and_that_is_said(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=10))
    told, said = [], []
    execute.run(few, tmp_path, progress=lambda *now: told.append(now), say=said.append)
    assert told == [(0, 20), (10, 20), (20, 20)]
    assert said == []
    next(tmp_path.rglob("part-000000.parquet")).unlink()
    told.clear()
    execute.run(few, tmp_path, progress=lambda *now: told.append(now), say=said.append)
    assert told == [(10, 20), (20, 20)]
    execute.run(few, tmp_path, say=said.append)
    assert said == ["1 of 2 blocks were already done; going on", "2 of 2 blocks were already done"]


def test_fewer_cases_do_not_overwrite_an_interrupted_sweep(tmp_path, capsys):
    command = ["sweep", str(SMALL), "--out", str(tmp_path), "--no-report", "--cases"]
    assert main([*command, "9"]) == 0
    (tmp_path / "manifest.json").unlink()  # as an interruption leaves it
    assert main([*command, "8"]) == 2
    assert "finished blocks of another sweep (2, such as data/" in capsys.readouterr().err
    assert table(tmp_path).num_rows == 2 * 9


def test_blocks_of_a_larger_sweep_are_not_taken_for_its_own(small, tmp_path):
    few = replace(small, drawn=replace(small.drawn, cases=10))
    execute.run(few, tmp_path)
    part = next(tmp_path.rglob("part-000000.parquet"))
    part.with_name("part-000001.parquet").write_bytes(part.read_bytes())  # of a sweep with more cases
    with pytest.raises(InputError, match=r"another sweep \(1, such as .*part-000001.parquet\)"):
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


def test_a_scheduler_that_is_not_there(small, tmp_path):
    pytest.importorskip("distributed")
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
    while process.poll() is None and not list(tmp_path.rglob("*.parquet")):
        time.sleep(0.01)
    before = len(list(tmp_path.rglob("*.parquet")))
    os.killpg(process.pid, signal.SIGINT)  # As Ctrl-C does: to every process of the terminal's foreground.
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "finishing the running cases" in said
    assert "Traceback" not in said
    kept = list(tmp_path.rglob("*.parquet"))
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
    part = next((tmp_path / "data").rglob("*controller=PD/*.parquet"))
    table = pyarrow.parquet.read_table(part)
    column = table.schema.get_field_index("position_rms_rad")
    off = table["position_rms_rad"].to_pylist()
    off[7] *= 1.0 + 1e-12
    pyarrow.parquet.write_table(table.set_column(column, "position_rms_rad", pyarrow.array(off)), part)
    assert main(["rerun", str(tmp_path)]) == 1
    assert "PD case 7 position_rms_rad" in capsys.readouterr().out
    part.unlink()
    assert main(["rerun", str(tmp_path)]) == 2
    assert "0 of 30 cases" in capsys.readouterr().err


# ---- bad sweeps --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("scale = [0.8, 1.2]", "scale = [1.2, 0.8]", "is empty; give .low, high."),
        ("scale = [0.8, 1.2]", "scale = [1.2, 1.2]", "is empty"),
        ("scale = [0.8, 1.2]", "scale = []", r"scale = \[\] must be two numbers, \[low, high\]"),
        ("scale = [0.8, 1.2]", "scale = 1.2", r"scale = 1.2 must be two numbers"),
        ("scale = [0.8, 1.2]", "scale = [1, 2, 3]", r"scale = \[1, 2, 3\] must be two numbers"),
        ("scale = [0.8, 1.2]", "scale = [-0.8, 1.2]", "at the end of a range: .* must be greater than 0"),
        ("scale = [0.8, 1.2]", "scale = [0.8, 1.2]\nrange = [1, 2]", "give one of scale"),
        ("scale = [0.8, 1.2]", "values = [0.8, 1.2]", "belongs to a grid"),
        ("scale = [0.8, 1.2]", "scal = [0.8, 1.2]", "give one of scale"),
        ("scale = [0.8, 1.2]", 'scale = ["a", 1.2]', "must be a number"),
        (
            'friction.fs"]\nscale = [0.8',
            'controller.gain"]\nrange = [-0.8',
            "end of a range: .*gain = -0.8 must be at",
        ),
        ('"position_rms_rad"', '"position_rms"', "did you mean"),
        ("friction.fs", "friction.fss", "no run has a number"),
        ("cases = 600", "cases = 0", "at least 1"),
        ("cases = 600", "cases = 2.5", "whole number"),
        ("cases = 600", "cases = 1e12", "too many"),
        ("cases = 600", 'cases = 600\nmethod = "random"', "is not known"),
        ("cases = 600", 'method = "grid"', "points"),
        ("../data/small_study.toml", "nowhere.toml", "no file"),
        ('"PD", "FF-lugre"', '"PDD"', "is not known"),
    ],
)
def test_bad_sweeps_are_told(tmp_path, old, new, message):
    text = SMALL.read_text().replace("../data", str(SMALL.parents[1] / "data"))
    assert old in text or old.startswith("..")
    text = text.replace(old.replace("../data", str(SMALL.parents[1] / "data")), new)
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        load(path)


def test_cases_of_a_grid_are_its_points(tmp_path, capsys):
    text = SMALL.read_text().replace("../data", (SMALL.parents[1] / "data").as_posix())
    text = text.replace("cases = 600", 'method = "grid"')
    path = tmp_path / "grid.toml"
    path.write_text(re.sub(r"(scale|range) = .*", r"\g<0>\npoints = 3", text))
    assert main(["sweep", str(path), "--cases", "7"]) == 2
    assert "--cases 7: " in (said := capsys.readouterr().err)
    assert "is a grid, whose points make its 9 cases; change `points` or `values`" in said
    assert main(["sweep", str(SMALL), "--cases", "0"]) == 2
    assert "--cases 0 must be at least 1" in capsys.readouterr().err


def test_a_model_of_another_law_than_the_studys_is_told(tmp_path):
    estimate = Estimate("fc", "N·m", "F_C", 0.285, 0.01, 0.27, 0.30, True)
    model = Model("coulomb", fc=0.285, sigma2=0.02)
    write_model(tmp_path / "model.toml", Identification("axis", model, (estimate,), np.eye(1), {}))
    study = (SMALL.parents[1] / "data" / "small_study.toml").as_posix()
    for more in ("", '[tune."controller.gain"]\nrange = [0.5, 1.0]\n'):
        (tmp_path / "s.toml").write_text(
            f'study = "{study}"\nonly = ["FF-lugre", "nominal"]\nmodel = "model.toml"\ncases = 2\n{more}'
        )
        with pytest.raises(
            ConfigError, match="holds law coulomb, and the friction of the runs is of law gms"
        ):
            load(tmp_path / "s.toml")


@pytest.mark.parametrize("jobs", ["0", "-1"])
def test_no_jobs_are_refused(tmp_path, capsys, jobs):
    out = tmp_path / "out"
    assert main(["sweep", str(SMALL), "--jobs", jobs, "--out", str(out)]) == 2
    assert f"--jobs {jobs} must be at least 1; leave it out for one block per core" in capsys.readouterr().err
    assert not out.exists()
    assert main(["rerun", str(tmp_path), "--jobs", jobs]) == 2
    assert f"--jobs {jobs} must be at least 1" in capsys.readouterr().err


def test_more_cases_than_the_disk_has_room_for(small, tmp_path):
    huge = replace(small, drawn=replace(small.drawn, cases=10**12))
    with pytest.raises(InputError, match="GB free"):
        dataset.room_for(tmp_path, huge)


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_block_in_hand_is_kept_when_it_is_interrupted(small, tmp_path, monkeypatch, jobs):
    begun = []
    monkeypatch.setattr(execute, "compute", lambda *task: begun.append(task) or block.compute(*task))
    with pytest.raises(KeyboardInterrupt):
        execute.run(
            small, tmp_path, jobs=jobs, progress=lambda done, of: done and signal.raise_signal(signal.SIGINT)
            if len(list(tmp_path.rglob("*.parquet"))) == 1 else None,
        )  # fmt: skip
    assert len(begun) == 1 or jobs > 1
    assert len(list(tmp_path.rglob("*.parquet"))) == len(begun)


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


# ---- lanes ---------------------------------------------------------------------------------------------------


def in_lanes(tmp_path, more=""):
    """The small sweep in lanes, of few cases."""
    text = SMALL.read_text().replace("../data", (SMALL.parents[1] / "data").as_posix())
    text = text.replace("cases = 600", f'cases = 12\nintegrator = "lanes"\n{more}')
    path = tmp_path / "simd_batch.toml"
    path.write_text(text)
    return path


def test_lanes_are_within_a_percent_or_flagged(tmp_path):
    sweep = load(in_lanes(tmp_path))
    assert sweep.step == 1e-4
    for run in range(len(sweep.runs)):
        exact = block.compute(replace(sweep, step=0.0), run, 0)
        for step, most in ((1e-4, 0.3), (5e-3, 1.0)):
            fast = block.compute(replace(sweep, step=step), run, 0)
            assert not any(fast.failures)
            assert np.all(fast.flagged | ~block.differ(exact.metrics, fast.metrics, sweep.metrics))
            assert np.mean(fast.flagged) <= most
            assert not np.array_equal(fast.metrics, exact.metrics)
        assert fast.flagged.any()  # of steps as long as 5 ms
    assert sweep.fingerprint(0) != replace(sweep, step=0.0).fingerprint(0)


def test_a_step_with_more_switches_than_were_followed_is_flagged(tmp_path, monkeypatch):
    sweep = load(in_lanes(tmp_path, "check = false"))
    assert not block.compute(sweep, 0, 0).flagged.any()

    def run(many, *args, run=simd_batch.Lanes.run, **more):
        return replace(run(many, *args, **more), unresolved=np.arange(12) % 3)

    monkeypatch.setattr(simd_batch.Lanes, "run", run)
    assert block.compute(sweep, 0, 0).flagged.tolist() == [False, True, True] * 4


def test_a_run_that_lanes_refuse_is_told_of(tmp_path, capsys):
    path, data = in_lanes(tmp_path), SMALL.parents[1] / "data"
    study = (data / "small_study.toml").read_text().replace("motion.csv", (data / "motion.csv").as_posix())
    (tmp_path / "study.toml").write_text(study.replace('"signed"', '"literal"'))
    path.write_text(re.sub("study = .*", 'study = "study.toml"', path.read_text()))
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "--no-report"]) == 0
    told = capsys.readouterr().err
    assert "FF-lugre: integrator exact, not in lanes: no lanes: slip rule 'literal' needs its events" in told
    run = json.loads((tmp_path / "out" / "manifest.json").read_text())["runs"][0]
    assert run["integrator"] == "exact"
    assert "needs its events" in run["because"]
    assert set(table(tmp_path / "out")["integrator"].to_pylist()) == {"exact"}


def test_a_missing_gpu_is_told_before_anything_runs(tmp_path, capsys):
    path = in_lanes(tmp_path, 'device = "gpu"')
    assert load(path).device == "gpu"  # Reading needs none: another machine may run it.
    assert main(["sweep", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "looked for NVIDIA's driver" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_lanes_do_not_measure_is_told(tmp_path):
    path = in_lanes(tmp_path)
    path.write_text(path.read_text().replace('"velocity_rms_rad_s"]', '"standstills"]'))
    with pytest.raises(ConfigError, match="'standstills', which lanes do not measure"):
        load(path)
