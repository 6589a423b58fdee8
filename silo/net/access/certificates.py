"""The certificates that a configuration names: which of them are not valid today.

Python's own module tells the dates of no certificate but a peer's, so the two are read here.
"""

import base64
import json
import re
import time
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from silo.net.configuration import from_file, written

_PEM = re.compile(r"-----BEGIN CERTIFICATE-----(.*?)-----END CERTIFICATE-----", re.DOTALL)
_KINDS = ("root_ca_certificate", "listen_certificate", "connect_certificate")
_TIMES = {0x17: "%y%m%d%H%M%SZ", 0x18: "%Y%m%d%H%M%SZ"}  # UTCTime, of years until 2049, and GeneralizedTime
_VERSION = 0xA0


def tls_of(config: str) -> dict[str, Any]:
    """Return what a configuration says of TLS, with paths that lead there from anywhere."""
    tls: dict[str, Any] = json.loads(from_file(config).get_json("transport/link/tls"))
    # Zenoh shows no values that can be secret, and takes this one for such
    return tls | {key: value for key, value in _written_tls(config).items() if key.endswith("_base64")}


def _written_tls(config: str) -> dict[str, object]:
    place: object = written(config)
    for word in ("transport", "link", "tls"):
        place = place.get(word) if isinstance(place, dict) else None
    return place if isinstance(place, dict) else {}


def pem_of(tls: dict[str, Any], kind: str) -> str | None:
    """Return the text of a certificate, None where the configuration names none. Raises OSError, ValueError."""
    encoded, path = tls.get(f"{kind}_base64"), tls.get(kind)
    if isinstance(encoded, str):
        return base64.b64decode(encoded).decode()
    return Path(path).read_text() if isinstance(path, str) else None


def not_valid_today(config: str) -> Iterator[str]:
    """Yield what is to be said of each certificate that is not valid now; what can't be read is for Zenoh to tell."""
    tls, now_s = tls_of(config), time.time()
    for kind in _KINDS:
        try:
            if (found := _PEM.search(pem_of(tls, kind) or "")) is None:
                continue
            begin_s, end_s = _dates_of(base64.b64decode(found[1]))
        except (OSError, ValueError, IndexError):
            continue
        if begin_s <= now_s <= end_s:
            continue
        name = tls.get(kind) or kind
        if now_s < begin_s:
            yield (
                f"{name}: this certificate is valid from {_day(begin_s)} on, and here it is {_day(now_s)}: is "
                "the clock of this computer right? Until then nobody gets in over the network"
            )
        else:
            yield (
                f"{name}: this certificate ran out on {_day(end_s)}: nobody gets in over the network; renew it "
                "(`silo remote init FOLDER` where it was made, copy the server folder here again) and start anew"
            )


def _dates_of(der: bytes) -> tuple[float, float]:
    """Return from when until when a certificate is valid, in s since 1970: RFC 5280, 4.1.

    Raises ValueError, IndexError for what is none.
    """
    _, at, _ = _part(der, 0)  # the certificate
    _, at, _ = _part(der, at)  # what is signed of it: version, number, algorithm, issuer, validity
    for _ in range(4 if der[at] == _VERSION else 3):
        _, _, at = _part(der, at)
    _, at, _ = _part(der, at)
    begin, at = _time(der, at)
    return begin, _time(der, at)[0]


def _part(der: bytes, at: int) -> tuple[int, int, int]:
    """Return the tag at a place, where its content begins, and where it ends."""
    tag, length, at = der[at], der[at + 1], at + 2
    if length & 0x80:
        size = length & 0x7F
        length, at = int.from_bytes(der[at : at + size], "big"), at + size
    return tag, at, at + length


def _time(der: bytes, at: int) -> tuple[float, int]:
    tag, begin, end = _part(der, at)
    if tag not in _TIMES:
        raise ValueError(f"no time has the tag {tag}")
    read = datetime.strptime(der[begin:end].decode("ascii"), _TIMES[tag]).replace(tzinfo=timezone.utc)
    return read.timestamp(), end


def _day(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
