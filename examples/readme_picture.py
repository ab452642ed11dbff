"""The picture of the README: position error of a servo axis without and with friction compensation.

    python examples/readme_picture.py [docs/readme]

writes docs/readme.png and docs/readme.svg.
"""

from __future__ import annotations

import sys
from pathlib import Path

from stickslip.report.plots import Curve, Panel, draw, envelope
from stickslip.report.styles import style_of
from stickslip.study.study import execute, load

LABELS = {
    "PD": "PD alone",
    "FF-lugre": "PD + feedforward (LuGre)",
    "FB-gms": "PD + feedback (GMS)",
}


def main(path: Path) -> None:
    """Run three loops of the thesis's study along the slow sinusoid and draw their errors."""
    study = load("thesis")
    planned = {run.key: run for run in study.runs}
    curves: list[Curve] = []
    rms: list[str] = []
    for name, label in LABELS.items():
        record = execute(planned[f"signed/low/nominal/{name}"]).record
        error = 1e3 * (record["position_reference"] - record["position"])
        curves.append(Curve(*envelope(record.time, error), label, style_of(name)))
        rms.append(f"{1e3 * record.meta['metrics']['position_rms_rad']:.2g}")
    panels = [
        Panel(curves[:1], "error (mrad)", "time (s)", (0.0, 5.0)),
        Panel(curves[1:], "error (mrad)", "time (s)", (0.0, 5.0)),
    ]
    message = f"RMS error {rms[0]}, {rms[1]} and {rms[2]} mrad; reference of 20 mrad at 0.4 Hz"
    draw(path, "A servo axis with friction, without and with compensation", message, panels, 1.3)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "readme")
