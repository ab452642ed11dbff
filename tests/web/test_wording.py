"""Messages of the package name options of the command line; the page names its forms."""

from __future__ import annotations

import pytest

from stickslip.web.wording import in_the_page

FORM = "under “Columns and units”"


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("say --map torque=COLUMN:Nm", f"say “torque” = its column in Nm {FORM}"),
        ("say --map velocity=speed:UNIT", f"say “velocity” = the column speed with its unit {FORM}"),
        ("--map 'sensor_torque=F [uN]:-uN': here", f"“sensor torque” = the column F [uN] in -uN {FORM}: here"),
        ("--map time=COLUMN:s --map load=a:N", f"“time” = its column in s, “load” = the column a in N {FORM}"),
        ("leave it out with --map current=none", f"leave it out with “current” = none of them {FORM}"),
        ("give --sample-time SECONDS", f"give the time between rows {FORM}"),
        ("with --method sliding and", "with the method sliding under “Options” and"),
        ("/tmp/x/models/model-1/model.toml holds no motion", "model.toml holds no motion"),
        ("give --torque-constant NM_PER_AMPERE", f"give the torque constant {FORM}"),
        ("leave these out with --leave-out A:B: lost", "leave these out with “Leave this part out”: lost"),
        ("give --side load, and", f"give “Measured on the side of” = load {FORM}, and"),
        ("name a law (--law)", "name a law (“Laws to choose among” under “Options”)"),
        ("give another file", "give another file"), ("--gears 3", "--gears 3"),
    ],
)  # fmt: skip
def test_an_option_becomes_a_field(said: str, shown: str) -> None:
    """And what is no option stays as it is."""
    assert in_the_page(said) == shown
