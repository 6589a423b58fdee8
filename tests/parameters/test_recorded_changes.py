"""A change of parameters in a part of an endless recording is read as it stood in the event log."""

import numpy as np

from silo.core.elements import PARAMETER, LoggedEvent
from silo.core.tuning.parameters import ParameterChange
from silo.files.parts.events import event_messages, events_of


def test_a_change_comes_out_of_a_part_as_it_went_in():
    change = ParameterChange((("/log/kp", 40.0, 50.0), ("/log/gait", "STAND", "TROT")), "network", "a", 12)
    event = LoggedEvent(PARAMETER, "kp 40.0 -> 50.0", 5, 7, 9, "alice", "r", 3, change)
    data, _, _ = event_messages(1, [event], "bot", 0)
    assert events_of(data, np.zeros(1, np.uint64), 3, 7, "r") == [event]
