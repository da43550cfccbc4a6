"""Trees of the kernel subset: copies, constants, and the numbers that a scene measures."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any, TypeVar

from distfsi.formulas.subset import Varying
from distfsi.narrowing import of_kind

Node = TypeVar("Node", bound=ast.AST)


def named(node: ast.expr) -> ast.expr:
    """The tree with each Number as a plain name, for a text."""
    if isinstance(node, Number):
        return ast.Name(node.id, ast.Load())
    new = copied(node)
    for name, value in vars(new).items():
        if isinstance(value, ast.expr):
            setattr(new, name, named(value))
    return new


def copied(node: Node) -> Node:
    """A tree with nodes of its own, several times as fast as by copy.deepcopy."""
    new = type(node)()
    for name, value in vars(node).items():
        if isinstance(value, list):
            value = [copied(item) if isinstance(item, ast.AST) else item for item in value]
        elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
            value = copied(value)
        setattr(new, name, value)
    return new


def stored_names(node: ast.AST, sometimes: tuple[type, ...], within: bool = False) -> Iterator[tuple[str, bool]]:
    """Each name that is assigned to, and whether within a statement of a kind that may run never or more than once."""
    within = within or isinstance(node, sometimes)
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id, within
    for child in ast.iter_child_nodes(node):
        yield from stored_names(child, sometimes, within)


class Number(ast.Name):
    """A number that a scene measures, or arithmetic among such: `id` says which, whatever its `value` is."""

    def __init__(self, id: str = "", value: float = 0.0):
        super().__init__(id, ast.Load())
        self.value = value


class Changing(ast.Name):
    """A number of a scene that changes from call to call: arithmetic with it is the kernel's."""

    def __init__(self, id: str = "", value: Varying | None = None):
        super().__init__(id, ast.Load())
        self.value = value


def name_of(node: ast.expr) -> str:
    """A tree that is a name, as a text."""
    return of_kind(ast.Name, node).id


def called(node: ast.Call) -> str:
    """The name of the function that is called."""
    return name_of(node.func)


def literal(value: Any) -> ast.expr:
    """The tree of a constant: a number, a truth value or a tuple of them."""
    if isinstance(value, tuple):
        return ast.Tuple([literal(item) for item in value], ast.Load())
    return ast.Constant(value)


def given(value: Any, label: str) -> ast.expr:
    """The tree of a constant that a scene gives, in which floats other than 0.0 are Numbers of that label."""
    if isinstance(value, tuple):
        return ast.Tuple([given(item, f"{label}[{k}]") for k, item in enumerate(value)], ast.Load())
    if isinstance(value, Varying):
        return Changing(f"given[{label!r}]", value)
    is_number = isinstance(value, float) and value != 0.0
    return Number(f"given[{label!r}]", float(value)) if is_number else ast.Constant(value)


def is_fixed(node: ast.expr) -> bool:
    """Whether a tree is a constant, a number of the scene, or a tuple of such: the same wherever it stands."""
    if isinstance(node, ast.Tuple):
        return all(map(is_fixed, node.elts))
    return isinstance(node, (ast.Constant, Number, Changing))


def truth_of(node: ast.expr) -> tuple[bool, Any]:
    """(True, value) when it is known whether the tree is true; a Number is, as it is not 0.0."""
    return (True, True) if isinstance(node, Number) else constant_of(node)


def constant_of(node: ast.expr) -> tuple[bool, Any]:
    """(True, value) when the tree is a constant or a tuple of constants."""
    if isinstance(node, ast.Constant):
        return True, node.value
    if isinstance(node, ast.Tuple):
        parts = [constant_of(item) for item in node.elts]
        if all(known for known, _ in parts):
            return True, tuple(value for _, value in parts)
    return False, None
