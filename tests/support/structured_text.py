"""IEC 61131-3 structured text (types, functions, function blocks) run as Python, to try what is exported.

The grammar is the part of the norm's Annex B (edition 2, whose compilers refuse what only edition 3 has) that covers
user types, POUs with VAR sections, assignments, IF, FOR, RETURN, EXIT and calls with named arguments: functions stand
in expressions, names have no underscore at the end and no two in a row, real numbers a point. LREAL is a double, INT an
int, BOOL neither; names know no case, are none of the norm's words, and name one thing.
"""

import functools
import math
import re

from lark import Lark, Token, Tree

GRAMMAR = r"""
start: (type_block | function | block)*
type_block: "TYPE"i (NAME ":" "STRUCT"i declaration* "END_STRUCT"i ";"?)+ "END_TYPE"i
function: "FUNCTION"i NAME ":" NAME section* statement* "END_FUNCTION"i
block: "FUNCTION_BLOCK"i NAME section* statement* "END_FUNCTION_BLOCK"i
section: SECTION declaration* "END_VAR"i
SECTION.3: /VAR_INPUT|VAR_OUTPUT|VAR_IN_OUT|VAR(?!_)/i
declaration: NAME ":" kind [":=" initial] ";"
kind: "ARRAY"i "[" INT ".." INT "]" "OF"i NAME -> array | NAME -> named
?initial: "[" expression ("," expression)* "]" -> listed | expression

?statement: assign | if_ | for_ | return_ | exit_ | empty
empty: ";"
assign: place ":=" expression ";"
if_: "IF"i expression "THEN"i body ("ELSIF"i expression "THEN"i body)* ["ELSE"i body] "END_IF"i ";"
for_: "FOR"i NAME ":=" expression "TO"i expression "DO"i body "END_FOR"i ";"
return_: "RETURN"i ";"
exit_: "EXIT"i ";"
body: statement*

place: NAME ("." NAME | "[" expression "]")*

?expression: conjunction | expression "OR"i conjunction -> or_
?conjunction: comparison | conjunction "AND"i comparison -> and_
?comparison: sum (COMPARE sum)?
?sum: product (SIGN product)*
?product: unary (TIMES unary)*
?unary: "-" atom -> negative | "NOT"i atom -> not_ | atom
?atom: NUMBER | call | place | TRUTH | "(" expression ")"
call: NAME "(" [argument ("," argument)*] ")"
argument: NAME ":=" expression -> named_argument | expression -> plain_argument

COMPARE: "<=" | ">=" | "<>" | "<" | ">" | "="
SIGN: "+" | "-"
TIMES: "*" | "/" | /MOD\b/i
TRUTH.2: /TRUE|FALSE/i
NUMBER: /[0-9]+(\.[0-9]+([Ee][+-]?[0-9]+)?)?(?![.\w])/
INT: /[0-9]+/
NAME: /_?[a-z][a-z0-9]*(_[a-z0-9]+)*(?!\w)/i
COMMENT: /\(\*.*?\*\)/s
%ignore COMMENT
%ignore /\s+/
"""
TOKENS = sorted(
    {*re.findall(r'"([A-Z_]+)"i', GRAMMAR), "VAR", "VAR_INPUT", "VAR_OUTPUT", "VAR_IN_OUT", "TRUE", "FALSE"}
)
"""Words of the grammar itself: whole ones, which no name can be."""
GRAMMAR = re.sub(r'"([A-Z_]+)"i', r"_K_\1", GRAMMAR) + "".join(f"_K_{w}: /{w}(?!\\w)/i\n" for w in TOKENS)
GRAMMAR = GRAMMAR.replace("NAME: /", rf"NAME: /(?!(?:{'|'.join(TOKENS)})(?!\w))")
WORDS = """
action array at by case configuration constant date date_and_time do dt else elsif end_action end_case
end_configuration end_for end_function end_function_block end_if end_program end_repeat end_resource end_step
end_struct end_transition end_type end_var end_while en eno exit false for from function function_block f_edge if in
initial_step interval mod not of on or and xor priority program read_only read_write repeat resource retain
non_retain return r_edge single step string struct task then time time_of_day tod to transition true type until var
var_access var_config var_external var_global var_in_out var_input var_output var_temp while with wstring bool sint
int dint lint usint uint udint ulint real lreal byte word dword lword any any_num any_real any_int any_bit abs acos
add asin atan concat cos delete div eq exp expt find ge gt insert le left len limit ln log lt max mid min move mul
mux ne replace right rol ror sel shl shr sin sqrt sub tan trunc ctu ctd ctud f_trig r_trig rs sr tof ton tp
"""
"""Annex C of the norm, and the names of its types, functions and blocks."""
KEYWORDS = set(re.findall(r"\w+", WORDS))
LIBRARY = {
    "abs": abs, "exp": math.exp, "ln": math.log, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "expt": math.pow, "min": min, "max": max, "sel": lambda c, a, b: b if truth(c) else a,
    "int_to_lreal": float, "lint_to_lreal": float, "lreal_to_lint": round, "lreal_to_int": round,
}  # fmt: skip
COMPARISONS = {"=": "==", "<>": "!="}


@functools.cache
def reader():
    """What reads a file, made of the grammar once."""
    return Lark(GRAMMAR, parser="lalr", maybe_placeholders=True)


def copied(value):
    """Variables by value: a call has thousands of them, and `copy.deepcopy` asks each what it is."""
    if isinstance(value, dict):
        return {k: copied(x) if isinstance(x, (dict, list)) else x for k, x in value.items()}
    return [copied(x) if isinstance(x, (dict, list)) else x for x in value]


class Program:
    """A file of structured text."""

    def __init__(self, text):
        tree = reader().parse(text)
        self.types, self.pous = {}, {}
        for part in tree.children:
            names = [c for c in part.children if isinstance(c, Token)]
            if part.data == "type_block":
                self.types[names[0].lower()] = [c for c in part.children if isinstance(c, Tree)]
            else:
                self.pous[names[0].lower()] = part
        for scope in scopes(tree):
            one_thing_each(scope, {*self.types, *self.pous})
        self.initial = {
            name: {
                d.children[0].lower(): self.fresh(d)
                for section in part.find_data("section")
                for d in section.find_data("declaration")
            }
            for name, part in self.pous.items()
        }

    def fresh(self, declaration):
        """The initial value of a declared variable."""
        _, kind, initial = declaration.children
        if initial is not None and isinstance(initial, Tree) and initial.data == "listed":
            return [constant(c) for c in initial.children]
        if initial is not None:
            return constant(initial)
        if kind.data == "array":
            return [0.0] * (int(kind.children[1]) + 1)
        name = kind.children[0].lower()
        if name in self.types:
            return {d.children[0].lower(): self.fresh(d) for d in self.types[name]}
        return {"int": 0, "bool": False}.get(name, 0.0)

    def instance(self, name):
        """The variables of a function block at the start."""
        return copied(self.initial[name.lower()])

    def run(self, name, variables):
        """Run the statements of a POU on its variables."""
        self.statements(name.lower())(variables)

    @functools.cache  # noqa: B019 (a program lives for one test)
    def statements(self, name):
        """The statements of a POU as a Python function of its variables."""
        lines = [line for c in self.pous[name].children if is_statement(c) for line in statement(c)]
        source = "\n    ".join(["def run(v):", "pass", *lines])
        found = {"call": self.call, "store": store, "both": both, "fmod": math.fmod, "library": LIBRARY,
                 "truth": truth}  # fmt: skip
        exec(compile(source, name, "exec"), found)
        return found["run"]

    def call(self, name, **given):
        kind = self.pous[name].children[1].lower()
        inner = {name: False if kind == "bool" else 0.0, **self.instance(name)}
        assert given.keys() <= inner.keys(), f"{name} has not all of the inputs {list(given)}"
        inner |= given
        self.run(name, inner)
        return inner[name]


def scopes(tree):
    """The names declared in the file, in every type and in every POU."""
    yield [part.children[0] for part in tree.children]
    for part in tree.children:
        yield [d.children[0] for d in part.find_data("declaration")]


def one_thing_each(names, known):
    """Refuse words of the norm, names that differ by case alone, and variables called like a type or a function."""
    lower = [name.lower() for name in names]
    assert len(set(lower)) == len(lower), f"two of {sorted(lower)} are one name"
    assert not KEYWORDS & set(lower), f"words of the norm: {KEYWORDS & set(lower)}"
    assert set(lower) <= known or not known & set(lower), f"types or functions too: {known & set(lower)}"


def constant(node):
    return eval(value(node), {"library": LIBRARY})


def is_statement(node):
    return isinstance(node, Tree) and node.data != "section"


def store(owner, key, value):
    assert key in owner if isinstance(owner, dict) else key < len(owner), f"undeclared {key}"
    assert isinstance(owner[key], bool) is isinstance(value, bool), f"{key} := {value}"
    owner[key] = value


def truth(value):
    """A condition; numbers are none."""
    assert isinstance(value, bool), f"{value} is no condition"
    return value


def both(kind, *results):
    """AND and OR work out all their operands, as a PLC may."""
    assert all(isinstance(r, bool) for r in results), results
    return any(results) if kind == "or_" else all(results)


def indented(lines):
    return ["    " + line for line in lines] or ["    pass"]


def statement(node):
    """The lines of Python of a statement."""
    c = node.children
    if node.data == "assign":
        *owner, key = keys(c[0])
        return [f"store(v{''.join(f'[{k}]' for k in owner)}, {key}, {value(c[1])})"]
    if node.data == "if_":
        *pairs, otherwise = c
        out = []
        for test, body in zip(pairs[::2], pairs[1::2]):
            out += [f"{'elif' if out else 'if'} truth({value(test)}):", *indented(statement(body))]
        return out if otherwise is None else [*out, "else:", *indented(statement(otherwise))]
    if node.data == "for_":
        name, first, last, body = c
        head = f"for v[{name.lower()!r}] in range(int({value(first)}), int({value(last)}) + 1):"
        return [head, *indented(statement(body))]
    if node.data == "body":
        return [line for inner in c for line in statement(inner)]
    return {"return_": ["return"], "exit_": ["break"], "empty": []}[node.data]


def keys(place):
    """What leads from the variables to a place: names and numbers."""
    first, *rest = place.children
    names = (
        repr(k.lower()) if isinstance(k, Token) and k.type == "NAME" else f"int({value(k)})" for k in rest
    )
    return [repr(first.lower()), *names]


def value(node):
    """The Python of an expression."""
    if isinstance(node, Token):
        return token(node)
    kind, c = node.data, node.children
    if kind == "place":
        return "v" + "".join(f"[{key}]" for key in keys(node))
    if kind == "call":
        return called(c[0].lower(), [a for a in c[1:] if a is not None])
    if kind == "negative":
        return f"(-{value(c[0])})"
    if kind == "not_":
        return f"(not truth({value(c[0])}))"
    if kind in ("or_", "and_"):
        return f"both({kind!r}, {', '.join(value(x) for x in c)})"
    if kind == "comparison":
        return f"({value(c[0])} {COMPARISONS.get(c[1], c[1])} {value(c[2])})"
    out = value(c[0])
    for sign, operand in zip(c[1::2], c[2::2]):
        right = value(operand)
        out = f"fmod({out}, {right})" if sign.upper() == "MOD" else f"({out} {sign} {right})"
    return out


def called(name, arguments):
    if name in LIBRARY:
        return f"library[{name!r}]({', '.join(value(a.children[0]) for a in arguments)})"
    given = (f"{a.children[0].lower()}={value(a.children[1])}" for a in arguments)
    return f"call({name!r}, {', '.join(given)})"


def token(node):
    if node.type == "TRUTH":
        return str(node.lower() == "true")
    if node.type == "NAME":
        return f"v[{node.lower()!r}]"
    return repr(float(node) if any(x in node for x in ".eE") else int(node))
