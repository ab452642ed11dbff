"""Draw the picture of the README: friction of the demo log, and the position error with what is recommended.

    python examples/readme_picture.py [docs/readme]

writes docs/readme.png and docs/readme.svg.
"""

from __future__ import annotations

import sys
from importlib.resources import files
from pathlib import Path

import stickslip as ss
from stickslip.report.plots import DPI, house_style


def main(path: Path) -> None:
    """Identify the log that ships, choose a compensator and draw both."""
    found = ss.identify(files("stickslip") / "demo.csv", law=["coulomb", "stribeck"])
    advice = ss.recommend(found, bandwidth=20.0, counts_per_rev=65536, torque_limit=3.0)
    figure = advice.plot(found)
    with house_style():
        figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})
        figure.savefig(path.with_suffix(".png"), dpi=DPI)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "readme")
