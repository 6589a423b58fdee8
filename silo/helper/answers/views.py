"""What clients show as it happens: views, and surveys of quantities."""

from silo.helper.answers.table import Parts, answers_to, signed
from silo.ipc.messages import CloseView, Done, GetSurvey, OpenView, Refused, Survey, ViewOpened


@answers_to(OpenView)
def _open_view(parts: Parts, request: OpenView) -> ViewOpened | Refused:
    return parts.publisher.open_view(request)


@answers_to(CloseView)
def _close_view(parts: Parts, request: CloseView) -> Done | Refused:
    return parts.publisher.views.close_for(request.view, request.proof)


@answers_to(GetSurvey)
def _survey(parts: Parts, request: GetSurvey) -> Survey | Refused:
    return parts.surveyor.answer(signed(request))
