"""What cannot stand in a study given as a mapping is refused in one line; laws of one's own are named by their file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError, ModelRemark
from stickslip.studies.rerun import rerun
from support.given_studies import AXIS, CONTROLLERS, LUGRE, PD, SINE, base, read

SUPPORT = Path(__file__).parents[1] / "support"


def held_by(law: ss.Law | ss.ControlLaw) -> dict[str, Any]:
    """A study's mapping in which a law is a friction, or a controller's loop."""
    if isinstance(law, ss.Law):
        return base(friction={"own": ss.Model(law, **law.example)})
    return base(
        controllers={"own": ss.Controller(loop=ss.ControlBlock(law, **law.example), sample_time=1e-3)}
    )


def from_file(path: Path) -> ss.Law | ss.ControlLaw:
    """The law of a file of one's own."""
    return ss.law(str(path)) if path.name == "brittle.py" else ss.control_law(str(path))


@pytest.mark.parametrize("name", ["brittle.py", "sliding_mode.py"])
def test_a_law_of_ones_own_is_named_by_its_file(name: str, tmp_path: Path) -> None:
    own = tmp_path / name
    own.write_text((SUPPORT / name).read_text(encoding="utf-8"), encoding="utf-8")
    content = held_by(from_file(own))
    (run,) = read(content).runs
    assert run.axis.friction == content.get("friction", {"own": LUGRE})["own"]
    assert run.control == {"own": CONTROLLERS["PD"], **content["controllers"]}["own"]
    result = ss.study(content, tmp_path / "mine", report=False)
    assert rerun(result.folder).differences == []
    own.write_text(own.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    for change in (lambda: None, own.unlink):
        change()
        with pytest.raises(
            ss.InputError, match=rf"own: law '\w+' was read from .*{name}, which is gone or"
        ) as refused:
            read(content)
        assert "\n" not in str(refused.value)


class Params(NamedTuple):
    """Of a law that is in no file."""

    level: Annotated[float, ss.Par("N·m", "F", "torque", positive=True)]


def step(v0: Any, v1: Any, dt: Any, z: Any, p: Any, u: Any) -> Any:
    """Torque, N·m."""
    return p.level * v1


def sample(y: Any, z: Any, p: Any, u: Any) -> Any:
    """Torque, N·m."""
    return p.level * y.error


IN_MEMORY = ss.Law("coulomb", Params, step, title="t", equation="F", source=(), example={"level": 1.0})
LOOP_IN_MEMORY = ss.ControlLaw(
    "pd", Params, sample, "loop", title="t", equation="T", source=(), example={"level": 1.0}
)


@pytest.mark.parametrize("law", [IN_MEMORY, LOOP_IN_MEMORY], ids=["friction", "loop"])
def test_a_law_that_lives_in_memory_alone_is_refused_though_a_file_has_its_name(
    law: ss.Law | ss.ControlLaw,
) -> None:
    with pytest.raises(ss.InputError) as refused:
        read(held_by(law))
    assert f"own: law {law.name!r} lives in memory alone" in str(refused.value)
    assert f"write it in a file of its own, and name that, '{law.name}.py'" in str(refused.value)


# ---- what cannot be -----------------------------------------------------------------------------------------------


WRONG = [
    ({"axis": 3}, "study: axis = 3 must be a RigidAxis, "),
    ({"axis": LUGRE}, "study: axis = Model("),
    ({"friction": LUGRE}, "study: friction = Model("),
    ({"friction": {"dry": AXIS}}, "study: friction.dry = RigidAxis("),
    ({"friction": {3: LUGRE}}, "study: friction: the key 3 must be text"),
    ({"friction": {"a b": LUGRE}}, "study: friction.'a b': names are letters, digits"),
    ({"machines": {"m": "thesis-dry"}}, "study: machines.m = 'thesis-dry' must be a Machine, "),
    ({"machines": {"m": {"machine": {"inertia": -1.0, "friction": {"law": "coulomb", "fc": 0.1}}}}},
     "study: machines.m.machine.inertia = -1.0 must be greater than 0"),
    ({"references": {"move": SINE}}, "study: references.move = Reference('sine', amplitude=0.01, frequency=4.0) must be"
     " a pair (Reference, duration in s), or a mapping with 'kind' and 'duration'"),
    ({"references": {"move": (SINE,)}}, "study: references.move = (Reference("),
    ({"references": {"move": (SINE, "1 s")}}, "study: references.move.duration = '1 s' must be a number in s"),
    ({"references": {"move": (SINE, None)}}, "study: references.move.duration = None must be a number, "),
    ({"references": {"move": {"kind": "sine", "amplitude": [0.1, LUGRE]}}},
     "study: references.move.amplitude[1] = Model("),
    ({"controllers": {"PD": PD}}, "study: controllers.PD = Gains("),
    ({"controllers": {"PD": {"gains": PD, "compensator": 3}}}, "study: controllers.PD.compensator = 3 must be a"),
    ({"controllers": {"PD": {"gains": PD, "torque_limt": 3}}}, "study: controllers.PD.torque_limt: unknown key; did"),
    ({"tolerance": 1j}, "study: tolerance = 1j must be a number, text, True or False, a list or a mapping"),
    ({"controlers": {}}, "study: controlers: unknown key; did you mean 'controllers'?"),
    ({"bench": "compensators"}, "study is a bench of compensators"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), WRONG, ids=lambda x: x if isinstance(x, str) else "")
def test_what_cannot_be_is_refused_in_a_line_that_names_the_key(
    changes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ss.InputError) as refused:
        ss.study(base(**changes), tmp_path / "mine", report=False)
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "mine").exists()


def test_a_mapping_needs_a_folder_after_which_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ss.InputError, match=r"study: folder is missing, .* give one, folder='my-study'"):
        ss.study(base())
    monkeypatch.chdir(tmp_path)
    assert ss.study(base(), ".", report=False).manifest["study"] == tmp_path.name


def test_what_it_is_given_is_left_as_it_is(tmp_path: Path) -> None:
    content = base(
        references={"sine": {"kind": SINE, "duration": np.float64(0.1)}}, laws={"a": {"law": LUGRE}}
    )
    shown = repr(content)
    read(content)
    assert repr(content) == shown


def test_a_misspelt_key_of_objects_is_called_so(tmp_path: Path) -> None:
    """What stood there "must be a number, text, True or False"."""
    given = {
        "axis": ss.RigidAxis(4e-4, ss.Model("coulomb", fc=0.3)),
        "controler": {"PD": ss.Controller(ss.pid(1.0, 0.0, 0.1))},
    }
    with pytest.raises(InputError, match=r"study: controler: unknown key; did you mean 'controllers'\?"):
        ss.study(given, tmp_path / "mine")


def test_an_axis_whose_friction_is_left_out_is_told(tmp_path: Path) -> None:
    """Another was given, and it was dropped in silence."""
    given = {
        "axis": ss.RigidAxis(4e-4, ss.Model("coulomb", fc=0.3)),
        "friction": {"worn": ss.Model("dahl", sigma0=1e3, fc=0.2)},
        "references": {"slow": (ss.Reference("sine", amplitude=0.1, frequency=1.0), 0.1)},
        "controllers": {"PD": ss.Controller(ss.place("PD", 4e-4, 20.0))},
    }  # fmt: skip
    with pytest.warns(ModelRemark, match=r"study: axis: its friction, coulomb, is left out"):
        runs = ss.study(given, tmp_path / "mine", report=False).runs
    assert [run.friction for run in runs] == ["worn"]
