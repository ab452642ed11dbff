"""A process that stays warm and simulates one case after another: a line of JSON in, a line of JSON out."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError, StickslipError
from stickslip.web.worker import plain

CHANNELS = ("position_reference", "position", "error", "velocity", "motor_torque", "friction_torque")
POINTS = 1200


def main() -> int:
    """Simulate until stdin ends."""
    channel = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="replace")
    os.dup2(2, 1)
    warnings.simplefilter("ignore")
    for line in sys.stdin:
        # A folder for each case: this process is terminated from outside and would leave a permanent one behind.
        with tempfile.TemporaryDirectory(prefix="stickslip-") as folder:
            answer = answered(json.loads(line), Path(folder) / "case.toml")
        channel.write(json.dumps(plain(answer), ensure_ascii=False, allow_nan=False) + "\n")
        channel.flush()
    return 0


def answered(request: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return the result of a case, or the reason for none."""
    from stickslip.web.cases import toml_of

    try:
        path.write_text(toml_of(request["case"]), encoding="utf-8")
        return simulated(path)
    except StickslipError as error:
        return {"error": " ".join(str(error).replace(str(path), "the case").split())}
    except Exception as error:  # one case must not end the process needed for the next
        return {"error": f"this failed ({type(error).__name__}: {' '.join(str(error).split())[:300]})"}


def simulated(path: Path) -> dict[str, Any]:
    """Return channels, thinned for a picture, and metrics of a `stickslip simulate` file, as computed by that
    command."""
    from stickslip.studies.study import execute, load_run

    planned = load_run(path)
    planned.check()
    executed = execute(planned)
    if executed.failure:
        raise InputError(executed.failure)
    record = executed.record
    step = max(1, -(-len(record) // POINTS))
    keep = slice(None, None, step)
    channels = {name: record[name][keep] for name in CHANNELS if name in record.channels}
    if "error" not in channels and {"position", "position_reference"} <= set(channels):
        channels["error"] = channels["position_reference"] - channels["position"]
    units = {name: record.units.get(name, "rad") for name in channels}
    return {"time": record.time[keep], "channels": channels, "units": units, "metrics": executed.metrics}


if __name__ == "__main__":
    sys.exit(main())
