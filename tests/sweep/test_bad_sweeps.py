"""Bad sweeps: told before anything runs."""

import pickle
import re

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import ConfigError, InputError, LawError
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.model_file import write_model
from stickslip.models.model import Model
from stickslip.sweeps import execute
from stickslip.sweeps.plan import load
from support.sweeps import SMALL


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("scale = [0.8, 1.2]", "scale = [1.2, 0.8]", "is empty; give .low, high."),
        ("scale = [0.8, 1.2]", "scale = [1.2, 1.2]", "is empty"),
        (
            '"velocity_rms_rad_s"]',
            '"velocity_rms"]',
            "metrics: 'velocity_rms' is not known; did you mean 'velocity_rms_rad_s'",
        ),
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


class Unreadable:
    """What raises when it is unpacked."""

    def __init__(self, error):
        self.error = error

    def __reduce__(self):
        return _raised, (self.error,)


def _raised(error):
    raise error


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (LawError("x.py cannot be imported: no module"), "cannot read the sweep: x.py cannot be imported"),
        (
            NotImplementedError("PosixPath"),
            "the same version of stickslip there, under the same operating system",
        ),
        (ValueError("parts"), "would compute other numbers: install the same version"),
    ],
)
def test_a_worker_says_why_it_cannot_read_a_sweep(error, said):
    with pytest.raises(InputError, match=rf"^a worker on .* {said}"):
        execute.Parcel(pickle.dumps(Unreadable(error)), ()).load()
