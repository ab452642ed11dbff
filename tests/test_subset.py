"""The translation of the scalar subset: what it refuses, and how it says so."""

from __future__ import annotations

import ast
import math
from typing import Annotated, NamedTuple

import pytest

import stickslip as ss
from stickslip.core.errors import LawError
from stickslip.core.spec import Field, Par
from stickslip.subset import Layout, lower, named

LAYOUTS = {"p": Layout(("a", "b"), ("k", "m"), counted=True), "z": Layout(("x",), ("f", "h"))}


def scale(v, p):
    return p.a * v


def good(v, z, p):
    """Docstrings go."""
    total: float = 0.0
    for i in range(len(p.k)):
        if z.f[i] > 0.0 and v >= p.b:
            total += p.k[i] * z.f[i]
        else:
            total -= p.m[i]
    z.x = total
    z.f[0] = -z.x
    return scale(total, p) + math.exp(-abs(v))


def test_fields_become_elements():
    functions = lower({"good": good}, LAYOUTS)
    assert list(functions) == ["_scale", "good"]
    text = ast.unparse(functions["good"])
    assert "Docstrings" not in text
    assert text.count("int(p[2])") == 1
    assert "range(elements_)" in text
    assert "z[1 + i]" in text
    assert "p[3 + i]" in text
    assert "p[3 + (1 * elements_ + i)]" in text
    assert "_scale(total, p)" in text


def supplied(z, v):
    raise NotImplementedError


def tries(v, z):
    return supplied(z, 2.0 * v) + z.x


def test_what_is_given_is_called_and_not_translated():
    for translate, field in ((lower, "z[0]"), (named, "z.x")):
        functions = translate({"tries": tries}, LAYOUTS, ["supplied"])
        assert list(functions) == ["tries"]
        assert ast.unparse(functions["tries"].body[0]) == f"return _supplied(z, 2.0 * v) + {field}"


def test_translation_computes_the_same():
    text = "\n".join(ast.unparse(f) for f in lower({"good": good}, LAYOUTS).values())
    scope = {"math": math}
    exec(text, scope)

    class Bag:
        def __init__(self, **values):
            self.__dict__.update(values)

    p, z = Bag(a=2.0, b=0.5, k=(1.0, 2.0), m=(3.0, 4.0)), Bag(x=0.0, f=[0.5, -1.0])
    flat_p, flat_z = [2.0, 0.5, 2.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.5, -1.0]
    assert good(0.7, z, p) == scope["good"](0.7, flat_z, flat_p)
    assert flat_z == [z.x, *z.f]


def uses_while(v, p):
    while v > 1.0:
        v = v / 2.0
    return v


def uses_comprehension(v, p):
    return sum([k * v for k in p.k])


def uses_unknown_field(v, p):
    return p.aa * v


def uses_whole_block(v, p):
    return p.k * v


def uses_tuple(v, p):
    a, b = v, v
    return a + b


def uses_import(v, p):
    return open("x")


def uses_global_list(v, p):
    return NAMES[0] * v


def uses_keyword(v, p):
    return scale(v=v, p=p)


def uses_math_gamma(v, p):
    return math.gamma(v)


def uses_recursion(v, p):
    return uses_recursion(v - 1.0, p)


def uses_odd_loop(v, p):
    for k in p.k:
        v += k
    return v


def uses_string(v, p):
    return f"{v}"


def needs_parameters(z):
    return z.h[0]


NAMES = ["x"]


@pytest.mark.parametrize(
    ("function", "said", "remedy"),
    [
        (uses_while, "`While`", "for i in range"),
        (uses_comprehension, "sum()", "choose from|did you mean|scale"),
        (uses_unknown_field, "no field 'aa'", "did you mean 'a'|choose from a, b, k, m"),
        (uses_whole_block, "p.k as a whole", r"p\.k\[i\]"),
        (uses_tuple, "`Tuple`", "one name at a time"),
        (uses_import, "open()", "choose from|did you mean"),
        (uses_global_list, "index", r"z\.force\[i\]"),
        (uses_keyword, "keyword", "by position"),
        (uses_math_gamma, "math.gamma", "choose from|did you mean"),
        (uses_recursion, "calls itself", "loop"),
        (uses_odd_loop, "loop", "for i in range"),
        (uses_string, "`JoinedStr`", "only computes"),
        (needs_parameters, "without `p`", "pass the parameters"),
    ],
)
def test_refusals_name_file_line_and_remedy(function, said, remedy):
    with pytest.raises(LawError, match=remedy) as caught:
        lower({"f": function}, LAYOUTS)
    text = str(caught.value)
    assert said in text
    assert "test_subset.py, line " in text
    assert "\n" not in text


def test_source_that_cannot_be_read():
    scope: dict = {}
    exec("def f(v, p):\n    return v", scope)
    with pytest.raises(LawError, match="in a file of its own"):
        lower({"f": scope["f"]}, LAYOUTS)


def test_layout_of_fields():
    class Params(NamedTuple):
        k: Annotated[tuple[float, ...], Par("N·m/rad", "k", "stiffness")]
        c: Annotated[float, Par("N·m/s", "C", "attraction")]

    del Params
    fields = (Field("k", Par("-", "k", "k"), True), Field("c", Par("-", "c", "c"), False))
    assert Layout.of(fields, counted=True) == Layout(("c",), ("k",), True)


# ---- parts of structures -----------------------------------------------------------------------------------

PARTS = {
    "p": Layout(
        ("gain", "one_a", "one_b", "two_a", "two_b"),
        ("one_k", "one_m", "two_k", "two_m"),
        counted=True,
        pers=("one_element", "one_element", "two_element", "two_element"),
        parts=("one_", "two_"),
    ),
    "z": Layout(
        ("one_x", "two_x"),
        ("one_f", "one_h", "two_f", "two_h"),
        pers=("one_element", "one_element", "two_element", "two_element"),
        parts=("one_", "two_"),
    ),
    "m": Layout(("x",)),
}


def both(v, m, z, p):
    m.x = p.gain * good(v, z.one, p.one)
    return m.x + good(2.0 * v, z.two, p.two) + z.two.x + moved(v, z.one, z.two) + taken(m, p.two)


def moved(v, a, b):
    """Two parts of one structure, and a number that is called as the structure is."""
    z = v + a.x
    a.x = z
    return b.x - z


def taken(y, q):
    """Arguments that nothing else is called by; a number in the way of one."""
    m = 3.0
    return m * y.x + q.b


class Bag:
    def __init__(self, **values):
        self.__dict__.update(values)


def test_a_function_is_translated_for_each_part_that_it_is_called_with():
    functions = lower({"both": both}, PARTS)
    assert {"_one_good", "_two_good", "_one_scale", "_two_scale"} <= set(functions)
    assert [a.arg for a in functions["_one_moved"].args.args] == ["v", "z"]
    assert [a.arg for a in functions["_two_taken"].args.args] == ["m", "p"]
    scope = {"math": math}
    exec("\n".join(ast.unparse(f) for f in functions.values()), scope)
    one, two = Bag(a=2.0, b=0.5, k=(1.0, 2.0), m=(3.0, 4.0)), Bag(a=-1.0, b=0.1, k=(5.0,), m=(6.0,))
    p = Bag(gain=1.5, one=one, two=two)
    z = Bag(one=Bag(x=0.3, f=[0.5, -1.0], h=[0.0, 0.0]), two=Bag(x=0.2, f=[0.7], h=[0.0]))
    m = Bag(x=0.0)
    flat_p = [1.5, 2.0, 0.5, -1.0, 0.1, 2.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    flat_z = [0.3, 0.2, 0.5, -1.0, 0.0, 0.0, 0.7, 0.0]
    flat_m = [0.0]
    assert both(0.7, m, z, p) == scope["both"](0.7, flat_m, flat_z, flat_p)
    assert flat_z == [z.one.x, z.two.x, *z.one.f, *z.one.h, *z.two.f, *z.two.h]
    assert flat_m == [m.x]


def test_parts_keep_their_whole_names_for_export():
    text = "\n".join(ast.unparse(f) for f in named({"both": both}, PARTS).values())
    assert "p.one_k[i]" in text
    assert "range(two_elements_)" in text
    assert "z.two_x" in text
    assert ".one." not in text


def wrong_part(v, z, p):
    return z.one.y


def wrong_count(v, z, p):
    return scale(v)


@pytest.mark.parametrize(
    ("function", "words"),
    [(wrong_part, r"z\.one has no field 'y'; .*x"), (wrong_count, r"scale\(\) with 1 arguments .* takes 2")],
)
def test_what_is_wrong_with_a_part_is_said(function, words):
    with pytest.raises(LawError, match=words):
        lower({"f": function}, PARTS)


def halved(x, p):
    return scale(0.5 * x, p)


def called_as_states_are(z, m, p):
    """Numbers under names that structures have elsewhere, given on under others."""
    return halved(z, p) + halved(m, p) * z


def of_numbers(v, z, p):
    return called_as_states_are(v + z.x, v, p)


def test_a_number_may_be_called_as_a_structure_is():
    functions = lower({"of_numbers": of_numbers}, {**LAYOUTS, "m": Layout(("x",))})
    scope = {"math": math}
    exec("\n".join(ast.unparse(f) for f in functions.values()), scope)
    p, z = Bag(a=2.0, b=0.5), Bag(x=0.3)
    assert of_numbers(0.7, z, p) == scope["of_numbers"](0.7, [0.3], [2.0, 0.5, 0.0, 0.0])


@pytest.mark.parametrize("above", [0, 40])
def test_what_a_laws_file_makes_with_exec_is_not_taken_for_its_lines(tmp_path, above):
    """The lines of the file with the same numbers were compiled in its place, or there were none."""
    text = """
from typing import Annotated, NamedTuple
from stickslip.core.spec import Law, Par
class Params(NamedTuple):
    fc: Annotated[float, Par("N·m", "F_C", "level", positive=True)]
def step(v0, v1, dt, z, p, u):
    return p.fc * v1
made = {**globals()}
exec(ABOVE * "\\n" + "def step(v0, v1, dt, z, p, u):\\n    return 2.0 * p.fc * v1", made)
LAW = Law("made", Params, made["step"], title="t", equation="F", source=(), example={"fc": 1.0})
"""
    file = tmp_path / "made.py"
    file.write_text(text.replace("ABOVE", str(above or 5)), encoding="utf-8")
    with pytest.raises(
        LawError, match="the source of 'step' cannot be read; write the law in a file of its own"
    ):
        ss.law(str(file))
