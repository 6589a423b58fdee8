"""Signals that are computed from others."""

from silo.arguments import line, text
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import RemoveDerived, SetDerived
from silo.model import Derived

_EXAMPLE = 'client.derive("power", "joints/tau * joints/qd")'


@told_class("client")
class DerivedCalls(Calls):
    """Derived signals."""

    def derive(self, name: str, expression: str, unit: str = "") -> str:
        """Have a signal computed from others wherever rows are read, also while the logger runs.

            client.derive("power", "joints/tau * joints/qd", unit="W")

        It is watched, plotted and saved as elements are. Given again, it gets a new expression.

        Args:
            name: with or without the prefix of the logger.
            expression: may use elements and other derived signals.
            unit: instead of the one that follows from its signals.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: it can't be computed, and why, or the robot program has ended; nothing was changed.
            ElementError: name or expression is no text; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        name, expression = text("the signal's name", name, _EXAMPLE), text("expression", expression, _EXAMPLE)
        one = Derived(name, expression, line("unit", unit, 'unit="W"'))
        return self._call(SetDerived(derived=one, client=self._name)).text

    def remove_derived(self, name: str) -> str:
        """Forget a derived signal on which nothing stands, also while the logger runs.

        Args:
            name: with or without the prefix of the logger.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is none, or something uses it, or the robot program has ended; nothing was changed.
            ElementError: the name is no text; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        name = text("the signal's name", name, 'client.remove_derived("power")')
        return self._call(RemoveDerived(name=name, client=self._name)).text
