"""What the sampled controller of `support.sampled_text` is set to, and what it remembers."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from stickslip.core.spec import Par

__all__ = ["Memory", "Settings"]


class Settings(NamedTuple):
    """Numbers of a sampled controller."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain")]
    ki: Annotated[float, Par("N·m/(rad·s)", "k_i", "integral gain")]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the measured velocity")]
    kr: Annotated[float, Par("N·m·s/rad", "k_r", "gain on the reference velocity")]
    source: Annotated[
        float, Par("-", "", "0 no compensator, 1 driven by the reference, 2 by the measurement")
    ]
    gain: Annotated[float, Par("-", "", "factor on the compensating torque")]
    filter: Annotated[
        float, Par("rad/s", "omega_c", "corner of the compensator's velocity filter; 0 for none")
    ]
    torque_limit: Annotated[float, Par("N·m", "T_max", "largest torque")]
    sample_time: Annotated[float, Par("s", "T", "sample time")]
    lead: Annotated[float, Par("s", "", "time by which a feedforward looks ahead of the reference")]
    deadband: Annotated[float, Par("rad/s", "", "velocity below which the compensator's law sees rest")]
    kv: Annotated[
        float,
        Par(
            "1/s", "K_v", "position gain of a cascade, whose velocity PI has kd and ki (N·m/rad); 0 for none"
        ),
    ]
    feed: Annotated[float, Par("-", "", "part of the reference velocity that a cascade feeds forward")]
    slow: Annotated[
        float, Par("-", "", "part of its old value that the controller's velocity keeps a sample")
    ]
    fade: Annotated[
        float, Par("s", "", "over which a torque that was taken over, or held in a fault, fades; 0: at once")
    ]
    offset: Annotated[float, Par("N·m", "T_0", "constant torque that is fed forward")]
    inertia: Annotated[float, Par("kg·m²", "J", "inertia whose torque along the reference is fed forward")]
    clock: Annotated[float, Par("-", "", "1 where samples make the law's time, 0 where the caller gives it")]
    substeps: Annotated[float, Par("-", "", "steps of the law into which a sample is divided")]


class Memory(NamedTuple):
    """What the drive remembers from sample to sample."""

    started: Annotated[float, Par("-", "", "1 after the first sample")]
    turns: Annotated[float, Par("-", "", "measured position: whole turns; 0 where they are not counted")]
    position: Annotated[float, Par("rad", "theta", "measured position, less the whole turns")]
    velocity: Annotated[float, Par("rad/s", "v", "difference of measured positions over the sample time")]
    error: Annotated[float, Par("rad", "e", "reference less measured position")]
    error_sum: Annotated[
        float, Par("rad·s", "", "integral of the error; of a cascade: of its velocity's, rad")
    ]
    filtered: Annotated[float, Par("rad/s", "", "velocity that the linear controller sees")]
    wanted_velocity: Annotated[float, Par("rad/s", "", "reference velocity one sample ago")]
    seen: Annotated[float, Par("rad/s", "", "velocity that the compensator's law saw")]
    in_1: Annotated[float, Par("rad/s", "", "filter: input one sample ago")]
    in_2: Annotated[float, Par("rad/s", "", "filter: input two samples ago")]
    out_1: Annotated[float, Par("rad/s", "", "filter: output one sample ago")]
    out_2: Annotated[float, Par("rad/s", "", "filter: output two samples ago")]
    forward: Annotated[float, Par("-", "", "filter: weight of the inputs")]
    back_1: Annotated[float, Par("-", "", "filter: weight of the last output")]
    back_2: Annotated[float, Par("-", "", "filter: weight of the output before")]
    compensation: Annotated[float, Par("N·m", "T_hat", "compensating torque")]
    torque: Annotated[float, Par("N·m", "T_m", "torque that is held")]
    seconds: Annotated[float, Par("s", "", "time since the first sample, in whole seconds")]
    part: Annotated[float, Par("s", "", "the rest of that time")]
    waited: Annotated[float, Par("s", "", "time without a usable input since the last one")]
    growth: Annotated[
        float, Par("rad·s", "", "by which this sample lets the integral grow; of a cascade: rad")
    ]
    fault: Annotated[
        float, Par("-", "", "samples in a row whose inputs, or torque, were no numbers; 0: none")
    ]
    taken: Annotated[float, Par("N·m", "", "difference of the torque that was taken over from its own")]
    share: Annotated[float, Par("-", "", "of that difference that is left")]
    open: Annotated[
        float, Par("-", "", "1 while another has the axis, with `torque`: the next sample starts there")
    ]
