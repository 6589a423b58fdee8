"""Names and descriptions that every format can hold.

Python texts may hold lone surrogates (`os.fsdecode` makes them of bytes that are no UTF-8), which no file format takes.
"""

from dataclasses import replace

import msgspec

from silo.core.elements import Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.silo.format import event_facts, plain_text


def presentable(recording: Recording) -> Recording:
    """The recording with all texts in proper Unicode, lone surrogates escaped: mostly it is the same object."""
    elements = [_element(element) for element in recording.elements]
    same = all(new is old for new, old in zip(elements, recording.elements, strict=True))
    told = [text for event in recording.events for text in (event.text, event.who)]
    texts = (recording.logger, recording.prefix, recording.why, *recording.warnings, *told)
    if same and all(map(_is_proper, texts)):
        return recording
    return replace(
        recording,
        logger=plain_text(recording.logger),
        prefix=plain_text(recording.prefix),
        warnings=tuple(map(plain_text, recording.warnings)),
        why=plain_text(recording.why),
        elements=elements,
        events=tuple(map(event_facts, recording.events)),
    )


def _element(element: RecordedElement) -> RecordedElement:
    names = [text for entry in element.entries for text in (entry.name, entry.entry.suffix)]
    labels = [label for entry in element.entries for label in (entry.entry.labels or {}).values()]
    if all(
        map(_is_proper, (element.name, element.unit, element.kind, element.description, element.dtype, *names, *labels))
    ):
        return element
    return replace(
        element,
        name=plain_text(element.name),
        unit=plain_text(element.unit),
        kind=plain_text(element.kind),
        description=plain_text(element.description),
        dtype=plain_text(element.dtype),
        entries=tuple(
            RecordedEntry(plain_text(entry.name), _entry(entry.entry), entry.values) for entry in element.entries
        ),
    )


def _entry(entry: Entry) -> Entry:
    labels = None if entry.labels is None else {number: plain_text(label) for number, label in entry.labels.items()}
    return msgspec.structs.replace(entry, suffix=plain_text(entry.suffix), labels=labels)


def _is_proper(text: str) -> bool:
    return text.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in text)
