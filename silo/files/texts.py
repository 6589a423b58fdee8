"""Names and descriptions that every format can hold.

Python texts may hold lone surrogates (`os.fsdecode` makes them of bytes that are no UTF-8), which no file format takes.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence

from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.core.structs import alike
from silo.files.silo.format import plain_text, plain_texts


def presentable(recording: Recording) -> Recording:
    """The recording with all texts in proper Unicode, lone surrogates escaped: mostly it is the same object."""
    made = plain_texts(recording)
    parts = {
        "warnings": tuple(map(plain_text, recording.warnings)) or (),  # the default itself, see `log_facts`
        "elements": [_element(element) for element in recording.elements],
        "events": tuple(map(plain_texts, recording.events)),
    }
    other = {name: new for name, new in parts.items() if not _same(new, getattr(recording, name))}
    return alike(Recording, made, **other) if other else made


def _same(new: Sequence[object], old: Sequence[object]) -> bool:
    return all(one is other for one, other in zip(new, old, strict=True))


def _element(element: RecordedElement) -> RecordedElement:
    made = plain_texts(element)
    entries = tuple(map(_entry, element.entries))
    return made if _same(entries, element.entries) else alike(RecordedElement, made, entries=entries)


def _entry(entry: RecordedEntry) -> RecordedEntry:
    name, about, labels = plain_text(entry.name), plain_texts(entry.entry), entry.entry.labels
    if labels:
        about = alike(type(about), about, labels={number: plain_text(label) for number, label in labels.items()})
    return entry if (name, about) == (entry.name, entry.entry) else RecordedEntry(name, about, entry.values)


def unique_names(clean: Callable[[str], str], same: Callable[[str], str] = str) -> Callable[[str], str]:
    """What gives each name that it is called with one that nobody had before: cleaned, with a number where needed.

    same: what two names have in common that may not stand beside each other (`str.lower`).
    """
    taken: set[str] = set()

    def choose(name: str) -> str:
        chosen = next(one for one in numbered(clean(name)) if same(one) not in taken)
        taken.add(same(chosen))
        return chosen

    return choose


def numbered(name: str) -> Iterator[str]:
    """A name, and those that it gets where it is taken."""
    yield name
    yield from (f"{name}_{number}" for number in itertools.count(2))
