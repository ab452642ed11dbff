"""Messages refer to options, columns and units; every reader gets these in own words, and users' texts as they are."""

from __future__ import annotations

import argparse
import ast
import inspect
import pickle
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main, parser_of
from stickslip.core import messages
from stickslip.core.messages import Reader, Surface, axis_unit, rendered_for, shown_on, units_of_axis
from stickslip.verbs.reading import Reading

SOURCE = Path(ss.__file__).parent
T = np.arange(0.0, 2.0, 1e-3)
FORM, OPTIONS = "under “Columns and units”", "under “Options”"


@pytest.mark.parametrize(
    ("message", "command_line", "python", "page"),
    [
        (messages.name_option("torque_is"), "--torque-is", "torque_is", "`--torque-is` on the command line"),
        (messages.name_option("torque_is", "mean"), "--torque-is mean", 'torque_is="mean"',
         "`--torque-is mean` on the command line"),
        (messages.name_option("end", "1.5"), "--to 1.5", "end=1.5", "its end = 1.5"),
        (messages.name_option("to", "c99"), "--to c99", 'to="c99"', "`--to c99` on the command line"),
        (messages.name_option("pendulum", True), "--pendulum", "pendulum=True", f"“Gravity of a pendulum” {OPTIONS}"),
        (messages.name_option("leave_out", "1:4", "7:9"), "--leave-out 1:4 --leave-out 7:9",
         'leave_out=["1:4", "7:9"]', "“Leave this part out” = 1:4, 7:9"),
        (messages.name_option("lead", "MM"), "--lead MM", "lead=METRES", f"the lead of the screw {FORM}"),
        (messages.name_option("lead", "5"), "--lead 5", "lead=0.005", f"the lead of the screw {FORM} = 5"),
        (messages.name_options(gear_ratio="5", side="load", pendulum=True), "--gear-ratio 5 --side load --pendulum",
         'gear_ratio=5, side="load", pendulum=True',
         f"the gear ratio {FORM} = 5, “Measured on the side of” {FORM} = load, “Gravity of a pendulum” {OPTIONS}"),
        (messages.name_columns(torque="COLUMN:Nm"), "--map torque=COLUMN:Nm", 'map={"torque": "COLUMN:Nm"}',
         f"“torque” = its column in Nm {FORM}"),
        (messages.name_columns(sensor_torque="F [uN]:-uN"), "--map 'sensor_torque=F [uN]:-uN'",
         'map={"sensor_torque": "F [uN]:-uN"}', f"“sensor torque” = the column F [uN] in -uN {FORM}"),
        (messages.name_columns(time="a--b:s", load="none"), "--map time=a--b:s --map load=none",
         'map={"time": "a--b:s", "load": "none"}', f"“time” = the column a--b in s, “load” = none of them {FORM}"),
        (messages.name_parameter("fs"), "--set fs=..", 'values={"fs": ..}', "the value of fs"),
        (messages.name_setting("bits", "VALUE"), "--set bits=VALUE", 'settings={"bits": VALUE}', "the target's bits"),
        (messages.name_frozen("offset", 0), "--freeze offset=0", 'frozen=["offset"], values={"offset": 0}',
         "`--freeze offset=0` on the command line"),
        (messages.name_loop("kp=..,kd=.."), "--loop kp=..,kd=..", 'loop={"kp": .., "kd": ..}',
         f"“The drive's loop” {OPTIONS} (kp=..,kd=..)"),
        (messages.name_command("simulate"), "`stickslip simulate`", "`ss.simulate(...)`", "`stickslip simulate`"),
        (messages.ask_for_place(), "choose another place with --out", "choose another place", "choose another place"),
        (messages.name_file("/p/1/model.toml"), "/p/1/model.toml", "/p/1/model.toml", "model.toml"),
    ],
)  # fmt: skip
def test_each_reader_gets_own_words(message: str, command_line: str, python: str, page: str) -> None:
    shown = [rendered_for(f"say {message}, or", Reader(surface)) for surface in Surface]
    assert shown == [f"say {words}, or" for words in (command_line, python, page)]


@pytest.mark.parametrize("text", ["option", "columns\ufdd1a", "other\ufdd1a", ""])
@pytest.mark.parametrize("surface", Surface)
def test_what_imitates_a_reference_stays(text: str, surface: Surface) -> None:
    assert rendered_for(f"column \ufdd0{text}\ufdd2", Reader(surface)) == f"column \ufdd0{text}\ufdd2"


def test_arrays_have_units_and_no_columns() -> None:
    arrays = Reader(Surface.PYTHON, arrays=True)
    assert (
        rendered_for(messages.name_columns(torque="COLUMN:Nm"), arrays)
        == 'torque=..., units={"torque": "Nm"}'
    )
    assert rendered_for(messages.name_columns(motor_torque="tau:-N·m"), arrays) == 'units={"torque": "-N·m"}'
    assert rendered_for(messages.name_columns(load="none"), arrays) == "normal_force=None"


@pytest.mark.parametrize("surface", Surface)
@pytest.mark.parametrize("name", ["axis--from-plc/log.csv", "x--position/--map a=b.csv", "q rad/N·m.csv"])
def test_a_path_is_never_rewritten(surface: Surface, name: str) -> None:
    """The first one became /data/axisfrom_plc/log.csv."""
    with shown_on(surface), pytest.raises(ss.InputError) as error:
        ss.read(f"/data/{name}")
    assert str(error.value) == f"no file /data/{name}; check the path"


@pytest.mark.parametrize("surface", Surface)
def test_a_column_is_never_rewritten(surface: Surface, tmp_path: Path) -> None:
    """A column `q rad` of a linear axis became `q m`, one called `a--to b` became `aend b`."""
    file = tmp_path / "log.csv"
    table = np.column_stack([T, np.sin(T), np.cos(T)])
    np.savetxt(file, table, "%.6f", ",", header="time [s],q rad,a--to b", comments="")
    with shown_on(surface), units_of_axis(True), pytest.raises(ss.InputError) as error:
        ss.read(file, map={"time": "time [s]", "position": "q rad:furlong", "motor_torque": "a--to b:N"})
    assert "q rad" in str(error.value)
    with shown_on(surface), pytest.raises(ss.InputError) as error:
        ss.read(file, map={"position": "q rad:rad", "motor_torque": "a--to b:furlong"})
    assert "a--to b" in str(error.value)


def test_the_path_of_a_linear_model_keeps_the_letters_of_units(tmp_path: Path) -> None:
    """The folder `q rad` became `q m` in the notes of an export."""
    folder = tmp_path / "q rad, N·m"
    folder.mkdir()
    (folder / "axis.toml").write_text(
        'law = "coulomb"\nmotion = "linear"\n[parameters]\nfc = 54.0\nsigma2 = 64.0\n[recommended]\n'
        'compensator = "feedforward"\ngain = 1.0\nbandwidth = 10.0\ndamping = 1.0\ninertia = 30.0\n'
        "inertia_feedforward = 30.0\noffset = -0.5\nsample_time = 5e-4\ntorque_limit = 600.0\n",
        encoding="utf-8",
    )
    notes = " ".join(ss.export(folder / "axis.toml", to="c99").notes)
    assert f"{folder / 'axis.toml'} recommends" in notes
    assert "offset -0.5 N, inertia feedforward 30 kg:" in notes


def test_an_error_names_what_was_called(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same mistake, from arrays, from a mapping and from the command line."""
    log = {"t": T, "position": np.sin(T)}
    with pytest.raises(ss.InputError, match=r'\(torque=\.\.\., units=\{"torque": "UNIT"\}\)') as error:
        ss.identify(**log)
    assert "--" not in str(error.value)
    with pytest.raises(ss.InputError, match=r'\(map=\{"torque": "COLUMN:UNIT"\}\)'):
        ss.identify({"time [s]": T, "position [rad]": np.sin(T)})
    file = tmp_path / "log.csv"
    table = np.column_stack([*log.values()])
    np.savetxt(file, table, "%.6f", ",", header="time [s],position [rad]", comments="")
    assert main(["identify", str(file), "--out", str(tmp_path)]) == 2
    assert "(--map torque=COLUMN:UNIT)" in capsys.readouterr().err


def test_what_is_printed_names_them_too() -> None:
    found = ss.doctor(t=T, position=np.sin(7.0 * T), torque=-np.cos(7.0 * T), velocity=-np.cos(7.0 * T))
    assert 'say units={"torque": "-N·m"}' in str(found)
    assert "--" not in str(found)
    assert "--map" not in found.errors[0].line()


def test_findings_of_the_reading_are_written_for_who_reads_the_record_then(tmp_path: Path) -> None:
    """They are kept with the record: the page reads what another process has saved."""
    file = tmp_path / "log.csv"
    table = np.column_stack([T, np.sin(7.0 * T), np.cos(7.0 * T)])
    np.savetxt(file, table, "%.6f", ",", header="time [s],position [rad],torque [Nm]", comments="")
    ss.read(file, gear_ratio=50.0).save(tmp_path / "log.npz")
    for surface, words in (
        (Surface.COMMAND_LINE, "--side load makes"), (Surface.PYTHON, 'side="load" makes'),
        (Surface.PAGE, "“Measured on the side of” under “Columns and units” = load makes"),
    ):  # fmt: skip
        with shown_on(surface):
            assert f"{words} a record of the load's side" in str(
                ss.doctor(ss.Record.load(tmp_path / "log.npz"))
            )


def test_an_error_of_another_process_is_written_here() -> None:
    error = pickle.loads(pickle.dumps(ss.InputError(f"give {messages.name_option('sample_time')}")))
    with shown_on(Surface.COMMAND_LINE):
        assert str(error) == "give --sample-time"
    assert str(error) == "give sample_time"


def test_a_note_keeps_its_code() -> None:
    note = messages.Note(f"leave {messages.name_option('delay')} out", "timing")
    (shown,) = messages.rendered([note])
    assert shown == "leave delay out"
    assert messages.code_of(shown) == messages.code_of(pickle.loads(pickle.dumps(note))) == "timing"
    assert messages.code_of("leave delay out") == ""


@pytest.mark.parametrize(
    ("angular", "linear"),
    [("N·m", "N"), ("N*m*s/rad", "N*s/m"), ("kg·m²", "kg"), ("rad/s²", "m/s²"), ("kg.m2", "kg"), ("-", "-")],
)  # fmt: skip
def test_units_of_a_linear_axis(angular: str, linear: str) -> None:
    with units_of_axis(True):
        assert axis_unit(angular) == axis_unit(linear) == linear
    assert axis_unit(angular) == angular


# ---- every message of the package -----------------------------------------------------------------------------------

MAKERS: dict[str, Callable[..., str]] = {
    name: f for name, f in vars(messages).items() if name.startswith(("name_", "ask_for_"))
}
CODE = re.compile(r"`[^`]*`")
NOT_MESSAGES = ("cli", "core/messages.py")
"""What is written for the command line alone, and what writes the references."""
COMMANDS = {
    "report/next_steps.py", "report/after_a_map.py", "report/recommended.py",  # commands to copy
    "exports/arduino.py", "exports/linuxcnc.py", "exports/matlab.py", "web/jobs.py",  # of other programs
    "web/worker.py",  # of other programs
    "web/server.py",  # said in the terminal before there is a page
}  # fmt: skip


def modules() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(SOURCE.rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if not name.startswith(NOT_MESSAGES):
            yield name, ast.parse(path.read_text(encoding="utf-8"))


def references() -> Iterator[tuple[str, str]]:
    """Place and text of every reference in a message, its values replaced where they are not known before."""
    for name, tree in modules():
        for node in ast.walk(tree):
            if not (
                isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS
            ):
                continue
            values = [a.value if isinstance(a, ast.Constant) else "1" for a in node.args]
            if node.func.id == "name_option" and node.args and not isinstance(node.args[0], ast.Constant):
                continue  # the argument comes from a table; its name is not known here
            named = {k.arg or "position": k.value for k in node.keywords}
            roles = {k: v.value if isinstance(v, ast.Constant) else "COLUMN" for k, v in named.items()}
            yield f"{name}:{node.lineno}", MAKERS[node.func.id](*values, **roles)


REFERENCES = sorted({text: place for place, text in references()}.items(), key=lambda x: x[1])


def test_references_are_found() -> None:
    assert len(REFERENCES) > 100


@pytest.mark.parametrize("surface", Surface)
def test_every_reference_is_written_for_every_reader(surface: Surface) -> None:
    """No option in Python and in the page, no argument on the command line."""
    for text, place in REFERENCES:
        shown = CODE.sub("", rendered_for(text, Reader(surface)))
        assert not set(shown) & {messages.START, messages.SEPARATOR, messages.END}, place
        if surface is Surface.COMMAND_LINE:
            assert not re.search(r"=True|=[\[{\"]", shown), place
        else:
            assert "--" not in shown, place


def options_of(parser: argparse.ArgumentParser) -> Iterator[str]:
    for action in parser._actions:
        yield from action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                yield from options_of(sub)


def test_every_option_of_a_message_exists() -> None:
    """On the command line, and as an argument of a function, but for what the command line alone has."""
    options = set(options_of(parser_of()))
    arguments = set(Reading.__annotations__)
    for verb in (ss.identify, ss.recommend, ss.export, ss.doctor, ss.stability, ss.sweep, ss.study, ss.tune):
        arguments |= set(inspect.signature(verb).parameters)
    alone = {"force", "confirm", "without_watchdog"}
    for text, place in REFERENCES:
        kind, *parts = text.strip(messages.START + messages.END).split(messages.SEPARATOR)
        for name in {"option": parts[:1], "options": parts[::2]}.get(kind, []):
            assert messages.flag(name) in options, place
            assert name in arguments | alone, place


def strings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Literals that are no docstrings, nor the documentation of a constant."""
    documentation: set[int] = set()
    for node in ast.walk(tree):
        body: Any = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else []:
            if isinstance(statement, ast.Expr):
                documentation.add(id(statement.value))
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            documentation.update(map(id, node.values))
            yield (
                node.lineno,
                "".join(part.value if isinstance(part, ast.Constant) else "1" for part in node.values),
            )
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation:
            yield node.lineno, node.value


def test_no_message_is_written_for_one_reader() -> None:
    """The name of an option stands in no sentence of the library, but for commands in backticks."""
    for name, tree in modules():
        if name in COMMANDS:
            continue
        for line, text in strings(tree):
            said = CODE.sub("", text)
            assert not re.search(r"--[a-z]", said), f"{name}:{line}"
