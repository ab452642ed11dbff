"""What is written for MuJoCo: read back, run, and held against the package's own run."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.errors import InputError
from stickslip.exports._mujoco_run import drift, pulled
from stickslip.exports.job import CannotCarry, Job
from stickslip.exports.mujoco import LUGRE as LUGRE_FORM
from stickslip.exports.mujoco import holding_step, read, write, xml
from stickslip.exports.nearest import COULOMB, carried
from stickslip.models import plugins
from stickslip.models.model import Model

INERTIA = 3.8623e-4
LUGRE = dict(plugins.law("lugre").example)
positive = st.floats(1e-3, 1e3)


def job(model, nearest=False, **wanted):
    return Job(model, "axis", nearest=nearest, settings={"inertia": INERTIA, **wanted})


def text_of(model, **wanted):
    return write(job(model, **wanted)).files["axis.xml"]


@settings(max_examples=25)
@given(st.floats(0.1, 10.0), positive, st.floats(0.0, 10.0))
def test_coulomb_friction_comes_back(fc, inertia, sigma2):
    model = Model("coulomb", fc=fc, sigma2=sigma2)
    text = xml(job(model, inertia=inertia), model)
    assert read(text).as_dict() == model.as_dict()


@settings(max_examples=25)
@given(positive, st.floats(0.0, 10.0), positive, st.floats(1.0, 3.0), positive, st.floats(0.0, 1.0))
def test_lugre_friction_comes_back(sigma0, sigma1, fc, rise, vs, sigma2):
    p = {
        "sigma0": sigma0,
        "sigma1": sigma1,
        "fc": fc,
        "fs": fc * rise,
        "vs": vs,
        "sigma2": sigma2,
        "delta_s": 2.0,
    }
    model = Model("lugre", **p)
    assert read(xml(job(model), model)).parameters == model.parameters


def test_a_joint_may_have_any_name():
    text = text_of(Model("coulomb", fc=1.0), joint='a<b & "c"')
    assert read(text, 'a<b & "c"').parameters.fc == 1.0
    with pytest.raises(InputError, match="joint 'elbow'"):
        read(text, "elbow")


@pytest.mark.parametrize("text", ["", "<robot>", '<mujoco><joint name="a" damping="x"/></mujoco>'])
def test_what_is_no_model_is_refused(text):
    with pytest.raises(InputError, match=r"MJCF|cannot be read"):
        read(text)


def test_another_shape_factor_is_refused_and_offered_as_the_nearest():
    model = Model("lugre", **{**LUGRE, "delta_s": 1.0})
    with pytest.raises(CannotCarry, match=r"shape of its sliding curve.*nearest=True"):
        write(job(model))
    found = read(write(job(model, nearest=True)).files["axis.xml"]).parameters
    assert (found.sigma0, found.sigma1) == (LUGRE["sigma0"], LUGRE["sigma1"])


def test_of_a_law_with_other_memory_the_stiffness_at_rest_is_kept():
    law = plugins.law("gms")
    model = Model(law, **dict(law.example))
    with pytest.raises(CannotCarry, match="non-local memory"):
        write(job(model))
    found = read(write(job(model, nearest=True)).files["axis.xml"]).parameters
    assert found.sigma0 == pytest.approx(sum(law.example["k"]), rel=1e-3)


def test_a_timestep_that_cannot_hold_stiction_is_said_and_a_contact_that_it_holds_offered():
    export = write(job(Model("lugre", **LUGRE)))
    (note,) = export.notes
    assert "does not hold this contact at rest" in note
    assert "below 3.37e-06 s" in note
    softer = read(write(job(Model("lugre", **LUGRE), contact="held")).files["axis.xml"])
    assert holding_step(softer) > 0.002
    assert softer.parameters.fs == LUGRE["fs"]
    assert not write(job(Model("lugre", **LUGRE), timestep=3e-4, contact="held")).notes[0].startswith("at a")
    with pytest.raises(InputError, match="identified or held"):
        write(job(Model("lugre", **LUGRE), contact="soft"))


# ---- in MuJoCo -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def engine():
    mujoco = pytest.importorskip("mujoco")
    if not hasattr(mujoco.mjtBias, "mjBIAS_DCMOTOR"):
        pytest.skip("MuJoCo without the dcmotor actuator")
    return mujoco


@pytest.mark.parametrize(("sigma0", "sigma1"), [(3.5e4, 1.0), (3.5e4, 10.0), (1e3, 0.1), (1e3, 1.0)])
def test_a_stuck_contact_decays_below_the_bound_and_grows_above_it(engine, sigma0, sigma1):
    model = Model("lugre", **{**LUGRE, "sigma0": sigma0, "sigma1": sigma1})

    def grows(step):
        loaded = engine.MjModel.from_xml_string(xml(job(model, timestep=step), model))
        data = engine.MjData(loaded)
        data.qvel[0] = 1e-12
        speeds = []
        for _ in range(3000):
            engine.mj_step(loaded, data)
            speeds.append(abs(data.qvel[0]))
        return max(speeds[-300:]) > max(speeds[:20])

    bound = holding_step(model)
    assert not grows(0.97 * bound)
    assert grows(1.03 * bound)


def test_the_written_constraint_holds_a_load_that_mujocos_own_lets_creep(engine):
    text = text_of(Model("coulomb", fc=0.285, sigma2=0.018))
    plain = text.replace("solreffriction", "user").split('user="')
    plain = plain[0] + plain[1].split('0.001"', 1)[1]
    held = drift(engine.MjModel.from_xml_string(text), 0.14)
    crept = drift(engine.MjModel.from_xml_string(plain), 0.14)
    assert held < 1e-3
    assert crept > 0.1


def test_the_nearest_of_an_asymmetric_law_keeps_its_bristle():
    each = {"fs": 0.4, "fc": 0.3, "fs_negative": 0.36, "fc_negative": 0.26}
    values = {"sigma0": 3.0e4, "sigma1": 0.7, "vs": 0.01, "sigma2": 0.02, **each}
    order = job(Model("lugre", {"symmetry": "asymmetric"}, **values), nearest=True)
    found = carried(order, "mujoco", (COULOMB, LUGRE_FORM))
    p = found.model.parameters
    assert (p.sigma0, p.sigma1) == (3.0e4, 0.7)
    assert p.fc == pytest.approx(0.28, rel=0.01)
    assert found.lost == ("the difference between the directions",)


NESTED = """<mujoco>
 <default><joint frictionloss="0.1" damping="0.01"/>
  <default class="arm"><joint frictionloss="0.2"/><default class="hand"><joint damping="0.05"/></default></default>
  <default class="driven"><dcmotor input="none" motorconst="0" resistance="1" lugre="300 0.1 0.28 0.33 0.1"/></default>
 </default>
 <worldbody>
  <body><joint name="base"/><geom size="1"/>
   <body childclass="arm"><joint name="elbow"/><geom size="1"/>
    <body><frame childclass="hand"><joint name="wrist" damping="0.5"/></frame><joint class="hand" name="finger"/>
     <joint class="main" name="thumb" frictionloss="0"/><geom size="1"/></body></body></body>
 </worldbody>
 <tendon><fixed><joint joint="base" coef="1"/></fixed></tendon>
 <equality><joint name="tie" joint1="base" joint2="elbow"/></equality>
 {more}
</mujoco>"""
JOINTS = {
    "base": (0.1, 0.01),
    "elbow": (0.2, 0.01),
    "wrist": (0.2, 0.5),
    "finger": (0.2, 0.05),
    "thumb": (0.0, 0.01),
}


@pytest.mark.parametrize("joint", JOINTS)
def test_a_joint_has_what_its_defaults_give_it(joint):
    p = read(NESTED.format(more=""), joint).parameters
    assert (p.fc, p.sigma2) == JOINTS[joint]


def test_mujoco_gives_the_joints_the_same(engine):
    loaded = engine.MjModel.from_xml_string(NESTED.format(more=""))
    names = [loaded.joint(i).name for i in range(loaded.njnt)]
    assert {n: (loaded.dof_frictionloss[i], loaded.dof_damping[i]) for i, n in enumerate(names)} == JOINTS


def test_a_motors_friction_comes_from_its_class_too():
    motor = '<actuator><dcmotor class="driven" joint="base"/></actuator>'
    p = read(NESTED.format(more=motor), "base").parameters
    assert (p.sigma0, p.fs, p.sigma2) == (300.0, 0.33, 0.01)


NAMELESS = "<mujoco><worldbody><body><joint frictionloss='{}'/><joint frictionloss='0.2'/></body></worldbody></mujoco>"


@pytest.mark.parametrize(
    ("text", "joint", "says"),
    [
        (NAMELESS.format(0.1), None, "2 of the file's joints have no name: give them one"),
        (NAMELESS.format(0.1), "", "have no name"),
        (NESTED.format(more=""), None, "name one of base, elbow, wrist, finger, thumb"),
        (NESTED.format(more="").replace("elbow", "base"), "base", "2 joints of the file have that name"),
        (NESTED.format(more="").replace('childclass="arm"', 'childclass="leg"'), "elbow",
         "of class 'leg', which no <default> defines"),
        ("<robot name='x'><joint name='a'><dynamics friction='1'/></joint></robot>", "a", "is a URDF"),
        ("<svg/>", None, "root is <svg>"),
        ("<mujoco><include file='d.xml'/><worldbody><body><joint name='a'/></body></worldbody></mujoco>", "a",
         "includes d.xml"),
    ],
)  # fmt: skip
def test_what_would_be_read_wrongly_is_refused(text, joint, says):
    with pytest.raises(InputError, match=says):
        read(text, joint)


def test_a_contact_made_soft_enough_holds_its_load(engine):
    law = Model("lugre", **LUGRE)
    stiff, soft = (
        drift(engine.MjModel.from_xml_string(text_of(law, contact=c)), 0.14) for c in ("identified", "held")
    )
    p = read(text_of(law, contact="held")).parameters
    assert soft < 3.0 * 0.14 / p.sigma0
    assert stiff > 0.1


def shares(model, **wanted):
    """Largest errors of the stick-slip run at three timesteps, per cent of the travel."""
    order = job(model, **wanted)
    return [
        100.0 * run.share
        for run in pulled(write(order).files["axis.xml"], model, INERTIA, wanted["timestep"])
    ]


def test_the_error_of_a_stick_slip_run_falls_with_the_timestep(engine):
    first, second, third = shares(Model("coulomb", **plugins.law("coulomb").example), timestep=2e-3)
    assert 0.1 > first > 2.0 * second > 4.0 * third
    # A LuGre contact that a timestep of 0.5 ms holds: MuJoCo's error is of first order.
    first, second, third = shares(Model("lugre", **{**LUGRE, "sigma0": 1e3, "sigma1": 1.0}), timestep=5e-4)
    assert 1.0 > first > 3.0 * second > 9.0 * third


def test_the_softened_contact_slips_as_ours_where_the_identified_one_does_not(engine):
    model = Model("lugre", **LUGRE)
    assert shares(model, timestep=2e-3, contact="held")[0] < 5.0 < shares(model, timestep=2e-3)[0]


def test_the_readme_has_the_table(engine):
    text = write(job(Model("coulomb", fc=0.285))).files["README.md"]
    assert sum(line.startswith("| 0.") for line in text.splitlines()) == 3


# ---- friction that differs between the directions ----------------------------------------------------------------

ASYMMETRIC = {
    "coulomb": {"fc": 0.3, "fc_negative": 0.26, "sigma2": 0.01, "sigma2_negative": 0.01},
    "lugre": {**LUGRE, "delta_s": 2.0},
}
for _name in ("fc", "fs", "vs", "delta_s", "sigma2"):
    ASYMMETRIC["lugre"][f"{_name}_negative"] = ASYMMETRIC["lugre"][_name] - 0.05 * (_name in ("fc", "fs"))


def asymmetric(law, **other):
    return Model(plugins.law(law).having(symmetry="asymmetric"), **{**ASYMMETRIC[law], **other})


@pytest.mark.parametrize("law", ["coulomb", "lugre"])
def test_half_the_difference_between_the_directions_is_a_constant_torque(law):
    model = asymmetric(law)
    made = write(job(model))
    assert not any("not carried" in note for note in made.notes)
    assert "constant torque" in made.files["README.md"]
    again = read(made.files["axis.xml"])
    assert again.law.chosen["symmetry"] == "asymmetric"
    assert again.parameters._asdict() == pytest.approx(model.parameters._asdict(), rel=1e-12)


def test_a_difference_that_changes_with_the_velocity_is_named_and_its_mean_kept():
    model = asymmetric("coulomb", sigma2_negative=0.02)
    with pytest.raises(CannotCarry, match="the change of the difference between the directions"):
        write(job(model))
    made = write(job(model, nearest=True))
    again = read(made.files["axis.xml"]).parameters
    assert again.fc - again.fc_negative == pytest.approx(
        0.04 - 0.01 * 0.5, abs=1e-3
    )  # the mean up to 1 rad/s
    assert again.sigma2 == again.sigma2_negative == pytest.approx(0.015)


def test_symmetric_friction_has_no_constant_torque():
    made = write(job(Model("coulomb", fc=0.3, sigma2=0.01)))
    assert "<actuator>" not in made.files["axis.xml"]
    assert "constant torque" not in made.files["README.md"]


def test_mujoco_withstands_as_much_in_each_direction_as_the_law():
    mujoco = pytest.importorskip("mujoco")
    loaded = mujoco.MjModel.from_xml_string(
        text_of(asymmetric("coulomb", fc_negative=0.2, sigma2_negative=0.01))
    )
    for torque, moves in ((0.28, False), (0.32, True), (-0.18, False), (-0.22, True)):
        assert (drift(loaded, torque) > 0.1) == moves, torque
