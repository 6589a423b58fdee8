"""Leases by a clock that stands where it is put: who holds what, until when, and what ends by itself."""

from dataclasses import dataclass

import hypothesis.strategies as st
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from silo.rpc.leases import Leases

MOST, MOST_OF_OWNER = 5, 2
KEYS = st.sampled_from(["a", "b", "c", "d", "e", "f"])
OWNERS = st.sampled_from(["anna", "bob", "carol"])
LEASES_S = st.sampled_from([0.5, 6.0, 30.0])


@dataclass
class Held:
    """What the model knows of one."""

    value: int
    owner: str
    ends_s: float


class LeaseMachine(RuleBasedStateMachine):
    """Owners come, renew, let go and die while time goes on; the model is a list of what each did."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 100.0
        self.leases: Leases[str, int] = Leases(MOST, MOST_OF_OWNER, clock=lambda: self.now_s)
        self.held: dict[str, Held] = {}
        self.unheard: list[int] = []  # values that ended by themselves and were replaced
        self.number = 0

    def living(self) -> dict[str, Held]:
        return {key: one for key, one in self.held.items() if self.now_s < one.ends_s}

    @rule(key=KEYS, owner=OWNERS, lease_s=LEASES_S)
    def somebody_asks_for_one(self, key: str, owner: str, lease_s: float) -> None:
        others = [one for name, one in self.living().items() if name != key]
        own = sum(one.owner == owner for one in others)
        full = self.leases.full(key, owner)
        if len(others) >= MOST:
            assert full == (len(others), False)
        elif own >= MOST_OF_OWNER:
            assert full == (own, True)
        else:
            assert full is None
            before = self.held.get(key)
            if before is not None and key not in self.living():
                self.unheard.append(before.value)
            self.number += 1
            self.leases.set(key, self.number, lease_s, owner)
            self.held[key] = Held(self.number, owner, self.now_s + lease_s)

    @rule(key=KEYS, lease_s=LEASES_S, owner=st.none() | OWNERS)
    def somebody_renews_one(self, key: str, lease_s: float, owner: str | None) -> None:
        known = self.living().get(key)
        assert self.leases.renew(key, lease_s, owner) == (known.value if known else None)
        if known is not None:
            known.ends_s, known.owner = self.now_s + lease_s, known.owner if owner is None else owner

    @rule(key=KEYS)
    def somebody_lets_go_of_one(self, key: str) -> None:
        known = self.held.pop(key, None)
        assert self.leases.drop(key) == (known.value if known else None)

    @rule(owner=OWNERS)
    def an_owner_dies(self, owner: str) -> None:
        gone = {key for key, one in self.held.items() if one.owner == owner}
        assert {one.key for one in self.leases.drop_of(owner)} == gone
        self.held = {key: one for key, one in self.held.items() if key not in gone}

    @rule(seconds=st.sampled_from([0.1, 0.5, 5.9, 6.0, 31.0]))
    def time_goes_on(self, seconds: float) -> None:
        self.now_s += seconds

    @rule()
    def somebody_looks_what_ended(self) -> None:
        over = [key for key in self.held if key not in self.living()]
        expected = sorted([*self.unheard, *(self.held.pop(key).value for key in over)])
        found = self.leases.expire()
        assert sorted(one.value for one in found) == expected
        assert [one.ends_s for one in found] == sorted(one.ends_s for one in found)
        self.unheard = []
        assert self.leases.expire() == []

    @invariant()
    def what_is_held_is_what_was_taken_and_is_not_over(self) -> None:
        living = self.living()
        assert {one.key: (one.value, one.owner, one.ends_s) for one in self.leases.all()} == {
            key: (one.value, one.owner, one.ends_s) for key, one in living.items()
        }
        for key in "abcdef":
            assert self.leases.get(key) == (living[key].value if key in living else None)


LeaseMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestLeases = LeaseMachine.TestCase


def test_a_quarter_is_for_owners_that_are_known_and_all_is() -> None:
    leases: Leases[str, int] = Leases(8, knows=lambda owner: owner == "alice")
    for at in range(6):
        assert leases.full(f"b{at}", f"bob{at}") is None
        leases.set(f"b{at}", at, 30, f"bob{at}")
    assert leases.full("b6", "bob6") == (6, False)
    assert leases.full("b5", "bob5") is None  # its own, anew
    for at in range(2):
        assert leases.full(f"a{at}", "alice") is None
        leases.set(f"a{at}", at, 30, "alice")
    assert leases.full("a2", "alice") == (8, False)
    leases.drop("b0")
    assert leases.full("b6", "bob6") is None
