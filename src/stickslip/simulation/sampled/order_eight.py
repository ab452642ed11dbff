"""One step of order 8 with an estimate of its error, for the scalars of a slipping axis.

The method is that of Dormand and Prince as implemented by Hairer (DOP853: Hairer, Norsett and Wanner 1993, II.10,
with an estimate from methods of orders 5 and 3). The stages are written out by `text`, three scalars each, so
that no coefficient is read from a table while a step is taken.
"""

from __future__ import annotations

import hashlib
from typing import Any

from stickslip.jit import loaded

# fmt: off
STAGES = (
    (0.05260015195876773,),
    (0.0197250569845379, 0.0591751709536137),
    (0.02958758547680685, 0, 0.08876275643042054),
    (0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792),
    (0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242),
    (0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125),
    (0.03709200011850479, 0, 0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
     0.008273789163814023),
    (0.6241109587160757, 0, 0, -3.3608926294469414, -0.868219346841726, 27.59209969944671,
     20.154067550477894, -43.48988418106996),
    (0.47766253643826434, 0, 0, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
     15.279233632882423, -33.28821096898486, -0.020331201708508627),
    (-0.9371424300859873, 0, 0, 5.186372428844064, 1.0914373489967295, -8.149787010746927,
     -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196),
    (2.273310147516538, 0, 0, -10.53449546673725, -2.0008720582248625, -17.9589318631188,
     27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303,
     0.6433927460157636),
    (0.054293734116568765, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
     0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259),
)
"""Row i leads to stage i + 1; the last to the end of the step."""
FIFTH = (
    0.01312004499419488, 0, 0, 0, 0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
)
"""What the end differs by from that of order 5."""
THIRD = (
    -0.18980075407240762, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082,
)
"""What the end differs by from that of order 3."""
# fmt: on


def weighted(row: Any, name: str) -> str:
    """The sum over the stages' rates of that name."""
    return " + ".join(f"{weight!r} * {name}{i}" for i, weight in enumerate(row) if weight)


def text() -> str:
    """The step written out: `attempt`."""
    lines = [
        "from stickslip.jit import kernel",
        "from stickslip.simulation.sampled.rates import Trial, combined, rates",
        "",
        "@kernel(exact=False)",
        "def attempt(m, start, h):",
        "    v0, s0, a0, g0, q0, _ = start",
    ]
    for i, row in enumerate(STAGES, start=1):
        lines += [
            f"    v{i} = v0 + h * ({weighted(row, 'a')})",
            f"    s{i} = s0 + h * ({weighted(row, 'g')})",
            f"    d{i} = h * ({weighted(row, 'v')})",
        ]
        if i < len(STAGES):
            lines.append(f"    a{i}, g{i}, q{i} = rates(m, d{i}, v{i}, s{i})")
    for name in "vag":
        lines.append(f"    {name}e = combined({weighted(FIFTH, name)}, {weighted(THIRD, name)})")
    last = len(STAGES)
    lines += [
        "    error = h * max(ve, m.of_velocity * ae, m.of_force * ge)",
        f"    return Trial(h, d{last}, v{last}, s{last}, h * ({weighted(STAGES[-1], 'q')}), error)",
    ]
    return "\n".join(lines) + "\n"


_TEXT = text()
attempt: Any = loaded(f"order_eight_{hashlib.sha256(_TEXT.encode()).hexdigest()[:16]}", _TEXT).attempt
"""``attempt(m, start, h)``: the `Trial` of a step of h s."""
