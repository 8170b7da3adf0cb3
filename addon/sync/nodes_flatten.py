"""A node tree without its furniture: groups, reroutes, muted nodes and dead links are followed through, so that
every input is either unlinked, linked to an output of a node that computes something, or replaced by a constant found
on the way.

Constants follow Cycles without the inliner (measured in 3.4): a muted node or a reroute that nothing feeds gives zero,
an unlinked socket of a group gives its value, and neither reaches sockets where unlinked means more than a value.

Works on any Blender: where `inline_shader_nodes()` exists the tree given is simpler already, and nothing is lost.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

MAX_DEPTH = 200
"""Reroutes, muted nodes and groups one link may pass through; deeper is a circle that Blender did not notice."""

GROUP_TYPES = {"GROUP", "CUSTOM GROUP"}


@dataclass
class Scope:
    """One place where a tree is used: the top level, or inside one group node."""

    tree: Any
    path: tuple[str, ...] = ()
    parent: "Scope | None" = None
    group: Any = None
    links: dict[tuple[int, str], Any] = field(default_factory=dict)
    """By address of the node it leads to (3.4's AOV Output nodes may share a name) and socket."""

    def __post_init__(self) -> None:
        for link in self.tree.links:
            if link.is_muted or not link.is_valid or not link.to_socket.enabled or not link.from_socket.enabled:
                continue
            self.links[link.to_node.as_pointer(), link.to_socket.identifier] = link

    def uses(self, tree: Any) -> bool:
        """Whether the scope lies inside this tree: a group in itself would never end."""
        scope: Scope | None = self
        while scope is not None:
            if scope.tree == tree:
                return True
            scope = scope.parent
        return False


def invalid_links(tree: Any, seen: set[Any] | None = None) -> Iterator[str]:
    """A sentence for each link that Blender draws in red, in the tree and its groups: no Blender follows them."""
    seen = set() if seen is None else seen
    seen.add(tree)
    for link in tree.links:
        if not link.is_valid and not link.is_muted:
            yield (
                f"Node '{link.to_node.name}': the link into {link.to_socket.name} is invalid (it closes a circle, or "
                "its ends do not fit) and is ignored"
            )
    for node in tree.nodes:
        inner = node.node_tree if node.type in GROUP_TYPES else None
        if inner is not None and inner not in seen:
            yield from invalid_links(inner, seen)


@dataclass
class Source:
    """Where an input's value comes from: output `identifier` of flat node `index`, or (index -1) the constant on
    `socket`; with `socket` None the constant is zero."""

    index: int = -1
    identifier: str = ""
    socket: Any = None


@dataclass
class FlatInput:
    """A socket with what feeds it; `source` None: unlinked."""

    socket: Any
    source: Source | None


@dataclass
class FlatNode:
    """A node that computes something. `name` includes the groups it lies in."""

    node: Any
    scope: Scope
    name: str
    inputs: list[FlatInput] = field(default_factory=list)


class Flattener:
    """Collects what feeds the output node, nearest first."""

    def __init__(self) -> None:
        self.nodes: list[FlatNode] = []
        self.problems: list[str] = []
        self._index: dict[tuple[tuple[str, ...], int], int] = {}
        self._pending: deque[int] = deque()
        self._scopes: dict[tuple[str, ...], Scope] = {}

    def run(self, tree: Any, output: Any, is_output: Callable[[Any], bool] = lambda _: False) -> list[FlatNode]:
        """The flat nodes; the first one is `output`. `is_output`: what counts besides it, inside groups too."""
        top = Scope(tree)
        self._visit(top, output)
        self._visit_outputs(top, is_output)
        while self._pending:
            flat = self.nodes[self._pending.popleft()]
            for socket in flat.node.inputs:
                if not socket.enabled:
                    continue
                flat.inputs.append(FlatInput(socket, self._input(flat.scope, flat.node, socket, 0)))
        return self.nodes

    def _visit_outputs(self, scope: Scope, is_output: Callable[[Any], bool]) -> None:
        for node in scope.tree.nodes:
            if is_output(node):
                self._visit(scope, node)
            elif node.type in GROUP_TYPES and node.node_tree is not None and not node.mute:
                inner = self._inner_scope(scope, node)
                if inner is not None:
                    self._visit_outputs(inner, is_output)

    def _inner_scope(self, scope: Scope, node: Any) -> Scope | None:
        """Inside a group node that has a group; None (and a problem) where the group contains itself."""
        path = (*scope.path, node.name)
        inner = self._scopes.get(path)
        if inner is None:
            if scope.uses(node.node_tree):
                self.problems.append(f"Group '{node.node_tree.name}' contains itself")
                return None
            inner = self._scopes[path] = Scope(node.node_tree, path, scope, node)
        return inner

    def _visit(self, scope: Scope, node: Any) -> int:
        key = (scope.path, node.as_pointer())
        index = self._index.get(key)
        if index is None:
            index = self._index[key] = len(self.nodes)
            self.nodes.append(FlatNode(node, scope, " > ".join((*scope.path, node.name))))
            self._pending.append(index)
        return index

    def _input(self, scope: Scope, node: Any, socket: Any, depth: int) -> Source | None:
        """What feeds an input; None when it is unlinked."""
        link = scope.links.get((node.as_pointer(), socket.identifier))
        if link is None:
            return None
        return self._output(scope, link.from_node, link.from_socket, depth + 1)

    def _input_or_value(self, scope: Scope, node: Any, socket: Any, depth: int) -> Source:
        """The same for a group's sockets, which pass on their own value when they are unlinked."""
        return self._input(scope, node, socket, depth) or Source(socket=socket)

    def _output(self, scope: Scope, node: Any, socket: Any, depth: int) -> Source:
        if depth > MAX_DEPTH:
            self.problems.append(f"Node '{node.name}' is part of a circle of links")
            return Source()
        if node.type == "REROUTE":
            return self._input(scope, node, node.inputs[0], depth) or Source()
        if node.mute:
            for link in node.internal_links:
                if link.to_socket == socket:
                    return self._input(scope, node, link.from_socket, depth) or Source()
            return Source()
        if node.type in GROUP_TYPES:
            return self._group_output(scope, node, socket, depth)
        if node.type == "GROUP_INPUT":
            return self._group_input(scope, socket, depth)
        return Source(self._visit(scope, node), socket.identifier)

    def _group_output(self, scope: Scope, node: Any, socket: Any, depth: int) -> Source:
        tree = node.node_tree
        if tree is None:
            self.problems.append(f"Node '{node.name}' has lost its group")
            return Source()
        inner = self._inner_scope(scope, node)
        if inner is None:
            return Source()
        outputs = [n for n in tree.nodes if n.type == "GROUP_OUTPUT"]
        active = next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
        if active is None:
            return Source()
        for candidate in active.inputs:
            if candidate.identifier == socket.identifier:
                return self._input_or_value(inner, active, candidate, depth + 1)
        return Source()

    def _group_input(self, scope: Scope, socket: Any, depth: int) -> Source:
        if scope.parent is None:
            return Source()
        for candidate in scope.group.inputs:
            if candidate.identifier == socket.identifier:
                return self._input_or_value(scope.parent, scope.group, candidate, depth + 1)
        return Source()
