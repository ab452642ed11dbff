"""What moves the axis: one file a control law; `CONTROL_LAWS` names them, `stickslip.control.registry` finds them.

To add a control law, write its file and add its name to this tuple.
"""

CONTROL_LAWS = (
    "pr",
    "pd",
    "pid",
    "gains",
    "cascade",
    "boundary_layer",
    "super_twisting",
    "robust_adaptive",
    "friction_feedforward",
    "scaled_feedforward",
    "least_squares_feedforward",
    "gradient_feedforward",
    "inertia_feedforward",
    "position_feedforward",
    "learned_feedforward",
    "table_feedforward",
    "dither",
    "friction_feedback",
    "friction_observer",
    "lugre_observer",
    "dual_observer",
    "coulomb_observer",
    "adaptive_friction",
    "adaptive_gms",
    "disturbance_observer",
    "extended_state_observer",
    "stiction_push",
    "nonlinear_coulomb",
    "nonlinear_maxwell_slip",
    "knocker",
)
