"""Views of the terminal that the robot keeps: plain names in one folder, whatever is asked."""

import pytest

from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.scripts import view_folder
from silo.scripts.script_folder import list_scripts


@pytest.fixture
def script(tmp_path):
    (tmp_path / "config").mkdir()
    return tmp_path / "config" / "robot.yaml"


def refusal(call, *arguments, **options) -> RefusedWhy:
    with pytest.raises(RequestRefusedError) as error:
        call(*arguments, **options)
    return error.value.why


def test_a_view_that_was_kept_is_listed_and_read(script):
    assert view_folder.names(script) == []
    path = view_folder.keep(script, "walk 2", "sort: div\n", overwrite=False)
    assert path == script.parent / "views" / "walk 2.yaml"
    assert view_folder.names(script) == ["walk 2"]
    assert view_folder.read(script, "walk 2") == (path, "sort: div\n")


def test_one_that_exists_is_only_replaced_on_demand(script):
    view_folder.keep(script, "walk", "a: 1", overwrite=False)
    assert refusal(view_folder.keep, script, "walk", "a: 2", overwrite=False) is RefusedWhy.EXISTS
    assert view_folder.read(script, "walk")[1] == "a: 1"
    view_folder.keep(script, "walk", "a: 2", overwrite=True)
    assert view_folder.read(script, "walk")[1] == "a: 2"


@pytest.mark.parametrize("name", ["", "../robot", "a/b", ".hidden", " a", "a" * 81, "a\n"])
def test_what_is_no_plain_name_is_refused(script, name):
    script.write_text("mine")
    assert refusal(view_folder.read, script, name) is RefusedWhy.INVALID
    assert refusal(view_folder.keep, script, name, "x", overwrite=True) is RefusedWhy.INVALID
    assert script.read_text() == "mine"


def test_no_link_is_followed(script, tmp_path):
    secret = tmp_path / "secret.yaml"
    secret.write_text("secret")
    view_folder.keep(script, "walk", "a", overwrite=False)
    (script.parent / "views" / "link.yaml").symlink_to(secret)
    assert refusal(view_folder.read, script, "link") is RefusedWhy.FAILED
    assert refusal(view_folder.keep, script, "link", "x", overwrite=True) is RefusedWhy.INVALID
    assert secret.read_text() == "secret"


def test_a_folder_of_views_that_is_a_link_is_refused(script, tmp_path):
    (script.parent / "views").symlink_to(tmp_path)
    assert view_folder.names(script) == []
    assert refusal(view_folder.keep, script, "walk", "x", overwrite=True) is RefusedWhy.FORBIDDEN


def test_a_text_that_is_too_long_is_refused(script):
    text = "x" * (view_folder.MOST_BYTES + 1)
    assert refusal(view_folder.keep, script, "walk", text, overwrite=False) is RefusedWhy.INVALID
    assert view_folder.names(script) == []


def test_views_are_no_scripts(script):
    script.write_text("log_elements: []")
    view_folder.keep(script, "walk", "a", overwrite=False)
    assert list_scripts(script) == ["robot.yaml"]


def test_one_that_isnt_there_is_told_with_those_that_are(script):
    view_folder.keep(script, "walk", "a", overwrite=False)
    with pytest.raises(match="there: walk"):
        view_folder.read(script, "wlak")
