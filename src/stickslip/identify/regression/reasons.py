"""Why numbers of certain sliding are not to be believed, in sentences."""

LEVEL_UNTOLD = (
    "extrapolated: friction may still fall at the highest recorded speeds, and viscous friction is not distinguished "
    "from it"
)
AT_ONE_SPEED = (
    "extrapolated: the slowest gross sliding is at {share:.0%} of the highest speed, where level and slope of "
    "friction are one number; record slower moves, too"
)
STILL_ROUGH = "motor and load do not move as one even in the windows in which they do so best, and "
UNSURE_THERE = "it is unsure to {share:.0%} there; identified means at most {most:.0%}"
NOT_AS_ONE = "the axis does not follow its torque as one inertia does"
APART = (
    f"{NOT_AS_ONE}, or slides too briefly: what its acceleration needs is unsure to {{share:.2g}} of Fc; record longer "
    "and gentler motion"
)
COGGING = "the torque over the position (cogging, unbalance) is"
COGGED = (
    f"{COGGING} {{ratio:.2g}} times the level of friction, so the torque that the acceleration needs is uncertain to "
    "{share:.2g} of Fc; record slow turns at constant speed in both directions"
)
DROWNED = (
    "friction is too small beside the torque that accelerates, which is unsure to {share:.2g} of Fc; record longer and "
    "gentler motion"
)
BEYOND_LEVEL = (
    f"{NOT_AS_ONE}: more than twice the level of friction is left "
    "unexplained where it slides; record gentler motion"
)
DRIVES = (
    "the level of friction comes out below 0, so that it would drive the axis: the columns do not belong together, "
    "or something else moves it (cogging at one speed); record moves at several speeds, all columns by one clock"
)
UNMOVED = (
    "the torque shows neither the inertia nor the weight of the pendulum, so the column is not the torque that moves "
    "the axis: the drive or robot may have subtracted gravity and inertia, or it is a command that follows the "
    "direction of motion alone; map the motor's own torque or current, or leave out --pendulum if no weight acts"
)
