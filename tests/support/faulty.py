"""Laws with one fault each, made of the law that CONTRIBUTING.md shows, and right laws that look odd."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DAHL = re.findall(r"```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)[0]


def dahl(*changes: tuple[str, str]) -> str:
    """The text of the law with passages exchanged."""
    text = DAHL
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


RATE = "dz.force = p.sigma0 * (v - z.force * abs(v) / p.fc)"
END = "        z.force = slide(0.5 * (v0 + v1) * dt, z, p)\n    return z.force"
PRODUCT = dahl(
    ('fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True)]',
     'zs: Annotated[float, Par("rad", "z_s", "deflection that slides", positive=True)]'),
    ("abs(v) / p.fc", "abs(v) / (p.sigma0 * p.zs)"),
    ("math.copysign(p.fc, distance)", "math.copysign(p.sigma0 * p.zs, distance)"),
    ("abs(distance) / p.fc)", "abs(distance) / (p.sigma0 * p.zs))"),
    ("math.copysign(p.fc, v)", "math.copysign(p.sigma0 * p.zs, v)"),
    ('"fc": 0.285', '"zs": 8e-6'),
    ('("thesis eq. 2.7", "dahl1968")', '("a book that the package does not know",)'),
)  # fmt: skip
"""A right law: its level is a product of parameters, none of which is in N·m; its source is no key of the package."""
