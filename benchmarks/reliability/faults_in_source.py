"""Small faults in the functions of a source: comparisons and sums turned round, conditions denied, ..."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

_COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_SUMS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult}


@dataclass(frozen=True)
class Mutant:
    """A file with one fault.

    Attributes:
        tree: The file as it is.
        function: The function that the statement is in; the outermost, where it stands inside another.
        sound: The statement as it is.
        changed: What stands in its place.
    """

    tree: ast.Module
    function: ast.FunctionDef
    sound: ast.stmt
    changed: ast.stmt

    @property
    def what(self) -> str:
        """The statement as it is, and as it is now."""
        return f"{_head(self.sound)}  ->  {_head(self.changed)}"

    @property
    def lines(self) -> range:
        """Lines of the statement as it is, without those of statements inside it."""
        inside = [child.lineno for child in ast.iter_child_nodes(self.sound) if isinstance(child, ast.stmt)]
        last = min(inside) - 1 if inside else self.sound.end_lineno or self.sound.lineno
        return range(self.sound.lineno, max(last, self.sound.lineno) + 1)

    @property
    def source(self) -> str:
        """The text of the file with the fault."""
        return _replaced(self.tree, self.sound, self.changed)

    @property
    def function_source(self) -> str:
        """The text of the function with the fault: what else is in the file may change."""
        return _replaced(self.function, self.sound, self.changed)


def mutants_of(source: str, kernels: bool = False) -> list[Mutant]:
    """All faults of a file, each once, in the order of its text; assertions of debug builds are left alone.

    Args:
        source: Text of the file.
        kernels: Of compiled kernels only.
    """
    tree = ast.parse(source)
    found = []
    for function in _outermost(tree, kernels):
        for node in ast.walk(function):
            if isinstance(node, ast.stmt) and node is not function and not _is_debugging(node):
                found += [Mutant(tree, function, node, changed) for changed in _changes(node)]
    return sorted(found, key=lambda mutant: (mutant.sound.lineno, mutant.what))


def _outermost(node: ast.AST, kernels: bool) -> Iterator[ast.FunctionDef]:
    """Functions that stand in no other of them; with `kernels`, compiled ones."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef) and (not kernels or _is_kernel(child)):
            yield child
        else:
            yield from _outermost(child, kernels)


def _is_kernel(function: ast.FunctionDef) -> bool:
    """Whether it is compiled, by its decorator."""
    return any(ast.unparse(decorator).endswith("kernel") for decorator in function.decorator_list)


def _head(statement: ast.stmt) -> str:
    """A statement in one line, without what is inside it."""
    return ast.unparse(statement).partition("\n")[0]


def _is_debugging(node: ast.stmt) -> bool:
    """Whether a statement belongs to an assertion of debug builds, or is a docstring."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    return isinstance(node, ast.Raise) or "ASSERTING" in _head(node)


def _changes(statement: ast.stmt) -> Iterator[ast.stmt]:
    """A statement with one fault in its own expressions, or nothing in its place."""
    if isinstance(statement, ast.Expr | ast.AugAssign | ast.Break | ast.Continue) or _changes_an_array(
        statement
    ):
        yield ast.copy_location(ast.Pass(), statement)
    if isinstance(statement, ast.If | ast.While):
        denied = copy.deepcopy(statement)
        denied.test = ast.UnaryOp(ast.Not(), denied.test)
        yield denied
    if isinstance(statement, ast.AugAssign) and type(statement.op) in _SUMS:
        turned = copy.deepcopy(statement)
        turned.op = _SUMS[type(statement.op)]()
        yield turned
    count = sum(1 for _ in _expressions(statement))
    for place in range(count):
        changed = copy.deepcopy(statement)
        node = next(node for number, node in enumerate(_expressions(changed)) if number == place)
        if _turn(node):
            yield changed


def _changes_an_array(statement: ast.stmt) -> bool:
    """Whether it assigns to a field or a place of an array; names without a value are no faults to find."""
    return isinstance(statement, ast.Assign) and isinstance(
        statement.targets[0], ast.Attribute | ast.Subscript
    )


def _expressions(statement: ast.stmt) -> Iterator[ast.AST]:
    """The expressions of a statement itself, not of the statements inside it."""
    waiting = [child for child in ast.iter_child_nodes(statement) if not isinstance(child, ast.stmt)]
    while waiting:
        node = waiting.pop(0)
        yield node
        if not isinstance(node, ast.Subscript):  # another place of an array may hold the same
            waiting += list(ast.iter_child_nodes(node))


def _turn(node: ast.AST) -> bool:
    """Put a fault into one expression; False where it is of no kind that has one."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARISONS:
        node.ops[0] = _COMPARISONS[type(node.ops[0])]()
    elif isinstance(node, ast.BinOp) and type(node.op) in _SUMS:
        node.op = _SUMS[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        node.value = not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        node.value = node.value + 1
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        node.func.id = "max" if node.func.id == "min" else "min"
    else:
        return False
    return True


def _replaced(tree: ast.AST, old: ast.stmt, new: ast.stmt) -> str:
    """The text of a tree in which one statement is another."""
    for node in ast.walk(tree):
        for name in ("body", "orelse", "finalbody"):
            body = getattr(node, name, None)
            if isinstance(body, list) and any(each is old for each in body):
                place = next(number for number, each in enumerate(body) if each is old)
                body[place] = new
                text = ast.unparse(tree)
                body[place] = old
                return text
    raise LookupError(_head(old))
