# ruff: noqa: F401 - a topic enters its handlers when it is imported
"""What the helper answers to each request: a function each, registered with `answers_to`, in a module per topic.

Pure routing: what is checked and who does it; the work is done in the modules that are called here.
"""

from silo.helper.answers import (
    conditions,
    control,
    derived,
    elements,
    events,
    files,
    layouts,
    moments,
    recorders,
    samples,
    scripts,
    state,
    views,
)
from silo.helper.answers.answering import Answers as Answers
from silo.helper.answers.table import HANDLERS as HANDLERS
from silo.helper.answers.table import LANES as LANES
