"""Sources of records: one file per kind of rig. `RIGS` lists them; `stickslip.rigs.kinds.rig_kind` looks them up.

To add a kind, write its file (`stickslip.rigs.rig` defines the interface) and add its name to this tuple; a rig outside
the package is registered by the entry point ``stickslip.rigs``.
"""

RIGS: tuple[str, ...] = ("virtual", "replay", "ds402")
