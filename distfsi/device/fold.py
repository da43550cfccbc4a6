"""Folding: one function of the formula subset, specialised for what a scene is.

The result is a plain `ast.FunctionDef` in which branches on what the scene fixes are resolved, `static_range` loops are
unrolled and arithmetic with 0 and 1 has vanished. Whole numbers and truth values of a scene are literals. What a scene
measures, its floats, are not: each becomes a `Number`, a place for a value that a kernel gets at run time, and so does
arithmetic among them; only a 0.0 is folded, as what a scene does not use it does not compute. Of a `Varying` one the
kernel gets the value of the moment. Records (named tuples and
laws, the types of parameters) are flattened to a parameter per field. Anything outside the subset is refused with the
module and line it stands on.
"""

from __future__ import annotations

import ast
from collections import Counter

from distfsi.device.expressions import MATH_WORDS, Expressions
from distfsi.device.trees import called, copied, is_fixed, name_of, stored_names, truth_of


class Fold(Expressions):
    """Folds one function."""

    def run(self) -> ast.FunctionDef:
        """The folded function, whose parameters are those that the scene does not give."""
        tree = self.source.tree()
        tree.decorator_list, tree.returns = [], None
        flat = [self.flat_parameters(name, class_) for name, class_ in self.source.parameters.items()]
        tree.args.args = [ast.arg(name) for names in flat for name in names]
        sometimes = (ast.For, ast.While, ast.AugAssign, *((ast.If,) if self.in_kernel else ()))
        stored = list(stored_names(tree, sometimes))
        times = Counter(name for name, _ in stored)
        self.locals = {a.arg for a in tree.args.args} | set(times)
        self.propagated = {name for name, within in stored if times[name] == 1 and not within}
        tree.body = self.statements(tree.body)
        if not self.in_kernel:
            self.refuse_integers(tree)
        return ast.fix_missing_locations(tree)

    def refuse_integers(self, tree: ast.AST) -> None:
        """Integers are for indices and arguments of other formulas; elsewhere they turn float32 into float64."""
        for node in ast.iter_child_nodes(tree):
            index = isinstance(tree, ast.Subscript) and node is tree.slice
            argument = isinstance(tree, ast.Call) and called(tree) not in MATH_WORDS
            if isinstance(node, ast.Constant) and type(node.value) is int and not (index or argument):
                raise self.refuse(node, f"write {node.value}.0: an integer would turn float32 into float64")
            self.refuse_integers(node)

    # ---- statements --------------------------------------------------------------------------------------------------

    def statements(self, body: list[ast.stmt]) -> list[ast.stmt]:
        out: list[ast.stmt] = []
        for statement in body:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue  # docstring
            result = self.visit(statement)
            out += result if isinstance(result, list) else [result] if result is not None else []
            if out and isinstance(out[-1], ast.Return):
                break
        return out

    def visit_Assign(self, node: ast.Assign) -> ast.stmt | list[ast.stmt] | None:
        if len(node.targets) != 1:
            raise self.refuse(node, "one target per assignment")
        node.value = self.visit(node.value)
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple) and is_fixed(node.value):
            parts = zip(target.elts, node.value.elts, strict=True)
            return self.statements([ast.copy_location(ast.Assign([t], v), node) for t, v in parts])
        if isinstance(target, ast.Name):
            if target.id in self.propagated and is_fixed(node.value):
                self.known[target.id] = node.value
                return None
        elif isinstance(target, ast.Subscript):
            if not self.in_kernel:
                raise self.refuse(node, "a formula does not write into its arguments")
            node.targets = [self.visit(target)]
        elif not isinstance(target, ast.Tuple):
            raise self.refuse(node, "assign to names only")
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        if not self.in_kernel:
            raise self.refuse(node, "a formula names each value once (no +=)")
        node.value = self.visit(node.value)
        if isinstance(node.target, ast.Subscript):
            node.target = self.visit(node.target)
        return node

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt]:
        test = self.visit(node.test)
        known, value = truth_of(test)
        if known:
            return self.statements(node.body if value else node.orelse)
        if not self.in_kernel:
            raise self.refuse(node, "a formula does not branch at run time; write `x if condition else y`")
        node.test, node.body, node.orelse = test, self.statements(node.body), self.statements(node.orelse)
        if not node.body:
            node.body = [ast.Pass()]
        return node

    def visit_For(self, node: ast.For) -> ast.stmt | list[ast.stmt]:
        if node.orelse:
            raise self.refuse(node, "no else on a loop")
        if self.is_static_range(node.iter):
            name, out = name_of(node.target), list[ast.stmt]()
            for value in self.static_values(node.iter):
                self.known[name] = ast.Constant(value)
                out += self.statements([copied(statement) for statement in node.body])
            self.known.pop(name, None)
            return out
        if not self.in_kernel:
            raise self.refuse(node, "a formula loops over static_range only")
        node.iter, node.body = self.visit(node.iter), self.statements(node.body)
        return node

    def visit_While(self, node: ast.While) -> ast.stmt:
        if not self.in_kernel:
            raise self.refuse(node, "a formula loops over static_range only")
        node.test, node.body = self.visit(node.test), self.statements(node.body)
        return node

    def visit_Return(self, node: ast.Return) -> ast.stmt:
        node.value = self.visit(node.value) if node.value is not None else None
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.stmt:
        if not self.in_kernel or not isinstance(node.value, ast.Call):
            raise self.refuse(node, "a statement that has no effect")
        node.value = self.visit(node.value)
        return node
