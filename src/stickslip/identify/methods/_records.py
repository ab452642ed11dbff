"""What methods that need records alone share: the channel of the torque, the sliding curve known before."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from stickslip.errors import InputError, UnknownName
from stickslip.identify.methods.method import Options
from stickslip.record import Record

TORQUES = ("motor_torque", "torque", "sensor_torque", "friction_torque")
CURVE = ("fs", "fc", "vs", "delta_s", "sigma2")


def torque_channel(records: Sequence[Record], options: Options, method: str) -> str:
    """The channel of the torque: the one named, or the first known one that all records have."""
    have = [set(r.channels) for r in records]
    if options.torque:
        for channels in have:
            if options.torque not in channels:
                raise UnknownName("channel", options.torque, sorted(channels))
        return options.torque
    for name in TORQUES:
        if all(name in channels for channels in have):
            return name
    raise InputError(
        f"{method} needs a torque in every record; map a column with --map torque=COLUMN:UNIT, or give "
        "--torque-constant for a current (of a linear motor --force-constant)"
    )


def has_torque(method: str) -> Callable[[Sequence[Record], Options], None]:
    """The check of a method: every record has a torque."""

    def check(records: Sequence[Record], options: Options) -> None:
        torque_channel(records, options, method)

    return check


def curve_values(options: Options, method: str) -> Mapping[str, float]:
    """Parameters of the sliding curve from the model and the values given."""
    found: dict[str, float] = {}
    if options.model is not None:
        known = options.model.parameters
        found = {n: float(getattr(known, n)) for n in CURVE if hasattr(known, n)}
    found |= {k: v for k, v in options.values.items() if k in CURVE}
    missing = [n for n in ("fs", "fc", "vs") if n not in found]
    if missing:
        raise InputError(
            f"--method {method} needs the sliding curve, which lacks {', '.join(missing)}; identify it with "
            "--method sliding and give --model model.toml, or --set fs=..,  --set fc=.. and --set vs=.."
        )
    return {"delta_s": 2.0, "sigma2": 0.0} | found


def single(records: Sequence[Record], method: str) -> Record:
    """The one record that a method takes."""
    if len(records) != 1:
        raise InputError(f"--method {method} takes one record, not {len(records)}; run it for each")
    return records[0]
