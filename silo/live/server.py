"""Views of what happens, and surveys of quantities."""

from dataclasses import dataclass

from silo.live import requests
from silo.live.publisher import Publisher
from silo.live.requests import CloseView, GetSurvey, OpenView, Survey, ViewOpened
from silo.live.statistics import Surveyor
from silo.rpc.serving import Server


@dataclass(frozen=True)
class LiveServer(Server, does=[requests]):
    """Opens and closes views, and answers surveys."""

    publisher: Publisher
    surveyor: Surveyor

    def open_view(self, request: OpenView) -> ViewOpened:
        return self.publisher.open_view(request)

    def close_view(self, request: CloseView) -> str:
        return self.publisher.views.close_for(request.view, request.proof)

    def get_survey(self, request: GetSurvey) -> Survey:
        return self.surveyor.answer(request)
