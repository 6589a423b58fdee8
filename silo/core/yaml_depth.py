"""YAML that is read with the parser of C where PyYAML has it, and never deeper than the C stack has room for."""

import yaml

MAX_DEPTH = 16  # a script is five levels deep, the metadata of a bag six; the C parser recurses on the C stack
TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"


class ShallowLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # the C one takes an eighth
    """Plain values and nothing else. Raises `yaml.YAMLError` for what is nested deeper than any file of ours."""

    depth = 0

    def descend_resolver(self, *_: object) -> None:
        """Count a level that begins."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem=TOO_DEEP)

    def ascend_resolver(self) -> None:
        """Count it no more."""
        self.depth -= 1
