"""What was answered to changes that their clients numbered, so that one that is asked for again isn't done again."""

OF_EACH = 4  # a client asks for one after the other, and again within seconds
MOST_CLIENTS = 256
MOST_BYTES = 4 * 2**20


class LastAnswers:
    """The last answers to each client, as they are encoded. For one thread at a time."""

    def __init__(self) -> None:
        self._of: dict[str, dict[str, bytes]] = {}  # by client and number; who was answered last comes last

    def keep(self, client: str, number: str, answer: bytes) -> None:
        """Keep an answer, in place of the oldest ones where there is no room."""
        of = self._of.pop(client, {})
        self._of[client] = of
        of[number] = answer
        while len(of) > OF_EACH:
            del of[next(iter(of))]
        while len(self._of) > MOST_CLIENTS or (len(self._of) > 1 and self._size_bytes > MOST_BYTES):
            del self._of[next(iter(self._of))]

    def find(self, client: str, number: str) -> bytes | None:
        """Return what was answered, None where that isn't known."""
        return self._of.get(client, {}).get(number)

    @property
    def by_number(self) -> dict[str, bytes]:
        """All of them."""
        return {number: answer for of in self._of.values() for number, answer in of.items()}

    @property
    def _size_bytes(self) -> int:
        return sum(len(answer) for of in self._of.values() for answer in of.values())
