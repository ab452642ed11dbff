"""Messages of the package name options of the command line; whoever called a function is told its arguments."""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, cast

_options: ContextVar[bool] = ContextVar("stickslip_options", default=False)

NAMES = {
    "from": "start", "freeze": "frozen", "hold-out": "hold_out", "out": "folder", "position": "position_map",
    "torque": "torque_channel", "validation": "hold_out", "with": "beside",
}  # fmt: skip
"""Arguments that are not called as their option is"""
LISTS = ("accept", "free", "frozen", "leave_out")
SWITCHES = ("inverse", "load", "nearest", "pendulum", "per_direction", "unwrap")
SIGNALS = {"time": "t", "position_reference": "reference", "motor_torque": "torque", "load": "normal_force"}
"""Arguments that arrays are given by, where their channel has another name"""
CODE = re.compile(r"(`[^`]*`)")
ALLOW = re.compile(r"give --allow-code \(in Python: (`[^`]*`)\)")
PLACE = re.compile(r"choose another place with --out")
MAP = r"--(?:motion-)?map (?:'[^'=]+=[^']+'|\w+=[^\s,;)]*[^\s,;:)])"
MAPS = re.compile(rf"({MAP}(?: {MAP})*)( (?=--))?")
ONE_MAP = re.compile(r"--(?:motion-)?map (?:'([^']+)'|(\S+))")
SET = re.compile(r"--set (\w+)=(\.\.|[^\s,;:)]*)")
FREEZE = re.compile(r"--freeze (\w+)=([^\s,;:)]+)")
LOOP = re.compile(r"--loop (\w+=[^\s;)]*[^\s;),:])")
TIMING = re.compile(r"--torque-is (commanded|actual|mean)\b")
SIMULATE = "`stickslip simulate`"
"""The command that is a function, in messages that name nothing but the command"""
SAME_LISTS, ITEM = re.compile(r"(\w+)=\[[^\]]*\](?: \1=\[[^\]]*\])+"), re.compile(r"(?<=\[)[^\]]*(?=\])")
"""A list argument for each of several options, and what is in them"""
WORD = "side|method|compensator|to|intervals|linear|accept|leave-out|extra-torque"
OPTION = re.compile(
    rf"--(?:(?P<option>{WORD})(?![\w-])(?: (?P<word>(?!out\b|and\b|or\b)[\w:.-]*\w))?"
    r"|(?P<other>[a-z][a-z-]*)(?: (?P<value>-?[0-9][0-9.e+-]*(?::[0-9]+)?|[A-Z][A-Z_:.a-z]*|inf|nan)(?![\w-]))?)"
)


@contextmanager
def with_options() -> Generator[None]:
    """Where the command line, or a page that has words of its own, prints what goes wrong: its options stay."""
    before = _options.set(True)
    try:
        yield
    finally:
        _options.reset(before)


def in_python(text: str, function: str = "", arrays: bool = False) -> str:
    """A message with arguments in the place of options; commands in backticks stay.

    Parameters
    ----------
    text : str
        Such as ``if a column holds it, say --map torque=COLUMN:Nm``.
    function : str
        The one that was called: what `--set` and `--to` are depends on it.
    arrays : bool
        Whether signals were given as arrays, which have units and no columns.
    """
    if _options.get():
        return text
    text = text.replace(SIMULATE, "`ss.simulate(...)`")
    if "--" not in text:
        return text
    text = ALLOW.sub(r"use \1", text)
    parts = CODE.split(text)
    return "".join(p if p.startswith("`") else _said(p, function, arrays) for p in parts)


def data_in_python(data: Any, function: str) -> Any:
    """Plain data, its texts as `in_python` says them."""
    if isinstance(data, str):
        return in_python(data, function)
    if isinstance(data, Mapping):
        return {k: data_in_python(v, function) for k, v in cast("Mapping[Any, Any]", data).items()}
    if isinstance(data, list):
        return [data_in_python(x, function) for x in cast("list[Any]", data)]
    return data


def _said(text: str, function: str, arrays: bool) -> str:
    """Of a part that is no command."""
    settings = "settings" if function == "export" else "values"
    text = PLACE.sub("choose another place", text)
    text = MAPS.sub(lambda m: _map(m[1], arrays) + (", " if m[2] else ""), text)
    text = SET.sub(lambda m: f'{settings}={{"{m[1]}": {m[2] or ".."}}}', text)
    text = FREEZE.sub(r'frozen=["\1"], values={"\1": \2}', text)
    text = TIMING.sub(r'torque_is="\1"', text)
    text = LOOP.sub(lambda m: "loop={" + ", ".join(_item(x, "=") for x in m[1].split(",")) + "}", text)
    text = OPTION.sub(lambda m: _argument(m, function), text)
    return SAME_LISTS.sub(lambda m: f"{m[1]}=[{', '.join(ITEM.findall(m[0]))}]", text)


def _map(options: str, arrays: bool) -> str:
    """What `--map` or `--motion-map`, one or several, is in Python."""
    every = [(quoted or bare).partition("=")[::2] for quoted, bare in ONE_MAP.findall(options)]
    if not arrays:
        name = "motion_map" if options.startswith("--motion") else "map"
        return name + "={" + ", ".join(f'"{role}": "{column}"' for role, column in every) + "}"
    said: list[str] = []
    for role, column in every:
        name, unit = SIGNALS.get(role, role), column.rpartition(":")[2] if ":" in column else ""
        given = {"COLUMN": "...", "none": "None"}.get(column.partition(":")[0])
        said += [f"{name}={given}"] if given else []
        said += [f'units={{"{name}": "{unit}"}}'] if unit else []
    return ", ".join(said)


def _item(text: str, sign: str) -> str:
    """``kp=..`` as an item of a mapping."""
    name, _, value = text.partition(sign)
    return f'"{name}": {value}'


def _argument(found: re.Match[str], function: str) -> str:
    """An option, with what stands behind it where that is its value."""
    option, value = found["option"] or found["other"], found["word"] or found["value"] or ""
    name = NAMES.get(option, option.replace("-", "_"))
    if option == "to" and function != "export":
        name = "end"
    if option == "set":
        name = "settings" if function == "export" else "values"
    if not value:
        return (
            f"{name}=True"
            if name in SWITCHES and found.string[found.end() : found.end() + 1] != ":"
            else name
        )
    if name == "lead":
        value = {"MM": "METRES"}.get(value, value)
    plain = value[0] in "-0123456789" or value in ("inf", "nan") or value.isupper()
    value = value if plain and ":" not in value else f'"{value}"'
    return f"{name}=[{value}]" if name in LISTS else f"{name}={value}"
