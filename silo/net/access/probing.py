"""Which layer of a way to a robot fails: name resolution, route, port, TLS, user and password. One message for each.

Zenoh itself says only "unable to connect". What can be told is told before it is asked, and measured at the same time:
the round trip of a TCP connection, by which all waiting scales.
"""

import enum
import re
import socket
import time
from typing import TYPE_CHECKING, NamedTuple

from silo.errors import ConnectionLostError, reason
from silo.net.access.certificates import not_valid_today, pem_of, tls_of
from silo.net.configuration import endpoints_of, from_file, reason_of, user_of

if TYPE_CHECKING:
    import ssl

REACH_S = 5.0  # how long an address may stay silent
ALERT_S = 0.5  # how long to wait for what a server of TLS 1.3 says of our certificate, beside two round trips
_ENDPOINT = re.compile(r"(?P<kind>[a-z-]+)/(?P<host>\[[^\]]*\]|[^:/?#]+):(?P<port>[0-9]+)([?#].*)?")
_OVER_TCP = ("tcp", "tls", "ws")


class Layer(enum.Enum):
    """What fails, from below to above."""

    CONFIGURATION = "configuration"
    NAME = "name resolution"
    ROUTE = "route"
    PORT = "port"
    TLS_AUTHORITY = "TLS authority"
    TLS_NAME = "TLS name"
    TLS_DATE = "TLS date"
    TLS_CLIENT = "TLS client certificate"
    TLS = "TLS"
    PASSWORD = "password"
    ROLE = "role"
    VERSION = "version"


class LayerError(ConnectionLostError):
    """A way to a robot fails, and at which layer."""

    def __init__(self, layer: Layer, text: str) -> None:
        super().__init__(text)
        self.layer = layer


class Endpoint(NamedTuple):
    """Where to connect to: `tls/robot3.local:7447`."""

    kind: str
    host: str
    port: int
    text: str


class Reached(NamedTuple):
    """An endpoint that takes connections, and its round trip time in s; that is 0 where it can't be measured."""

    endpoint: Endpoint | None
    address: str
    rtt_s: float


def endpoint_of(text: str) -> Endpoint | None:
    """Read an endpoint; None for what isn't reached by host and port."""
    found = _ENDPOINT.fullmatch(text)
    if found is None or int(found["port"]) > 65535:
        return None
    return Endpoint(found["kind"], found["host"].strip("[]"), int(found["port"]), text)


def reach(config: str, timeout_s: float = REACH_S) -> Reached:
    """Return the first endpoint of a configuration that takes connections.

    Raises LayerError with the reason of each, where none does.
    """
    texts = endpoints_of(from_file(config), "connect", "client")
    if not texts:
        raise LayerError(
            Layer.CONFIGURATION,
            f'{config}: names nobody to connect to; add connect: {{ endpoints: ["tls/HOST:7447"] }}, or make a remote '
            "by `silo remote add NAME tls/HOST:7447`",
        )
    failed: list[LayerError] = []
    for text in texts:
        endpoint = endpoint_of(text)
        if endpoint is None or endpoint.kind not in _OVER_TCP:
            return Reached(endpoint, "", 0.0)  # QUIC, a Unix socket: Zenoh alone can tell
        try:
            return _reached(endpoint, timeout_s)
        except LayerError as error:
            failed.append(error)
    raise LayerError(failed[0].layer, "\n".join(dict.fromkeys(str(error) for error in failed)))


def _reached(endpoint: Endpoint, timeout_s: float) -> Reached:
    try:
        found = socket.getaddrinfo(endpoint.host, endpoint.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise LayerError(
            Layer.NAME,
            f"{endpoint.text}: no computer is called '{endpoint.host}' here ({reason(error)}): check the spelling, "
            "write its IP address, or add it to /etc/hosts",
        ) from error
    told: OSError = TimeoutError()
    for family, kind, protocol, _, address in found:
        with socket.socket(family, kind, protocol) as sock:
            sock.settimeout(timeout_s)
            begun_s = time.monotonic()
            try:
                sock.connect(address)
            except OSError as failure:
                # a refusal says more than silence: somebody is there
                told = failure if not isinstance(told, ConnectionRefusedError) else told
                continue
            return Reached(endpoint, str(address[0]), time.monotonic() - begun_s)
    where = f"{endpoint.text} ({', '.join(dict.fromkeys(str(one[4][0]) for one in found))})"
    if isinstance(told, ConnectionRefusedError):
        raise LayerError(
            Layer.PORT,
            f"{where}: that computer is there, but nobody listens on port {endpoint.port}: is the robot program or the "
            "router running, and is this the port that it listens on?",
        ) from told
    why = f"no answer within {timeout_s:g} s" if isinstance(told, TimeoutError) else reason(told)
    raise LayerError(
        Layer.ROUTE,
        f"{where}: no way there: {why}: is it switched on, in this network or behind the VPN, does no firewall swallow "
        "it, and do not too many wait there to be let in?",
    ) from told


def explain(config: str, reached: Reached, error: Exception, silent_s: float = 0.0) -> LayerError:
    """Return why Zenoh could not connect to an endpoint that takes connections.

    `silent_s` is how long it was waited for its words in vain; 0 where it hung up.
    """
    settings = from_file(config)
    if reached.endpoint is not None and reached.endpoint.kind == "tls":
        problem = tls_problem(config, reached.endpoint, reached.rtt_s)
        if problem is not None:
            return problem
    where = reached.endpoint.text if reached.endpoint is not None else f"what {config} names"
    if reached.endpoint is None or reached.endpoint.kind not in _OVER_TCP:
        return LayerError(
            Layer.PORT,
            f"{where}: can't connect ({reason_of(error)}): check address, certificates, user name and password in "
            f"{config}; over UDP nobody says which of them fails",
        )
    if silent_s:
        return LayerError(
            Layer.PORT,
            f"{where}: it takes connections, but said nothing for {silent_s:.1f} s: the link is too thin or loses too "
            "much, the robot is frozen or overloaded, or what listens there isn't silo; try again",
        )
    user = user_of(settings)
    if not user:
        text = f"it takes connections, but lets nobody in without user name and password, and {config} has none"
    else:
        text = f"user '{user}' or its password is refused; both stand in {config}"
    plain = reached.endpoint.kind == "tcp"  # to which what speaks TLS says nothing either
    tls = f"it wants TLS, as {where.replace('tcp/', 'tls/', 1)}, or " if plain else ""
    others = "too many wait there to be let in, or what listens there isn't silo"
    return LayerError(Layer.PASSWORD, f"{where}: {text} (or {tls}{others})")


def tls_problem(config: str, endpoint: Endpoint, rtt_s: float = 0.0) -> LayerError | None:
    """Shake hands as Zenoh does, and return what is wrong with the certificates; None where nothing is."""
    import ssl  # takes 15 ms, and only what fails needs it

    tls = tls_of(config)
    try:
        context = ssl.create_default_context(cadata=pem_of(tls, "root_ca_certificate"))
        context.check_hostname = tls.get("verify_name_on_connect") is not False
        if tls.get("connect_certificate") and tls.get("connect_private_key"):
            context.load_cert_chain(tls["connect_certificate"], tls["connect_private_key"])
    except (OSError, ValueError) as error:  # an ssl.SSLError is one, too
        return LayerError(
            Layer.CONFIGURATION, f"the certificates that the configuration names can't be read: {reason(error)}"
        )
    try:
        with socket.create_connection((endpoint.host, endpoint.port), REACH_S) as raw:
            raw.settimeout(REACH_S + 4 * rtt_s)
            with context.wrap_socket(raw, server_hostname=endpoint.host) as wrapped:
                wrapped.settimeout(ALERT_S + 2 * rtt_s)
                wrapped.recv(1)
    except ssl.SSLCertVerificationError as error:
        return _certificate_problem(endpoint, error)
    except TimeoutError:
        return None  # it waits for our first word: all is well
    except ssl.SSLError as error:
        if "CERTIFICATE_EXPIRED" in (error.reason or "") and (ours := next(not_valid_today(config), "")):
            return LayerError(Layer.TLS_DATE, f"{endpoint.text}: it refuses our certificate: {ours}")
        if "CERTIFICATE" in (error.reason or "").upper() or "ALERT_UNKNOWN_CA" in (error.reason or ""):
            return LayerError(
                Layer.TLS_CLIENT,
                f"{endpoint.text}: it wants a certificate of ours, and the configuration has none, or one that it "
                "doesn't accept: set connect_certificate, connect_private_key and enable_mtls under transport.link.tls",
            )
        return LayerError(
            Layer.TLS,
            f"{endpoint.text}: what listens there speaks no TLS ({error.reason}): is it tcp/ or another port?",
        )
    except OSError:
        return None  # it hung up: not because of TLS
    return None


def _certificate_problem(endpoint: Endpoint, error: "ssl.SSLCertVerificationError") -> LayerError:
    if error.verify_code in (62, 64):  # X509_V_ERR_HOSTNAME_MISMATCH, X509_V_ERR_IP_ADDRESS_MISMATCH
        return LayerError(
            Layer.TLS_NAME,
            f"{endpoint.text}: its certificate is for another name than '{endpoint.host}' ({error.verify_message}): "
            "connect to the name that it was made for, or make it one with this name (`silo remote init --host`)",
        )
    if error.verify_code in (9, 10):
        return LayerError(
            Layer.TLS_DATE,
            f"{endpoint.text}: its certificate is not valid today ({error.verify_message}): are the clocks of both "
            "computers right? Else renew it (`silo remote init`)",
        )
    return LayerError(
        Layer.TLS_AUTHORITY,
        f"{endpoint.text}: its certificate is not of the authority that we trust ({error.verify_message}): take the "
        "client file that was made with the robot's (`silo remote init`)",
    )
