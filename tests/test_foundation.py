"""Models, records, controllers, errors, public names: the parts everything stands on."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stickslip
from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, pd, place
from stickslip.core import errors
from stickslip.core.errors import InputError, ParameterError, UnknownName
from stickslip.core.record import Record
from stickslip.laws.gms import LAW as GMS
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model


def test_every_public_name_loads():
    for name in stickslip.__all__:
        assert getattr(stickslip, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = stickslip.nothing


def test_import_of_the_package_is_light():
    code = "import stickslip, sys; print([m for m in ('numba', 'scipy', 'pandas', 'matplotlib') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_error_tree_is_the_one_drawn():
    for name in errors.__all__:
        assert name == "suggestion" or name in (errors.__doc__ or ""), name
    for name in ("ParameterError", "UnknownName", "ConfigError", "LawError"):
        assert issubclass(getattr(errors, name), InputError)


# ---- pole placement: the thesis prints the gains (Tables 6 and 7) ---------------------------------------------


@pytest.mark.parametrize(
    ("kind", "bandwidth", "damping", "kp", "ki", "kd"),
    [
        ("PD", 36.0, 1.0, 19.7612, 0.0, 0.1747),
        ("PID", 36.0, 1.0, 59.2836, 4469.9, 0.2621),
        ("PD", 10.0, 0.85, 1.5248, 0.0, 0.0413),
        ("PID", 10.0, 0.85, 4.1169, 95.8049, 0.0655),
        ("PD", 35.0, 0.9, 18.6786, 0.0, 0.1529),
        ("PID", 35.0, 0.9, 52.3001, 4107.6, 0.2378),
    ],
)
def test_gains_of_the_thesis(kind, bandwidth, damping, kp, ki, kd):
    gains = place(kind, 3.8623e-4, bandwidth, damping)
    # The thesis prints kd to 4 decimals, and its kp and ki belong to an inertia with one digit more.
    assert gains.kp == pytest.approx(kp, rel=2e-5)
    assert gains.ki == pytest.approx(ki, rel=2e-5)
    assert gains.kd == pytest.approx(kd, abs=6e-5)
    assert gains.kr == gains.kd


def test_pr_leaves_the_reference_velocity_out():
    assert place("PR", 1e-3, 10.0, 1.0) == place("PD", 1e-3, 10.0, 1.0)._replace(kr=0.0)


def test_poles_lie_where_they_were_placed():
    inertia, w, zeta = 2e-3, 2 * math.pi * 12.0, 0.7
    g = place("PID", inertia, 12.0, zeta)
    poles = np.roots([inertia, g.kd, g.kp, g.ki])
    wanted = np.append(np.roots([1, 2 * zeta * w, w * w]), -w)
    assert np.sort_complex(poles) == pytest.approx(np.sort_complex(wanted))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: RigidAxis(-1.0, Model("coulomb", fc=1.0)), "inertia = -1"),
        (lambda: RigidAxis(math.nan, Model("coulomb", fc=1.0)), "inertia = nan"),
        (lambda: place("PDD", 1.0, 1.0, 1.0), "unknown kind 'PDD'"),
        (lambda: place("PD", 1.0, 0.0, 1.0), "bandwidth = 0"),
        (lambda: Controller(pd(1.0, 1.0), torque_limit=0.0), "torque_limit = 0"),
        (lambda: Controller(Gains(kp=-1.0)), "kp = -1"),
        (lambda: Controller(pd(1.0, 1.0), encoder_counts=100), "sample_time"),
        (lambda: Feedback(Model("coulomb", fc=1.0), filter_hz=-1.0), "filter_hz = -1"),
        (lambda: Feedback(Model("coulomb", fc=1.0), gain=math.inf), "gain = inf"),
        (lambda: Model("gms", **{**GMS.example, "alpha": [0.3] * 4}), "adds up to 1.2"),
        (lambda: Model("gms", **{**GMS.example, "k": [1.0]}), "k has 1, alpha has 4"),
        (lambda: Model("gms", **{**GMS.example, "k": []}), "k is empty"),
        (lambda: Model("gms", **{**GMS.example, "fs": -0.1}), "fs = -0.1"),
        (lambda: Model("coulomb", fc="much"), "fc = 'much'"),
        (lambda: Model("coulomb", fc=True), "fc = True"),
    ],
)
def test_bad_values_get_one_line_that_names_them(make, said):
    with pytest.raises(ParameterError) as caught:
        make()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_names_suggest():
    with pytest.raises(UnknownName, match="did you mean 'lugre'"):
        Model("lugree", sigma0=1.0)
    with pytest.raises(UnknownName, match="slip rule"):
        GMS.having(slip_rule="absolute")
    with pytest.raises(UnknownName, match="choice of law 'gms'"):
        GMS.having(curv="stribeck")


def test_choices_make_one_law_each():
    literal = GMS.having(slip_rule="literal")
    assert literal is GMS.having(slip_rule="literal")
    assert literal is not GMS
    z = GMS.state(GMS.parameters(dict(GMS.example)))
    z.force[:] = [-0.09] * 4
    p, g = GMS.parameters(dict(GMS.example)), GMS.state(GMS.parameters(dict(GMS.example)))
    GMS.guards(0.05, z, p, None, g)
    assert max(g.mode) < 0.0
    literal.guards(0.05, z, p, None, g)
    assert min(g.mode) > 0.0


def test_a_law_is_shown_by_its_name_and_choices():
    assert repr(GMS) == "Law('gms')"
    assert repr(GMS.having(curve="table")) == "Law('gms', curve='table')"


def test_scaled_model():
    model = Model("gms", **GMS.example).scaled(fs=1.1, fc=1.1)
    assert model.parameters.fs == pytest.approx(0.3685)
    assert Model("gms", **GMS.example).scaled(k=2.0).parameters.k == (2e4, 1.4e4, 1e4, 6e3)
    with pytest.raises(ParameterError, match="no parameter 'f_s'"):
        model.scaled(f_s=1.0)


def test_record_round_trip(tmp_path):
    t = np.linspace(0, 1, 5)
    record = Record(t, {"position": t**2}, {"position": "rad"}, {"what": "test", "seed": 3})
    back = Record.load(record.save(tmp_path / "a.npz"))
    assert np.array_equal(back["position"], record["position"])
    assert back.units == {"position": "rad"}
    assert back.meta == {"what": "test", "seed": 3}
    assert len(back) == 5
    frame = back.to_pandas()
    assert list(frame.columns) == ["position"]
    assert frame.attrs["units"] == {"position": "rad"}


def test_record_errors(tmp_path):
    t = np.zeros(3)
    with pytest.raises(InputError, match="no channel 'postion'; did you mean 'position'"):
        Record(t, {"position": t}, {"position": "rad"})["postion"]
    with pytest.raises(InputError, match="has no unit"):
        Record(t, {"position": t}, {})
    with pytest.raises(InputError, match="shape"):
        Record(t, {"position": np.zeros(2)}, {"position": "rad"})
    with pytest.raises(InputError, match="no record at"):
        Record.load(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no")
    with pytest.raises(InputError, match="is not a record"):
        Record.load(tmp_path / "text.npz")


def test_meta_of_a_run_is_plain_data():
    from stickslip.models.model import Reference
    from stickslip.simulation.closed_loop import simulate

    axis = RigidAxis(1e-3, Model("coulomb", fc=0.1))
    record = simulate(
        axis, Controller(place("PD", 1e-3, 5, 1)), Reference("sine", amplitude=0.1, frequency=1.0), 0.5
    )
    assert json.loads(json.dumps(record.meta))["friction"]["law"] == "coulomb"


def test_the_function_is_not_hidden_by_a_folder():
    """Whatever was imported before, `stickslip.simulate` is the function."""
    code = "import stickslip.simulation.closed_loop, stickslip; print(stickslip.simulate.__name__)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "simulate"


def test_values_per_element_may_be_arrays():
    k, others = np.array([1000, 2000]), {"alpha": (0.5, 0.5), "c": 24.0, "fs": 0.335, "fc": 0.285, "vs": 0.01}
    model = Model("gms", k=k, **others)
    assert model == Model("gms", k=[1000.0, 2000.0], **others)
    assert all(type(value) is float for value in model.parameters.k)
    for wrong, shape in ((k.reshape(1, 2), r"\(1, 2\)"), (k[:0], r"\(0,\)"), (np.array(3.0), r"\(\)")):
        with pytest.raises(
            ParameterError, match=f"gms: k has the shape {shape}; give one number per element"
        ):
            Model("gms", k=wrong, **others)


def test_type_checkers_are_told_that_the_package_is_typed():
    assert Path(stickslip.__file__).with_name("py.typed").is_file()
