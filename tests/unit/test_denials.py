"""What was denied is told at once, a flood of it in a few lines; and what Zenoh's log says of refused logins."""

from silo.control.denials import MOST_KINDS, Denials
from silo.fleet.routers import RouterTold
from silo.net.access.logins import Logins

CAME = (
    "2026-11-22T17:09:54.48Z DEBUG acc-0 zenoh_link_tls::unicast: Accepted TLS connection on 127.0.0.1:60191: {}. "
    "Common Name: None."
)
_ACCEPT = "2026-11-22T17:09:54.48Z DEBUG acc-0 zenoh_transport::unicast::establishment::accept: "
LET_IN = (
    _ACCEPT + "New transport link accepted from aed3 to 3f76: "
    "TransportLinkUnicast {{ link: Link {{ src: tls/127.0.0.1:60191, dst: tls/{}, mtu: 49152 }} }}"
)
WRONG = f"\x1b[2m{_ACCEPT}\x1b[0mUsrPwd extension - Recv OpenSyn. Invalid password. at /root/usrpwd.rs:424."


class Clock:
    def __init__(self) -> None:
        self.s = 1000.0


def denials() -> tuple[Denials, Clock, list[tuple[str, str]]]:
    clock, told = Clock(), []
    made = Denials(lambda: clock.s)
    made.tell = lambda text, who: told.append((text, who))
    return made, clock, told


def test_the_first_is_told_at_once_and_a_flood_in_ever_fewer_lines() -> None:
    made, clock, told = denials()
    for _ in range(24 * 3600):
        made.note("login refused", "somebody at 10.0.0.7")
        made.watch()
        clock.s += 1.0
    assert told[0] == ("login refused", "somebody at 10.0.0.7")
    assert told[1] == ("login refused, 60 more in 60 s", "somebody at 10.0.0.7")
    assert len(told) <= 8 + 24
    assert made.count in range(3540, 3601)


def test_the_console_is_told_once_by_whoever_tells_it(caplog) -> None:
    made, _, told = denials()
    made.note("login refused", "somebody at 10.0.0.7")
    assert (len(told), caplog.messages) == (1, [])
    Denials().note("login refused", "somebody at 10.0.0.7")
    assert caplog.messages == ["login refused, by somebody at 10.0.0.7"]


def test_what_ended_is_told_at_once_when_it_begins_again() -> None:
    made, clock, told = denials()
    for _ in range(2):
        made.note("login refused", "somebody")
        clock.s += 3600.0
        made.watch()
        clock.s += 7200.0
        made.watch()
    assert told == [("login refused", "somebody")] * 2
    assert made.count == 0


def test_thousands_of_names_are_not_thousands_of_lines() -> None:
    made, clock, told = denials()
    for number in range(10_000):
        made.note("change denied: Stop", f"somebody {number}")
    assert len(told) == MOST_KINDS + 1
    clock.s += 61.0
    made.watch()
    assert told[-1] == ("logins and changes were denied, 9967 more in 61 s", "several others")


def refused(*lines: str) -> list[str]:
    found: list[str] = []
    logins = Logins(found.append)
    for line in lines:
        assert logins.read(line, 1.0)
    return found


def test_a_refused_login_is_of_who_came_last_and_was_not_let_in() -> None:
    alice, other = "10.0.0.5:33494", "10.0.0.7:33504"
    assert refused(CAME.format(other), WRONG) == ["somebody at 10.0.0.7"]
    assert refused(CAME.format(alice), LET_IN.format(alice), CAME.format(other), WRONG) == ["somebody at 10.0.0.7"]
    assert refused(CAME.format(alice), CAME.format(other), WRONG) == ["somebody"]  # either
    assert refused(CAME.format(other), CAME.format("10.0.0.7:1"), WRONG) == ["somebody at 10.0.0.7"]
    assert refused(WRONG) == ["somebody"]


def test_lines_that_are_not_of_zenoh_go_on(monkeypatch) -> None:
    monkeypatch.delenv("RUST_LOG", raising=False)
    found: list[str] = []
    Logins(lambda _: None).follow(["mine\n", WRONG + "\n"], found.append)
    assert found == ["mine\n"]
    monkeypatch.setenv("RUST_LOG", "debug")
    Logins(lambda _: None).follow([WRONG + "\n"], found.append)
    assert found[1:] == [WRONG.replace("\x1b[2m", "").replace("\x1b[0m", "") + "\n"]


def test_a_router_tells_how_many_logins_it_refused_and_the_last_of_them() -> None:
    assert RouterTold("desk9", 1, "").words == "router desk9: 1 login refused within the last hour"
    many = RouterTold("desk9", 14, "wrong password by ann").words
    assert many == "router desk9: 14 logins refused within the last hour, the last: wrong password by ann"
