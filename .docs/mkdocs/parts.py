"""The reference of a class whose methods are those of its parts, `add = of("_scripted", ScriptedTable.add)`."""

from pydoc import locate
from typing import Any

import griffe


class PartsExtension(griffe.Extension):
    """Shows such a method as if it were inherited of the part's class: with its arguments and its docstring."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Put the part's method in the place of each attribute that is made by `of`."""
        for name, member in list(cls.members.items()):
            value = member.value if member.is_attribute else None
            if isinstance(value, griffe.ExprCall) and value.canonical_path == "silo.core.calls.of":
                part, _, method = value.arguments[1].canonical_path.rpartition(".")
                written = getattr(locate(part), method)  # where it stands: the part may have it from another class
                target = f"{written.__module__}.{written.__qualname__}"
                cls.set_member(name, griffe.Alias(name, target, lineno=member.lineno, parent=cls, inherited=True))
