"""Messages of the package, which name options of the command line, in the words of the page's forms."""

from __future__ import annotations

import re

FORM = "under “Columns and units”"
MAP = re.compile(r"--map (?:'(?P<quoted>[^']+)'|(?P<bare>[^\s,;)]+))(?P<again>(?: --map [^\s,;)]+)*)")
PATH = re.compile(r"\S*[/\\](?=(?:model|study|recommended)\.toml)")
"""Of a file of our own, before its name"""
METHOD = re.compile(r"--method (\w+)")
OPTIONS = {
    "--counts-per-rev": f"the counts a revolution {FORM}", "--rated-torque": f"the rated torque {FORM}",
    "--rated-current": f"the rated current {FORM}", "--torque-constant": f"the torque constant {FORM}",
    "--force-constant": f"the force constant {FORM}",
    "--pole-pairs": f"the pole pairs {FORM}",
    "--gear-ratio": f"the gear ratio {FORM}", "--lead": f"the lead of the screw {FORM}",
    "--sample-time": f"the time between rows {FORM}", "--leave-out": "“Leave this part out”",
    "--unwrap": "“Count the position on”", "--inertia": "“Inertia” under “Options”",
    "--law": "“Laws to choose among” under “Options”", "--loop": "“The drive's loop” under “Options”",
    "--drive-gain": "“Torque for each unit of the drive's signal” under “Options”",
    "--pendulum": "“Gravity of a pendulum” under “Options”", "--amplitude": "“amplitude” under “Options”",
    "--per-direction": "“Friction of its own in each direction” under “Options”",
    "--nearest": "“Take the nearest that it can hold”", "--bandwidth": "the bandwidth",
    "--torque-limit": "the torque limit", "--from": "the begin of the part", "--to": "its end",
    "--rows": "the part that is used", "--side": f"“Measured on the side of” = load {FORM}",
}  # fmt: skip
VALUES = r"(?: (?:A:B|NM|MM|N|SECONDS|TORQUE|HZ|NUMBER|VALUE|load|[A-Z_]{2,}))?(?![\w-])"
OPTION = re.compile("|".join(re.escape(name) + VALUES for name in sorted(OPTIONS, key=len, reverse=True)))


def in_the_page(text: str) -> str:
    """The message with the form's words where it names an option that a form of the page has.

    Parameters
    ----------
    text : str
        Such as ``if a column holds it, say --map torque=COLUMN:Nm``.
    """
    text = PATH.sub("", text)
    text = METHOD.sub(r"the method \1 under “Options”", MAP.sub(mapped, text))
    return OPTION.sub(lambda m: OPTIONS[m[0].partition(" ")[0]], text)


def mapped(found: re.Match[str]) -> str:
    """``--map position=q:deg`` as the form has it: “position” = the column q in deg."""
    every = [found["quoted"] or found["bare"], *found["again"].split(" --map ")[1:]]
    said: list[str] = []
    for one in every:
        role, _, column = one.partition("=")
        name, _, unit = column.rpartition(":") if ":" in column else (column, "", "")
        which = {"none": "none of them", "COLUMN": "its column", "": "its column"}.get(
            name, f"the column {name}"
        )
        measure = "" if not unit else " with its unit" if unit == "UNIT" else f" in {unit}"
        said.append(f"“{role.replace('_', ' ')}” = {which}{measure}")
    return f"{', '.join(said)} {FORM}"
