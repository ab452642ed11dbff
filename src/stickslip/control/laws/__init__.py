"""What moves the axis: one file a control law. `CONTROL_LAWS` names them, `stickslip.plugins.control_law` finds them.

To add a control law, write its file and add its name to this tuple.
"""

CONTROL_LAWS = (
    "pr",
    "pd",
    "pid",
    "cascade",
    "friction_feedforward",
    "inertia_feedforward",
    "friction_feedback",
    "disturbance_observer",
)
