"""Expressions of named values at points, such as "mu / 2 * (I1 - 3)"."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.suggestions import join_names

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "tanh": np.tanh,
    "abs": np.abs,
    "sign": np.sign,
    "min": np.minimum,
    "max": np.maximum,
}
"""Functions of expressions; min and max have two arguments, the others one."""
_CONSTANTS = {"pi": np.pi}
_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


@dataclass(frozen=True)
class Expression:
    """Arithmetic of names, numbers and functions; `used_by`: what it is given to, for messages."""

    text: str
    tree: ast.expr
    used_by: str = "integral"

    @classmethod
    def of(cls, text: object, used_by: str = "integral") -> Expression:
        """The expression of a text.  Raises StudyError."""
        if not isinstance(text, str) or not text.strip():
            raise StudyError(f"{text!r}: an expression is a text, such as 'mu / 2 * (I1 - 3)'")
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except SyntaxError as error:
            raise StudyError(f"{text!r}: {error.msg}") from None
        expression = cls(text, tree, used_by)
        expression._check(tree)
        return expression

    @property
    def called(self) -> str:
        """The call that it stands in, for messages."""
        return f"{self.used_by}({self.text!r})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of values, in order."""
        called = {id(n.func) for n in ast.walk(self.tree) if isinstance(n, ast.Call)}
        nodes = [n for n in ast.walk(self.tree) if isinstance(n, ast.Name) and id(n) not in called]
        names = dict.fromkeys(n.id for n in nodes)
        return tuple(n for n in names if n not in _CONSTANTS)

    def __call__(self, values: Mapping[str, Array | float]) -> Array:
        """Value for values of the names.  Raises StudyError where it is not finite."""
        with np.errstate(all="ignore"):
            result = np.asarray(self._value(self.tree, values), dtype=np.float64)
        if not np.isfinite(result).all():
            where = "everywhere" if not np.isfinite(result).any() else "at some points"
            raise StudyError(f"{self.text!r} has no finite value {where}")
        return result

    def _value(self, node: ast.expr, values: Mapping[str, Any]) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name):
            return values[node.id] if node.id in values else _CONSTANTS[node.id]
        if isinstance(node, ast.UnaryOp):
            return _OPERATORS[type(node.op)](self._value(node.operand, values))
        if isinstance(node, ast.BinOp):
            sides = [np.asarray(self._value(n, values), float) for n in (node.left, node.right)]
            return _OPERATORS[type(node.op)](*sides)
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        return FUNCTIONS[node.func.id](*(self._value(a, values) for a in node.args))

    def _check(self, node: ast.expr) -> None:
        """Raise StudyError for anything but arithmetic."""
        parts: list[ast.expr] = []
        if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
            parts = [node.operand]
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            parts = [node.left, node.right]
        elif isinstance(node, ast.Call) and self._is_function(node):
            parts = node.args
        elif not isinstance(node, ast.Name) and not self._is_number(node):
            raise StudyError(
                f"{self.text!r}: {ast.unparse(node)!r} is not allowed; an expression has names, "
                f"numbers, + - * / ** and {join_names(FUNCTIONS)} (min and max of two values)"
            )
        for part in parts:
            self._check(part)

    @staticmethod
    def _is_number(node: ast.expr) -> bool:
        number = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
        return number and not isinstance(getattr(node, "value", None), bool)

    @staticmethod
    def _is_function(node: ast.Call) -> bool:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        arguments = 2 if name in ("min", "max") else 1
        return name in FUNCTIONS and not node.keywords and len(node.args) == arguments
