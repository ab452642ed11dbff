"""Symbols with their names, units and names in code: from the laws and references, and a list of the loop's own."""

from __future__ import annotations

from collections.abc import Iterator

from pages import GENERATED, latex, table, write

from stickslip.core.spec import fields_of
from stickslip.models import plugins

LOOP = (
    ("theta", "position of the axis", "rad", "position"),
    ("v", "velocity of the axis", "rad/s", "velocity"),
    ("theta_d", "reference position", "rad", "position_reference"),
    ("e", "position error, theta_d - theta", "rad", "position_reference - position"),
    ("J", "inertia of the axis", "kg·m²", "inertia"),
    ("T_m", "motor torque", "N·m", "motor_torque"),
    ("T_f", "friction torque, positive against positive velocity", "N·m", "friction_torque"),
    (r"\hat{T}_f", "compensating torque", "N·m", "compensation_torque"),
    ("k_p", "proportional gain", "N·m/rad", "kp"),
    ("k_i", "integral gain", "N·m/(rad·s)", "ki"),
    ("k_d", "derivative gain", "N·m·s/rad", "kd"),
    ("k_r", "rate feedback gain", "N·m·s/rad", "kr"),
    ("omega_n", "natural frequency of the placed poles; in files and calls as frequency in Hz", "rad/s", "bandwidth"),
    ("zeta", "damping ratio of the placed poles", "-", "damping"),
    ("s(v)", "sliding curve: torque at constant velocity without the linear viscous part", "N·m", "curve"),
    ("t", "time", "s", "time"),
)  # fmt: skip


def make() -> None:
    """Write the page."""
    loop = [(f"${latex(s)}$", name, unit, f"`{code}`") for s, name, unit, code in LOOP]
    write(
        GENERATED / "nomenclature.md",
        f"""# Nomenclature

SI units everywhere inside: rad, N·m, kg·m², s (m, N, kg for a linear axis). Only bandwidths, filters and the
frequencies of references are in Hz.

## The loop

$$
J \\dot v = T_m - T_f
$$

{table(["symbol", "name", "unit", "in code"], loop)}

## Parameters of the laws

{table(["symbol", "name", "unit", "in code", "laws"], gathered("fields"))}

## States of the laws

{table(["symbol", "name", "unit", "in code", "laws"], gathered("state_fields"))}
""",
    )


def gathered(which: str) -> Iterator[tuple[str, str, str, str, str]]:
    """Rows of everything the laws describe: what is the same in several laws once."""
    rows: dict[tuple[str, str, str, str], list[str]] = {}
    for name in plugins.law_names():
        law = plugins.law(name)
        optional = [f for c in law.choices for o in c.options.values() for f in fields_of(o.params)]
        for f in (
            {f.name: f for f in (*optional, *law.fields)}.values() if which == "fields" else law.state_fields
        ):
            rows.setdefault((f.par.symbol, f.par.meaning, f.par.unit, f.name), []).append(name)
    for (symbol, meaning, unit, code), laws in sorted(rows.items(), key=lambda r: r[0][3]):
        links = ", ".join(f"[{name}](laws/{name}.md)" for name in laws)
        yield f"${latex(symbol)}$", meaning, unit, f"`{code}`", links
