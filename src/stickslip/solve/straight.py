"""Lines without a loop as one function of LLVM's: the series of :mod:`stickslip.solve.taylor`."""

from __future__ import annotations

import ast
import hashlib
import math
import struct
from types import MappingProxyType
from typing import Any

import llvmlite.binding
import llvmlite.ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

ROW = types.float64[::1]
CODE = types.void(ROW, types.int64, ROW, types.float64, ROW)  # what fills in a series' coefficients


@intrinsic  # type: ignore[untyped-decorator]  # numba tells no types
def coded(_context: Any, address: Any) -> Any:
    """The function of the kind `CODE` at an address: a number is passed in no time, a function's type is not."""
    kind = types.FunctionType(CODE)

    def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function = cgutils.create_struct_proxy(kind)(context, builder)
        function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
        function.py_addr = function.jit_addr = cgutils.voidptr_t(None)
        return function._getvalue()

    return kind(address), made


def straight(text: str) -> Any:
    """Assignments to names and to entries of `s`, of the numbers h and of arrays q and y: a function (q, y, h, s).

    Only compiled code calls it. LLVM is told the lines as they stand: numba would take 4 ms a line, ten times as long.
    """
    name = "straight_" + hashlib.sha256(text.encode()).hexdigest()[:16]

    def code(_context: Any, q: Any, y: Any, h: Any, s: Any) -> Any:
        def made(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            module = llvmlite.binding.parse_assembly(_Straight(text).module(name))
            context.active_code_library.add_llvm_module(module)
            given = [
                value if type_ == h else context.make_array(type_)(context, builder, value).data
                for type_, value in zip(signature.args, arguments, strict=True)
            ]
            kind = llvmlite.ir.FunctionType(llvmlite.ir.VoidType(), [value.type for value in given])
            builder.call(cgutils.get_or_insert_function(builder.module, kind, name), given)
            return context.get_dummy_value()

        return types.void(q, y, h, s), made

    return intrinsic(code)


# Operations in a row that LLVM improves. Its time grows faster than they do: 47,000, of a curve of 21 functions, took
# 19 s of processor, 8 s as they stand. A usual law has 200 to 2,000.
PLAIN = 6000


class _Straight:
    """Translates lines into LLVM's language; a product and a sum may be one operation."""

    DOUBLE = llvmlite.ir.DoubleType()
    OPERATIONS = MappingProxyType({ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"})
    ORDERS = MappingProxyType({ast.Lt: "olt", ast.Gt: "ogt"})
    FUNCTIONS = MappingProxyType({
        "exp": "llvm.exp.f64", "log": "llvm.log.f64", "power": "llvm.pow.f64", "fabs": "llvm.fabs.f64",
        "tanh": "tanh", "asinh": "asinh",
    })  # fmt: skip

    def __init__(self, text: str) -> None:
        self.lines, self.block, self.count, self.declared = ["begin:"], "begin", 0, dict[str, str]()
        self.names = {"h": "%h", "nan": _hexadecimal(math.nan)}
        for line in ast.parse(text).body:
            assert isinstance(line, ast.Assign)
            (target,) = line.targets
            if isinstance(target, ast.Name):
                self.names[target.id] = self.number(line.value)
            else:
                value = self.number(line.value)
                self.lines.append(f"store double {value}, {self.place(target)}")

    def module(self, name: str) -> str:
        """The text of a module with this one function."""
        pointer = self.DOUBLE.as_pointer()
        head = f"define weak_odr void @{name}({pointer} %q, {pointer} %y, double %h, {pointer} %s) noinline"
        head += " optnone {" if self.count > PLAIN else " {"
        triple = f'target triple = "{llvmlite.binding.get_process_triple()}"'
        return "\n".join([triple, *self.declared.values(), head, *self.lines, "ret void", "}"])

    def new(self, operation: str) -> str:
        """The name of what an operation gives."""
        self.count += 1
        self.lines.append(f"%v{self.count} = {operation}")
        return f"%v{self.count}"

    def begin(self, block: str) -> None:
        """What follows stands in a block of this name."""
        self.lines.append(f"{block}:")
        self.block = block

    def place(self, node: Any) -> str:
        """Where an entry of an array stands."""
        pointer = self.DOUBLE.as_pointer()
        at = self.new(f"getelementptr double, {pointer} %{node.value.id}, i64 {ast.literal_eval(node.slice)}")
        return f"{pointer} {at}"

    def number(self, node: Any) -> str:
        """The value of an expression."""
        if isinstance(node, ast.Name):
            return self.names[node.id]
        if isinstance(node, ast.Constant | ast.UnaryOp):
            return _hexadecimal(ast.literal_eval(node))
        if isinstance(node, ast.Subscript):
            return self.new(f"load double, {self.place(node)}")
        if isinstance(node, ast.BinOp):
            left, right = self.number(node.left), self.number(node.right)
            return self.new(f"{self.OPERATIONS[type(node.op)]} contract double {left}, {right}")
        return self.called(node) if isinstance(node, ast.Call) else self.either(node)

    def called(self, node: Any) -> str:
        """A function's value."""
        function, values = self.FUNCTIONS[node.func.id], [self.number(value) for value in node.args]
        self.declared[function] = f"declare double @{function}({', '.join('double' for _ in values)})"
        return self.new(f"call double @{function}({', '.join(f'double {value}' for value in values)})")

    def either(self, node: Any) -> str:
        """One of two values, of which the other is not computed."""
        left, right = self.number(node.test.left), self.number(node.test.comparators[0])
        when = self.new(f"fcmp {self.ORDERS[type(node.test.ops[0])]} double {left}, {right}")
        mark, known = self.count, []
        self.lines.append(f"br i1 {when}, label %yes{mark}, label %no{mark}")
        for word, branch in (("yes", node.body), ("no", node.orelse)):
            self.begin(f"{word}{mark}")
            value = self.number(branch)
            known.append(f"[{value}, %{self.block}]")
            self.lines.append(f"br label %end{mark}")
        self.begin(f"end{mark}")
        return self.new(f"phi double {', '.join(known)}")


def _hexadecimal(value: float) -> str:
    """A double as LLVM reads it to the last digit."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"
