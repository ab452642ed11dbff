"""What friction is: one file a law. `LAWS` names them; `stickslip.models.plugins.law` looks them up.

To add a law, write its file and add its name to this tuple.
"""

COMMON_CHOICES = (
    "_symmetry.SYMMETRY",
    "modulation.POSITION",
    "modulation.LOAD",
    "modulation.TEMPERATURE",
    "modulation.TIME",
)
"""Choices of every law, whether its file names them or not."""

LAWS = (
    "coulomb",
    "viscous",
    "static",
    "stribeck_plain",
    "stribeck",
    "makkar",
    "karnopp",
    "armstrong",
    "dahl",
    "lugre",
    "elasto_plastic",
    "leuven",
    "maxwell_slip",
    "gms",
)
