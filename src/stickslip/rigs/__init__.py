"""Where records come from: one file a kind of rig. `RIGS` names them; `stickslip.rigs.kinds.rig_kind` looks them up.

To add a kind, write its file (`stickslip.rigs.rig` says what it must do) and add its name to this tuple; a rig that
should not enter the package is offered by the entry point ``stickslip.rigs``. Compiled loops live in files whose name
begins with an underscore: the cache of compiled code watches those.
"""

RIGS: tuple[str, ...] = ("virtual", "replay", "ds402")
