"""What halcompile makes of a component: the declarations by its grammar, and C with its macros, to be run in tests."""

import ctypes
import subprocess

from lark import Lark, Token

GRAMMAR = r"""
start: component declaration* ";;" BODY
component: "component" NAME [string] ";"
declaration: "pin" DIRECTION TYPE HALNAME ["=" VALUE] [string] ";"      -> pin
           | "param" ACCESS TYPE HALNAME ["=" VALUE] [string] ";"       -> param
           | "variable" NAME NAME [array] ["=" VALUE] ";"               -> variable
           | "function" NAME FP? [string] ";"                           -> function
           | "include" string ";"                                       -> include
           | ("license" | "author" | "description" | "notes") string ";" -> text
array: "[" /[0-9]+/ "]"
string: TSTRING | STRING
DIRECTION.2: /in\b|out\b|io\b/
ACCESS.2: /rw\b|r\b/
TYPE.2: /float\b|bit\b|unsigned\b|signed\b|u32\b|s32\b/
FP.2: /fp\b|nofp\b/
VALUE: /-?[0-9][0-9.eE+-]*/
TSTRING.3: /\"\"\"(.|\n)*?\"\"\"/
STRING.2: /"[^"\n]*"/
HALNAME: /[#a-zA-Z_][-#a-zA-Z0-9_.]*/
NAME: /[a-zA-Z_][a-zA-Z0-9_]*/
BODY: /(.|\n)+/
%ignore /[ \t\r\n]+/
"""
TYPES = {"float": "double", "bit": "int", "s32": "int"}


class Component:
    """A component's declarations, and its function on one instance."""

    def __init__(self, text, folder):
        head, _, body = text.partition("\n;;\n")
        tree = Lark(GRAMMAR, parser="earley", lexer="dynamic").parse(head + "\n;;\n" + body)
        self.items = [(d.data, d.children) for d in tree.children if not isinstance(d, Token)]
        self.folder = folder
        self.pins = {str(c[2]): c for kind, c in self.items if kind == "pin"}
        self.texts = [kind for kind, _ in self.items]
        self.includes = [c[0].children[0].strip('"') for kind, c in self.items if kind == "include"]
        self.library = self._built(body)

    def _built(self, body):
        """The library of the component, with functions that set and read a pin."""
        fields, macros, starts, ports = [], [], [], []
        for kind, c in self.items:
            if kind in ("pin", "param"):
                name, ctype, start = str(c[2]), TYPES[str(c[1])], c[3] or "0"
                fields.append(f"{ctype} {name};")
                reads = f"(0+it->{name})" if str(c[0]) == "in" else f"(it->{name})"
                macros.append(f"#define {name} {reads}")
                starts.append(f"instance.{name} = {start};")
                ports.append(f"{ctype} *address_of_{name}(void) {{ return &instance.{name}; }}")
            elif kind == "variable":
                fields.append(f"{c[0]} {c[1]};")
                macros.append(f"#define {c[1]} (it->{c[1]})")
        code = [*(f'#include "{name}"' for name in self.includes), "typedef struct {", *fields, "} contact_instance;",
                "static contact_instance instance;", *ports, "void start_up(void) {", *starts, "}",
                "#define FUNCTION(name) void run(contact_instance *it, long period)",
                "#define fperiod (period * 1e-9)", *macros, body,
                *(m.replace("#define ", "#undef ").split(" (")[0] for m in macros),
                "void run_once(long period) { run(&instance, period); }"]  # fmt: skip
        source, library = self.folder / "component.c", self.folder / "component.so"
        source.write_text("\n".join(code))
        command = ["gcc", "-Wall", "-Wextra", "-O2", "-ffp-contract=off", "-fno-builtin", "-shared", "-fPIC"]
        done = subprocess.run([*command, source, "-lm", "-o", library], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        loaded = ctypes.CDLL(str(library))
        loaded.start_up()
        return loaded

    def place(self, name):
        """A pin or parameter, to be read and set by `.value`."""
        (kind,) = [TYPES[str(c[1])] for k, c in self.items if k in ("pin", "param") and str(c[2]) == name]
        function = getattr(self.library, f"address_of_{name}")
        function.restype = ctypes.POINTER(ctypes.c_double if kind == "double" else ctypes.c_int)
        return function().contents

    def run(self, period):
        """One call of the function; ns."""
        self.library.run_once(ctypes.c_long(period))
