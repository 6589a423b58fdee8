"""Who has control."""

from dataclasses import dataclass

from silo.control import requests
from silo.control.lock import ControlLock
from silo.control.requests import TakeControl
from silo.rpc.serving import Server, Turn


@dataclass(frozen=True)
class ControlServer(Server, does=[requests]):
    """Gives control, and takes it back."""

    control_lock: ControlLock

    def take_control(self, turn: Turn, request: TakeControl) -> str:
        return self.control_lock.take(request, turn.sender)

    def release_control(self, turn: Turn) -> str:
        return self.control_lock.release(turn.sender)

    def give_control(self, turn: Turn, to: str) -> str:
        return self.control_lock.give(to, turn.sender)
