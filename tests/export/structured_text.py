"""IEC 61131-3 structured text (types, functions, function blocks) run as Python, to try what is exported.

The grammar is the part of the norm's Annex B that covers user types, POUs with VAR sections, assignments, IF,
FOR, RETURN, EXIT and calls with named arguments. LREAL is a double, INT an int; names know no case.
"""

import copy
import functools
import math

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

?statement: assign | call_statement | if_ | for_ | return_ | exit_ | empty
empty: ";"
assign: place ":=" expression ";"
call_statement: call ";"
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
NUMBER: /[0-9]+(\.[0-9]+)?([Ee][+-]?[0-9]+)?(?!\.\.)/
INT: /[0-9]+/
NAME: /(?!(?:ELSE|ELSIF|THEN|DO|TO|OR|AND|NOT|RETURN|EXIT|IF|FOR|VAR|TYPE|FUNCTION|STRUCT)\b)(?!END_|VAR_)[A-Z_a-z]\w*/
COMMENT: /\(\*.*?\*\)/s
%ignore COMMENT
%ignore /\s+/
"""
LIBRARY = {
    "abs": abs, "exp": math.exp, "ln": math.log, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "expt": math.pow, "min": min, "max": max, "sel": lambda c, a, b: b if c else a,
    "int_to_lreal": float, "lint_to_lreal": float, "trunc_lint": math.trunc, "lreal_to_int": int,
}  # fmt: skip
COMPARISONS = {"=": "==", "<>": "!="}


class Program:
    """A file of structured text."""

    def __init__(self, text):
        tree = Lark(GRAMMAR, parser="lalr", maybe_placeholders=True).parse(text)
        self.types, self.pous = {}, {}
        for part in tree.children:
            names = [c for c in part.children if isinstance(c, Token)]
            if part.data == "type_block":
                self.types[names[0].lower()] = [c for c in part.children if isinstance(c, Tree)]
            else:
                self.pous[names[0].lower()] = part
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
        return copy.deepcopy(self.initial[name.lower()])

    def run(self, name, variables):
        """Run the statements of a POU on its variables."""
        self.statements(name.lower())(variables)

    @functools.cache  # noqa: B019 (a program lives for one test)
    def statements(self, name):
        """The statements of a POU as a Python function of its variables."""
        lines = [line for c in self.pous[name].children if is_statement(c) for line in statement(c)]
        source = "\n    ".join(["def run(v):", "pass", *lines])
        found = {"call": self.call, "store": store, "both": both, "fmod": math.fmod, "library": LIBRARY}
        exec(compile(source, name, "exec"), found)
        return found["run"]

    def call(self, name, **given):
        inner = {name: 0.0, **self.instance(name)}
        assert given.keys() <= inner.keys(), f"{name} has not all of the inputs {list(given)}"
        inner |= given
        self.run(name, inner)
        return inner[name]


def constant(node):
    return eval(value(node), {"library": LIBRARY})


def is_statement(node):
    return isinstance(node, Tree) and node.data != "section"


def store(owner, key, value):
    assert key in owner if isinstance(owner, dict) else key < len(owner), f"undeclared {key}"
    owner[key] = value


def both(kind, *results):
    """AND and OR work out all their operands, as a PLC may."""
    return any(results) if kind == "or_" else all(results)


def indented(lines):
    return ["    " + line for line in lines] or ["    pass"]


def statement(node):
    """The lines of Python of a statement."""
    c = node.children
    if node.data == "assign":
        *owner, key = keys(c[0])
        return [f"store(v{''.join(f'[{k}]' for k in owner)}, {key}, {value(c[1])})"]
    if node.data == "call_statement":
        return [value(c[0])]
    if node.data == "if_":
        *pairs, otherwise = c
        out = []
        for test, body in zip(pairs[::2], pairs[1::2]):
            out += [f"{'elif' if out else 'if'} {value(test)}:", *indented(statement(body))]
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
        return f"(not {value(c[0])})"
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
