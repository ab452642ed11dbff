"""Every law under every option against what it declares, over random admissible parameters and motions.

The compiled step runs in batches: `CASES` random cases a law and option, of `STEPS` steps each, with speeds over nine
decades, rests and reversals, steps from 1e-7 to 1 s. Where a law declares that it can give energy back, a concrete
motion shows it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.contract.energy import claims_passivity, gives_back, within_condition
from stickslip.contract.motions import (
    STEPS,
    U,
    batch,
    example,
    level_of,
    motions,
    name_of,
    nearby,
    seeded,
    swings,
    variants,
)
from stickslip.core.spec import Law, Surroundings
from stickslip.laws import LAWS
from stickslip.models import plugins

CASES = 50
"""Parameter sets a law and option, each with `MOTIONS` motions."""
MOTIONS = 60
COUNTED = {"cases": 0}


VARIANTS = [v for name in plugins.law_names() for v in variants(plugins.law(name))]
REGISTERED = set(LAWS)
every_variant = pytest.mark.parametrize("law", VARIANTS, ids=name_of)


@every_variant
def test_finite_and_bounded_for_any_parameters_and_steps(law):
    """No torque without bound, and none that is no number; the mirrored motion gives the mirrored torque."""
    rng = seeded(law, 1)
    for _ in range(CASES):
        p = nearby(law, rng)
        velocity, dt = motions(rng, MOTIONS)
        torque, end = batch(law, p, velocity, dt)
        assert np.all(np.isfinite(torque)), p
        assert np.all(np.isfinite(end)), p
        COUNTED["cases"] += MOTIONS
        if law.odd:
            mirrored, _ = batch(law, p, -velocity, dt)
            np.testing.assert_allclose(mirrored, -torque, rtol=1e-12, atol=1e-15, err_msg=str(p))
        # At rest nothing viscous is left: what remains is within the law's levels.
        rest = velocity[:, -1] == 0.0
        level = 0.0 if law.name == "viscous" else level_of(law, p)
        assert math.isfinite(level)
        assert np.all(np.abs(torque[rest, -1]) <= 1.0001 * level), p


def test_every_registered_law_and_option_is_among_them():
    """Counted in the registry, not in the list above."""
    options = sum(len(c.options) - 1 for name in REGISTERED for c in plugins.law(name).choices)
    assert {law.name for law in VARIANTS} >= REGISTERED
    assert len([law for law in VARIANTS if law.name in REGISTERED]) == len(REGISTERED) + options
    assert len(set(map(name_of, VARIANTS))) == len(VARIANTS)


def test_cases_are_many_enough(request, capsys):
    """At least 1e5 random cases have passed above; says how many."""
    batches = [i for i in request.session.items if i.name.startswith("test_finite_and_bounded")]
    if len(batches) < len(VARIANTS):
        pytest.skip("needs all the batches of this file")
    laws = len({law.name for law in VARIANTS})
    with capsys.disabled():
        print(
            f"\n{COUNTED['cases']} random cases: {laws} laws, {len(VARIANTS)} with their options, {STEPS} steps each"
        )
    assert COUNTED["cases"] == len(VARIANTS) * CASES * MOTIONS
    assert COUNTED["cases"] >= 1e5


@every_variant
def test_compiled_is_plain_python_bit_for_bit(law):
    rng = seeded(law, 2)
    for _ in range(6):
        p = nearby(law, rng)
        velocity, dt = motions(rng, 4)
        torque, _ = batch(law, p, velocity, dt)
        for case in range(4):
            z, v = law.state(p), 0.0
            for i in range(STEPS):
                assert law.step(v, float(velocity[case, i]), float(dt[case, i]), z, p, U) == torque[case, i]
                v = float(velocity[case, i])


# ---- rate independence ------------------------------------------------------------------------------------------


def without_viscosity(law: Law):
    """The example without its viscous part, unless the law is nothing else."""
    if law.name == "viscous":
        return example(law)
    values = dict(law.example)
    for f in law.fields:
        if f.name.startswith(("sigma2", "fv2")):
            values[f.name] = 0.0
    return law.parameters(values)


@every_variant
def test_rate_independence_is_as_declared(law):
    """The same path at another pace: the same torque, or for some path another one."""
    p, rng = without_viscosity(law), seeded(law, 3)
    velocity = 10.0 ** rng.uniform(-6.0, -2.0, (200, STEPS)) * rng.choice([-1.0, 1.0], (200, STEPS))
    # Steps at constant velocity: before each, a jump of no length.
    held = np.repeat(velocity, 2, axis=1)[:, :STEPS]
    dt = np.where(np.arange(STEPS) % 2 == 0, 0.0, 1e-3) * np.ones((200, 1))
    slow, _ = batch(law, p, held, dt)
    fast, _ = batch(law, p, 16.0 * held, dt / 16.0)
    difference = np.abs(slow - fast).max()
    if law.rate_independent:
        assert difference < 1e-10
    else:
        assert difference > 1e-6


# ---- memory -----------------------------------------------------------------------------------------------------


def along(law: Law, p, path, pace=1e-6, parts=200):
    """Torques at the ends of straight moves, at a slow pace; `path` in rad."""
    z, here, out = law.state(p), 0.0, []
    for there in path:
        v = math.copysign(pace, there - here)
        dt = abs(there - here) / pace / parts
        law.step(v, v, 0.0, z, p, U)
        for _ in range(parts):
            torque = law.step(v, v, dt, z, p, U)
        out.append(torque)
        here = there
    return np.array(out)


@every_variant
def test_memory_is_as_declared(law):
    """An inner loop closes, and the outer curve goes on as if it had not been; or it drifts."""
    p = example(law)
    if not law.state_fields:
        assert not law.non_local_memory
        return
    outer = along(law, p, [8e-6, 14e-6])
    inner = along(law, p, [8e-6, 4e-6, 8e-6, 14e-6])
    closed = abs(inner[2] - inner[0]) < 1e-6 and abs(inner[3] - outer[1]) < 1e-6
    if law.non_local_memory:
        assert closed, (outer, inner)
    elif law.name in ("lugre", "dahl", "leuven"):
        assert not closed
        assert inner[2] < inner[0] - 1e-4  # it comes back with less: that is how LuGre drifts


# ---- continuity -------------------------------------------------------------------------------------------------


@every_variant
def test_continuity_is_as_declared(law):
    """Over a swing the largest change of the torque in a step shrinks with the step, or it jumps."""
    p = example(law)
    if law.name == "armstrong":
        breaking = batch(law, p, np.full((1, 8000), 0.05), np.full((1, 8000), 1e-7))[0][0]
        assert not law.continuous
        jump = np.diff(breaking).max() - np.median(np.diff(breaking)[:1000])
        assert jump == pytest.approx(0.018 * 0.05, rel=0.2)  # the viscous part sets in
        return
    largest = []
    for n in (4000, 16000):
        phase = np.linspace(0.0, 3.0 * math.pi, n + 1)
        velocity = np.ascontiguousarray(2e-3 * np.sin(phase)[None, 1:])
        dt = np.full_like(velocity, 3.0 / n)
        torque, _ = batch(law, p, velocity, dt)
        largest.append(np.abs(np.diff(torque[0])).max())
    if law.continuous:
        assert largest[1] < 0.45 * largest[0]
    else:
        assert largest[1] > 0.9 * largest[0] > 1e-7


# ---- energy -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [law for law in VARIANTS if claims_passivity(law)], ids=name_of)
def test_a_passive_law_gives_no_energy_back(law):
    """Work from rest is never negative, within what the trapezoid of the work leaves open."""
    rng = seeded(law, 5)
    tried = 0
    for case in range(25):
        p = within_condition(law, nearby(law, rng) if case else example(law))
        if p is None:
            continue
        assert not gives_back(law, p, *swings(rng, 20)), p
        tried += 1
    assert tried >= 15


@pytest.mark.parametrize("law", [law for law in VARIANTS if law.stored is not None], ids=name_of)
def test_what_is_not_stored_is_dissipated(law):
    """Bookkeeping over single steps: work less the rise of the stored energy is never negative."""
    rng = seeded(law, 6)
    p = example(law)
    if not law.dissipates(p):
        return
    velocity, dt = swings(rng, 3, n=3000)
    for case in range(3):
        z, v, last, total, lost = law.state(p), 0.0, 0.0, 0.0, 0.0
        energy = law.stored(z, p)
        for end, h in zip(velocity[case].tolist(), dt[case].tolist()):
            torque = law.step(v, end, h, z, p, U)
            work = 0.25 * (last + torque) * (v + end) * h
            now = law.stored(z, p)
            total += abs(work)
            lost += min(0.0, work - (now - energy))
            v, last, energy = end, torque, now
        assert lost >= -3e-3 * total


def work_of(law: Law, p, legs):
    """Work over legs of constant velocity (rad/s, s), each in many steps, J."""
    z, work = law.state(p), 0.0
    for v, time in legs:
        last = law.step(v, v, 0.0, z, p, U)
        for _ in range(4000):
            torque = law.step(v, v, time / 4000, z, p, U)
            work += 0.5 * (last + torque) * v * time / 4000
            last = torque
    return work


BRISTLES = {"sigma0": 1e4, "sigma1": 10.0, "sigma2": 0.0, "fs": 0.5, "fc": 0.2, "vs": 0.01}
UNBOUND = {
    "lugre": BRISTLES,
    "elasto_plastic": {**BRISTLES, "z_ba": 1e-5},  # half of the deflection that carries F_C
    "leuven": {
        "k": [5e3, 5e3], "w": [0.25, 0.25], "delta_i": 1.0, "sigma1": 10.0, "sigma2": 0.0, "fs": 0.5, "fc": 0.2,
        "vs": 0.01,
    },
}  # fmt: skip
"""Far below the condition of Barabanov and Ortega."""


@pytest.mark.parametrize("name", UNBOUND)
def test_below_its_condition_a_bristle_gives_energy_back(name):
    """Loaded slowly up to the static torque, then moved fast: sigma1 dz/dt outweighs all else, without bound."""
    law = plugins.law(name)
    p = law.parameters(UNBOUND[name])
    assert not law.dissipates(p)
    pull = [(1e-4, 1.0)]
    jerk = 100.0
    assert work_of(law, p, [*pull, (jerk, 1e-4 / jerk)]) < 0.0
    enough = law.parameters({**UNBOUND[name], "sigma2": 10.0 * 1.5})
    assert law.dissipates(enough)
    assert work_of(law, enough, [*pull, (jerk, 1e-4 / jerk)]) > 0.0


def test_the_literal_slip_rule_gives_energy_back():
    """After a reversal at speed |F_i| exceeds s(v) at once, and the loaded elements slip the wrong way."""
    law = plugins.law("gms")
    values = {**law.example, "c": 5.0, "fs": 0.5, "fc": 0.1, "sigma2": 0.0}
    legs = [(1e-5, 20.0), (-0.1, 2e-3)]
    signed, literal = (
        work_of(law.having(slip_rule=rule), law.having(slip_rule=rule).parameters(values), legs)
        for rule in ("signed", "literal")
    )
    assert not law.having(slip_rule="literal").dissipates(law.parameters(values))
    assert literal < 0.0 < signed


def test_a_slipping_element_gives_back_what_it_gained_without_work():
    """Broken away fast at F_C, held at a crawl until it carries F_S, then let back."""
    law = plugins.law("gms")
    p = law.parameters(
        {"k": [1e3], "alpha": [1.0], "c": 1e3, "sigma2": 0.0, "fs": 0.5, "fc": 0.1, "vs": 0.01}
    )
    assert not law.dissipates(p)
    work = work_of(law, p, [(1.0, 1.001e-4), (1e-9, 0.1), (-1e-3, 0.5)])
    assert work == pytest.approx(-(0.5**2 - 0.1**2) / 2e3, rel=0.02)
    assert law.dissipates(law.parameters({**p._asdict(), "fs": 0.1}))


def test_karnopp_passes_on_what_is_applied_against_the_motion():
    """In the band the friction is what is applied, though the contact be moved the other way."""
    law = plugins.law("karnopp")
    p = law.parameters(law.example)
    assert law.step(-1e-4, -1e-4, 1e-3, [], p, Surroundings(applied=0.1)) * -1e-4 < 0.0
    assert law.step(-1e-4, -1e-4, 1e-3, [], p, U) == 0.0


def test_every_condition_has_its_counterexample():
    """The laws that are passive under a condition alone are those whose counterexamples stand above."""
    conditional = {law.name for law in VARIANTS if law.is_passive is not None}
    assert conditional == {"lugre", "elasto_plastic", "leuven", "gms"}
