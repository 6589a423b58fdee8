"""What silo returns and takes, by name, for annotations: `def keep(saved: silo.types.SavedFile) -> None`."""

from silo.analysis.compare import Comparison
from silo.analysis.compute.responses import Bode, StepResponse
from silo.core.elements import ElementInfo, FileType, SavedFile, Storage, Threads
from silo.core.kinds import vector_at_position
from silo.logger.results import LoggedElement, NewValues
from silo.logger.serving.serving import Serving

__all__ = [
    "Bode",
    "Comparison",
    "ElementInfo",
    "FileType",
    "LoggedElement",
    "NewValues",
    "SavedFile",
    "Serving",
    "StepResponse",
    "Storage",
    "Threads",
    "vector_at_position",
]
