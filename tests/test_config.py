"""The reader of TOML files: what it hands out, what it refuses, and that nothing but InputError leaves it."""

from __future__ import annotations

import copy
import math
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stickslip.core.config import Document, Table, read_toml
from stickslip.core.errors import ConfigError, InputError, ModelRemark
from stickslip.studies.plan import load, load_run

DATA = Path(__file__).parent / "data"


def table(text: str) -> Table:
    return Table(tomllib.loads(text), Document("a.toml", Path()))


def test_values_are_handed_out() -> None:
    with table('n = 3\nx = 0.5\ns = "low"\nl = ["a"]\nk = [1, 2.5]\n[t.u]\nv = 1.0') as t:
        assert t.number("n", "rad") == 3.0
        assert isinstance(t.number("n", "rad"), float)
        assert t.positive("x", "s") == 0.5
        assert t.number("missing", "s", 7.0) == 7.0
        assert t.choice("s", ("low", "high")) == "low"
        assert t.texts("l", ("a", "b")) == ["a"]
        assert t.table("t").table("u").number("v", "rad") == 1.0
        assert t.rest() == {"k": [1.0, 2.5]}


def test_truth_values_are_true_and_false_and_yes_and_no_are_read_with_a_hint() -> None:
    t = table('a = true\nb = false\nc = "yes"\nd = "no"\ne = "maybe"\nf = 1')
    assert (t.flag("a", False), t.flag("b", True), t.flag("missing", True)) == (True, False, True)
    with pytest.warns(ModelRemark, match="a.toml: c = 'yes' is read as true; write c = true"):
        assert t.flag("c", False) is True
    with pytest.warns(ModelRemark, match="write d = false"):
        assert t.flag("d", True) is False
    for key, shown in (("e", "'maybe'"), ("f", "1")):
        with pytest.raises(ConfigError, match=f"a.toml: {key} = {shown} must be true or false"):
            t.flag(key, True)


@pytest.mark.parametrize(
    ("text", "ask", "line"),
    [
        ("x = -1", lambda t: t.positive("x", "s"), "a.toml: x = -1 must be greater than 0 s"),
        ("x = -1", lambda t: t.number("x", "s", lower=0.0), "a.toml: x = -1 must be at least 0 s"),
        ("x = 'a'", lambda t: t.number("x", "rad"), "a.toml: x = 'a' must be a number in rad"),
        ("x = nan", lambda t: t.number("x", "rad"), "a.toml: x = nan must be a finite number in rad"),
        ("y = 1", lambda t: t.number("x", "rad"), "a.toml: x is missing; give a number in rad"),
        ("xx = 1", lambda t: t.number("x", "rad"), "a.toml: x is missing; did you misspell it as 'xx'?"),
        ("x = 1", lambda t: t.text("x"), "a.toml: x = 1 must be a string in quotes"),
        ("x = 'lo'", lambda t: t.choice("x", ("low",)), "a.toml: x = 'lo' is not known; did you mean 'low'?"),
        ("x = 'a'", lambda t: t.choice("x", ("u", "v")), "a.toml: x = 'a' is not known; choose from u, v"),
        (
            "[a.b]\nx = 1",
            lambda t: t.table("a").table("b").close(),
            "a.toml: a.b.x: unknown key; allowed are none",
        ),
    ],
)
def test_refusals_are_one_line(text: str, ask: Any, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        ask(table(text))
    assert str(caught.value) == line


def test_a_key_nobody_asked_for_is_refused_with_the_nearest() -> None:
    def read() -> None:
        with table("lenght = 1.0") as t:
            t.number("length", "m", 1.0)

    with pytest.raises(ConfigError, match="lenght: unknown key; did you mean 'length'"):
        read()


def test_an_error_inside_is_not_hidden_by_the_keys_left_over() -> None:
    def read() -> None:
        with table("a = 1\nb = 2"):
            raise ValueError("first")

    with pytest.raises(ValueError, match="first"):
        read()


def test_syntax_errors_name_line_and_column(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("a = 1\nb = = 2\n")
    with pytest.raises(ConfigError, match=r"x\.toml: invalid TOML: .*line 2, column 5"):
        read_toml(tmp_path / "x.toml")


# ---- any change of a valid file parses, or is refused by an InputError of one line --------------------------------


def places(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every key and index of a parsed file."""
    inside = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return [p for key, value in inside for p in ((*path, key), *places(value, (*path, key)))]


ODD_VALUES: st.SearchStrategy[Any] = st.one_of(
    st.sampled_from(
        [
            0,
            -1,
            1e308,
            -1e-320,
            10**400,
            math.nan,
            math.inf,
            True,
            "",
            "gms",
            "a\nb",
            "../x",
            "\0",
            "\0.py",
            "motion.csv",
            ".",
            [],
            {},
        ]
    ),
    st.floats(allow_nan=True),
    st.integers(),
    st.text(max_size=8),
    st.lists(st.one_of(st.floats(), st.text(max_size=3)), max_size=4),
    st.dictionaries(st.text(max_size=5), st.floats(), max_size=2),
)


@st.composite
def mutations(draw: st.DrawFn, original: dict[str, Any]) -> dict[str, Any]:
    """The file with up to three keys deleted, renamed, given another value or another type."""
    tree = copy.deepcopy(original)
    for _ in range(draw(st.integers(1, 3))):
        known = places(tree)
        if not known:
            break
        *path, key = draw(st.sampled_from(known))
        home = tree
        for step in path:
            home = home[step]
        action = draw(st.sampled_from(["delete", "rename", "value", "number", "add"]))
        if action == "delete":
            del home[key]
        elif action == "rename" and isinstance(home, dict):
            home[draw(st.text(max_size=6))] = home.pop(key)
        elif action == "add" and isinstance(home, dict):
            home[
                draw(
                    st.sampled_from(
                        ["law", "like", "scale", "k", "gain", "placement", "file", "plugins", "x"]
                    )
                )
            ] = draw(ODD_VALUES)
        elif action == "number" and isinstance(home[key], float):
            home[key] = home[key] * draw(st.floats(-10.0, 10.0))
        else:
            home[key] = draw(ODD_VALUES)
    return tree


def one_line(message: str) -> bool:
    return bool(message) and "\n" not in message


def loads_or_is_refused(load: Any, name: str, tree: dict[str, Any], folder: Path, monkeypatch: Any) -> str:
    """What is said of a changed file: "fine", or why it is refused."""
    monkeypatch.setattr("stickslip.core.config.tomllib.loads", lambda text: tree)
    message = "fine"
    try:
        load(folder / name)
    except InputError as error:
        message = str(error)
    return message


STUDY = tomllib.loads((DATA / "small_study.toml").read_text())
RUN = tomllib.loads((DATA / "one_run.toml").read_text())
QUICK = settings(max_examples=150, suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("config")
    for name in ("small_study.toml", "one_run.toml", "motion.csv"):
        shutil.copy(DATA / name, made)
    return made


@QUICK
@given(tree=mutations(STUDY))
def test_any_change_of_a_study(folder: Path, tree: dict[str, Any]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        assert one_line(loads_or_is_refused(load, "small_study.toml", tree, folder, patch))


@QUICK
@given(tree=mutations(RUN))
def test_any_change_of_one_run(folder: Path, tree: dict[str, Any]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        assert one_line(loads_or_is_refused(load_run, "one_run.toml", tree, folder, patch))


@QUICK
@given(text=st.text(alphabet="[]{}=\"'\n.,#01eab-_ \x00\u00e9", max_size=60))
def test_any_text(folder: Path, text: str) -> None:
    path = folder / "text.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        load(path)


@QUICK
@given(data=st.binary(max_size=80))
def test_any_bytes_as_a_table_of_points(folder: Path, data: bytes) -> None:
    (folder / "odd.csv").write_bytes(data)
    tree = copy.deepcopy(STUDY)
    tree["references"]["points"]["file"] = "odd.csv"
    with pytest.MonkeyPatch.context() as patch:
        assert one_line(loads_or_is_refused(load, "small_study.toml", tree, folder, patch))
