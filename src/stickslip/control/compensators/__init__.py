"""What cancels friction: one file a compensator. `COMPENSATORS` names them."""

COMPENSATORS = ("feedforward", "feedback")
