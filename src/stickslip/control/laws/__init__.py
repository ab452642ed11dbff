"""What moves the axis: one file a control law. `CONTROL_LAWS` names them, `stickslip.plugins.control_law` finds them.

To add a control law, write its file and add its name to this tuple.
"""

CONTROL_LAWS = (
    "pr",
    "pd",
    "pid",
    "cascade",
    "boundary_layer",
    "super_twisting",
    "friction_feedforward",
    "inertia_feedforward",
    "dither",
    "friction_feedback",
    "friction_observer",
    "coulomb_observer",
    "disturbance_observer",
    "extended_state_observer",
    "stiction_push",
)
