"""The study's page: its nominal part under the signed rule is run, tabulated and drawn."""

from __future__ import annotations

import math
import os

from pages import GENERATED, prose, table, write

from stickslip.report import draw
from stickslip.studies.result import StudyResult
from stickslip.studies.study import load, run

FOLDER = GENERATED / "study"
ONLY = ["signed", "nominal"]
FIGURES = ("3.5", "3.13", "3.21", "3.22", "3.24", "3.26")
COLUMNS = (
    ("low", "position_rms_rad", "RMS error, slow sine (mrad)"),
    ("high", "position_rms_rad", "RMS error, fast sine (mrad)"),
    ("step", "second_half_position_rms_rad", "RMS error at rest after the step (mrad)"),
    ("step", "second_half_reversals_per_s", "reversals at rest (1/s)"),
)

TEXT = """# The thesis's study

Chapter 3 of the thesis compares ten controllers on one axis: PD and PID alone, and PD with Coulomb, Stribeck, LuGre and
GMS compensators in feedforward (FF) and in feedback (FB). References are a slow sinusoid (0.01 rad, 0.4 Hz), a fast one
(0.5 rad, 0.1 Hz) and a step; the friction of the axis is a GMS law of four elements, nominal and 10 % more and less.

```sh
stickslip study thesis
```

runs all 180 cases under both [slip rules](../../explanation/slip_rules.md), and writes the table, the figures and a
report in which the thesis's statements are checked one by one. The file that describes it is
`src/stickslip/studies/thesis.toml` (`stickslip study thesis --print`);
[how to write your own](../../howto/study_file.md).

Shown here: the nominal friction under the signed rule, run when this documentation was built.

## Result

{table}

The error at rest is that of the second half of the run, when the step is over. Read three things from the table. PD
alone hardly moves the axis. Feedforward makes the errors along the sinusoids ten and thirty times smaller, whichever
law it is; at the step it helps only while the reference moves. Feedback is better by another factor of six with any
law, and of sixty with GMS, which is the plant's kind; only that one comes to rest. The others hunt around the
target: see the reversals, and
[why](../../explanation/sign_in_feedback.md).

## Figures
"""


def make() -> None:
    """Run what is not there yet, draw, write the page."""
    result = run(load("thesis"), FOLDER / "run", ONLY)
    parts = [TEXT.format(table=table_of(result))]
    for figure in draw(result):
        if figure.number in FIGURES:
            picture = os.path.relpath(figure.stem.with_name(figure.stem.name + ".svg"), FOLDER)
            caption = prose(figure.caption)
            parts.append(
                f"```{{figure}} {picture}\n:alt: {figure.title}\n\n**{figure.title}.** {caption}\n```"
            )
    write(FOLDER / "index.md", "\n\n".join(parts) + "\n")


def table_of(result: StudyResult) -> str:
    """Controllers against references."""
    found = {(r.reference, r.controller): r.metrics for r in result.runs}
    rows = []
    for controller in dict.fromkeys(r.controller for r in result.runs):
        cells = [controller]
        for reference, name, words in COLUMNS:
            value = found.get((reference, controller), {}).get(name, math.nan)
            shown = value * (1e3 if "mrad" in words else 1.0)
            cells.append("< 1e-9" if 0.0 < shown < 1e-9 else f"{shown:.3g}")
        rows.append(cells)
    return table(["controller", *(words for _, _, words in COLUMNS)], rows)
